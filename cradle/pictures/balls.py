"""Drawings of chains, and of outcomes ball by ball; axes, numbers and colours as in `impacts`."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from cradle.chain import Chain
from cradle.input.values import must_be, shown
from cradle.pictures.impacts import PALETTE, axes_or_new, indexed
from cradle.trace import Trace

__all__ = ["chain_sketch", "outcome_by_ball"]


def outcome_by_ball(
    traces: Trace | Sequence[Trace], ax: Axes | None = None, *, letters: str = ""
) -> Axes:
    r"""Draw post-impact velocities over the striker's speed by ball, as in the paper's Figs. 10-12.

    Parameters
    ----------
    traces : Trace or sequence of Trace
        Impacts of one chain by its first ball, at one or several speeds.
    ax : Axes, optional
        Where to draw; new axes if left out.
    letters : str
        A name for each ball, written under its number.

    Raises
    ------
    ValueError
        If there is no impact, the chains differ in length, a first ball was at rest, or there are
        not as many names as balls.

    Examples
    --------
    >>> from cradle import collide, paper_chain
    >>> ax = outcome_by_ball(collide(*paper_chain("BABA")), letters="BABA")
    >>> [label.get_text() for label in ax.get_xticklabels()]
    ['1\nB', '2\nA', '3\nB', '4\nA']
    """
    ax = axes_or_new(ax)
    given = [traces] if isinstance(traces, Trace) else list(traces)
    several = [must_be(Trace, "traces", trace) for trace in given]
    sizes = {len(trace.chain) for trace in several}
    if len(sizes) != 1:
        raise ValueError(f"traces has chains of {sorted(sizes)} balls; must be of one length")
    number = np.arange(1, sizes.pop() + 1)
    if len(letters) not in (0, len(number)):
        raise ValueError(f"letters = {shown(letters)}; {len(number)} balls need as many, or none")
    if not all(trace.chain.velocities[0] for trace in several):
        raise ValueError("traces has a first ball at rest; velocities are shown over its speed")
    ax.axhline(0, color="0.4", lw=0.8)
    # Nested open markers: equal outcomes are seen as such, none hides another.
    for k, trace in enumerate(several):
        speed = trace.chain.velocities[0]
        ax.plot(number, trace.velocities / speed, "osDhXP*"[k % 7], ms=5 + 4 * k, mfc="none",
                mew=1.5, color=PALETTE[k % len(PALETTE)],
                label=rf"$v_1^-$ = {speed:g} m/s")  # fmt: skip
    ax.plot(number, several[0].velocities / several[0].chain.velocities[0], "0.6", lw=1, zorder=1)
    names = [f"{n}\n{letter}" for n, letter in zip(number, letters, strict=False)]
    ax.set_xticks(number, names or None)
    ax.margins(y=0.12)  # room for the large markers
    ax.set(xlabel="ball number", ylabel=r"$v^+ / v_1^-$", xlim=(0, number[-1] + 1))
    ax.grid(alpha=0.3)
    return ax


def chain_sketch(chain: Chain, ax: Axes | None = None, *, letters: str = "") -> Axes:
    """Draw a chain as a row of balls: radii as for one density, arrows for velocities.

    Parameters
    ----------
    chain : Chain
    ax : Axes, optional
        Where to draw; new axes if left out.
    letters : str
        Names written in the balls; B1, B2, ... if left out.

    Examples
    --------
    >>> ax = chain_sketch(Chain([8, 1], [1, 0], 1))
    >>> [round(patch.get_radius(), 3) for patch in ax.patches if isinstance(patch, Circle)]
    [0.5, 0.25]
    """
    n = len(must_be(Chain, "chain", chain))
    if len(must_be(str, "letters", letters)) not in (0, n):
        raise ValueError(f"letters = {shown(letters)}; {n} balls need {n}, or none")
    ax = axes_or_new(ax)
    radii = 0.5 * np.cbrt(chain.masses / np.max(chain.masses))
    centres = np.cumsum(2 * radii) - radii
    fastest = np.abs(chain.velocities).max() or 1.0
    for ball, (radius, x) in enumerate(zip(radii.tolist(), centres.tolist(), strict=True)):
        ax.add_patch(Circle((x, 0), radius, fc="0.93", ec=PALETTE[ball % len(PALETTE)], lw=2))
        name = letters[ball] if letters else indexed("B", ball + 1)
        # A name that does not fit in its ball stands above it.
        ax.text(x, 0 if radius > 0.2 else radius + 0.12, name, ha="center", va="center")
        ax.text(x, -0.85, indexed("m", ball + 1), ha="center", va="center", fontsize=9)
        if chain.velocities[ball]:
            length = 0.9 * chain.velocities[ball] / fastest
            tail, tip = (x - length / 2, 0.68), (x + length / 2, 0.68)
            ax.annotate("", tip, tail, arrowprops={"arrowstyle": "-|>", "color": "black"})
            ax.text(x, 0.86, indexed("v", ball + 1), ha="center", va="center")
        if ball < len(chain) - 1:
            name = indexed(r"\tau", ball + 2)
            ax.text(x + radius, -0.62, name, ha="center", va="center", fontsize=9)
    ax.set(xlim=(-0.2, centres[-1] + radii[-1] + 0.2), ylim=(-1.0, 1.0), aspect="equal")
    ax.set_axis_off()
    return ax
