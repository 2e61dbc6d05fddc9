"""What a recommendation says, and how it is shown."""

from __future__ import annotations

from dataclasses import dataclass, fields
from html import escape
from typing import Any

import numpy as np

from cradle.models import Model


@dataclass(frozen=True, repr=False)
class Recommendation:
    """A model for a scene, and what to expect of it.  What was not measured is None.

    Attributes
    ----------
    model, call, setting : Model, str, str
        Ready for `collide`; what to call; integrator and tolerance, one call or a batch.
    numerical_error : float or None
        Largest distance of a velocity from the exact answer of the same model on the chains of
        `measured_on`, as a part of the closing speed.  Another chain may have a few times as much;
        `accuracy` leaves room for that.
    model_error : float or None
        The same from Hertz springs, the theory of elastic spheres (equal ones, unless `stiffness`
        says otherwise); no setting makes it smaller.  With losses there is no such theory: None.
    seconds : float or None
        Time of one impact on the machine that measured, to a factor of two, once the event loop is
        compiled, if the model has one.
    measured_on : tuple of str
        The chains of these numbers: this very one, or those around it, of which the worst counts.
    reason : str
        Why this model.

    Examples
    --------
    >>> from cradle import Chain, recommend
    >>> recommend(Chain([1] * 20, [1] + [0] * 19), stiffness=1.0).seconds is None
    True
    """

    model: Model
    setting: str
    call: str
    numerical_error: float | None
    model_error: float | None
    seconds: float | None
    measured_on: tuple[str, ...]
    reason: str

    def _lines(self) -> dict[str, str]:
        """Return what is shown, by its title."""

        def number(value: float | None) -> str:
            return "not measured" if value is None else f"{value:.1e}" if value else "0"

        time = "not measured" if self.seconds is None else lasting(self.seconds)
        if self.seconds is not None and self.setting.startswith("compiled"):
            time += " once compiled; small work runs in plain Python, many times slower"
        return {
            "setting": self.setting,
            "call": self.call,
            "numerical error": number(self.numerical_error),
            "model error": number(self.model_error),
            "time": time,
            "measured on": "; ".join(self.measured_on) or "nothing like this",
            "reason": self.reason,
        }

    def __repr__(self) -> str:
        lines = [f"  {title + ':':<17}{text}" for title, text in self._lines().items()]
        return "\n".join([f"Recommendation: {made(self.model)}", *lines])

    def _repr_html_(self) -> str:
        lines = {"model": made(self.model), **self._lines()}.items()
        style = ' style="overflow-wrap: anywhere"'  # on a phone, too, nothing is cut
        rows = [f"<tr><th>{escape(a)}</th><td{style}>{escape(b)}</td></tr>" for a, b in lines]
        return f'<table class="dataframe">{"".join(rows)}</table>'  # pages style it as a table


def lasting(seconds: float) -> str:
    """Return a time in two digits; microseconds are us, for terminals without the letter mu."""
    units = {"us": 1e-6, "ms": 1e-3, "s": 1.0}
    name = next((unit for unit, size in units.items() if seconds < 999.5 * size), "s")
    return f"{np.format_float_positional(float(f'{seconds / units[name]:.1e}'), trim='-')} {name}"


def made(model: Any) -> str:
    """Return the call that makes a model, without what is as usual."""
    values = {one.name: (getattr(model, one.name), one.default) for one in fields(model)}
    given = [f"{name}={value!r}" for name, (value, usual) in values.items() if value != usual]
    return f"{type(model).__name__}({', '.join(given)})"
