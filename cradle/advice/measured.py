"""What was measured of the models: errors and times, on which chains; read from the data.

The table is `benchmarks.csv`, the one that the book shows ("Which model does your scene need?").
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from cradle.chain import Chain
from cradle.models.correlation import ImpulseCorrelation
from cradle.runtime import compile as runtime
from cradle.tables import paper_chain, table_rows

__all__ = ["Evidence", "Measured", "evidence", "lasting", "measured_chain", "rows", "unit_time"]


class Measured(NamedTuple):
    """One model in one setting on one chain."""

    group: str
    model: str
    setting: str
    chain: str
    #: The setting as a number.
    parameter: float
    #: Largest distance of a velocity from the exact answer of the same model, over the closing
    #: speed; None where the table has none.
    numerical_error: float | None
    #: The same from Hertz springs.
    model_error: float | None
    #: Time of an impact in the table's unit.
    time_ratio: float
    #: What the model gives: "velocities", "impulses", "path", "forces", "times".
    gives: frozenset[str]


class Evidence(NamedTuple):
    """What was measured of one setting, for one chain."""

    rows: tuple[Measured, ...]
    #: Measured on this very chain, which is then the only row.
    exact: bool
    #: Measured on it or on chains around it.
    measured: bool

    @property
    def error(self) -> float:
        """Largest numerical error of the rows."""
        return max(row.numerical_error or 0.0 for row in self.rows)

    @property
    def cost(self) -> float:
        """Longest time of the rows, in the table's unit."""
        return max(row.time_ratio for row in self.rows)

    @property
    def chains(self) -> tuple[str, ...]:
        """Names of the chains of the rows."""
        return tuple(row.chain for row in self.rows)


@cache
def unit_time() -> float:
    """Return the unit of times, s: one impact of three balls in a batch, where it was measured."""
    timed = [line for line in table_rows("benchmarks.csv") if line["time_ratio"]]
    times = [float(line["microseconds"]) / float(line["time_ratio"]) for line in timed]
    return 1e-6 * float(np.median(times))


def lasting(seconds: float) -> str:
    """Return a time in two digits; microseconds are us, for terminals without the letter mu."""
    for name, size in (("us", 1e-6), ("ms", 1e-3), ("s", 1.0)):
        if seconds < 999.5 * size or name == "s":
            break
    return f"{np.format_float_positional(float(f'{seconds / size:.1e}'), trim='-')} {name}"


@cache
def rows(group: str, kernel: str = "") -> tuple[Measured, ...]:
    """Return the rows of a group, in settings that this installation and its calls have."""
    kernel = kernel or ("compiled" if runtime.available() else "plain")
    path, batch = f"{kernel}, one call with its path", f"{kernel}, batch"
    found = []
    for line in table_rows("benchmarks.csv"):
        if line["model"] == "two balls" and line["setting"].startswith("all: "):
            # A batch of two balls, by `post_impact_velocities`.
            line = line | {"group": "event", "model": "ImpulseCorrelation", "setting": batch}
        there = group != "event" or line["setting"] in (path, batch)
        if line["group"] == group and there and not line["model"].endswith("linear"):
            error = line["numerical_error"]
            apart = line["model_error"] if line["model_reference"].startswith("Hertz") else ""
            found.append(Measured(
                group, line["model"], line["setting"], line["chain"],
                float(line["parameter"] or 0.0), float(error) if error else None,
                float(apart) if apart else None, float(line["time_ratio"]),
                frozenset(line["gives"].split(", ")),
            ))  # fmt: skip
    return tuple(found)


def evidence(
    rows: tuple[Measured, ...], chain: Chain | None, ratios: ImpulseCorrelation | None = None
) -> list[Evidence]:
    """Return what was measured on a chain; else on chains around it; else on most chains."""
    settings: dict[str, dict[str, Measured]] = {}
    for row in rows:
        settings.setdefault(row.setting, {})[row.chain] = row
    name = measured_chain(chain, ratios) if chain else ""
    exact = [(same[name],) for same in settings.values() if name in same]
    every = [tuple(same.values()) for same in settings.values()]
    around = [found for same in every if (found := _around(same, chain))]
    most = [same for same in every if len(same) == max(map(len, every))]
    measured = bool(exact or around)
    return [Evidence(one, bool(exact), measured) for one in exact or around or most]


@cache
def _chains() -> dict[str, tuple[Chain, ImpulseCorrelation]]:
    """Return the measured chains that are not random, with their ratios."""
    _, same = paper_chain("AAA")
    elastic = {"three equal": [1.0] * 3, "five equal": [1.0] * 5, "light middle": [1.0, 0.01, 1.0]}
    chains = {
        name: (Chain(m, np.eye(len(m))[0]), ImpulseCorrelation(np.ravel(same.forward)[0]))
        for name, m in elastic.items()
    }
    return chains | {"ABCCA": paper_chain("ABCCA", excess="saturate")}


def measured_chain(chain: Chain, ratios: ImpulseCorrelation | None = None) -> str:
    """Return the name of the measured chain that this is."""
    one = _from_one_end(chain)
    for name, (other, model) in _chains().items():
        if (
            one is not None
            and len(one) == len(other)
            and np.allclose(one.masses, other.masses / other.masses[0], rtol=1e-12, atol=0.0)
            and (one.restitution == other.restitution).all()
            and (ratios is None or _values(ratios, len(one)) == _values(model, len(one)))
        ):
            return name
    return ""


def _values(model: ImpulseCorrelation, balls: int) -> list[list[float]]:
    """Return the forward and backward ratios of all interior balls."""
    backward = model.forward if model.backward is None else model.backward
    return [np.broadcast_to(part, (balls - 2,)).tolist() for part in (model.forward, backward)]


def _from_one_end(chain: Chain) -> Chain | None:
    """Return a chain that is struck at one end, striker first and of mass 1; None for others."""
    m, e, u = chain.masses, chain.restitution, chain.closing_speeds
    if u[-1] > 0.0 and not u[:-1].any():
        m, e, u = m[::-1], e[::-1], u[::-1]
    if not u[0] > 0.0 or u[1:].any():
        return None
    return Chain(m / m[0], np.eye(len(m))[0], e)


# What places a chain, least and most: balls, spread of masses, restitution.  These are the random
# ones, as `random_chains` in benchmarks/scenes.py draws them.
_DRAWN = {f"{n} balls, random": [[n, 1.0, 0.3], [n, 16.0, 1.0]] for n in (2, 3, 6)}


def _place(chain: Chain) -> list[list[float]]:
    m, e = chain.masses, chain.restitution
    spread = float(m.max() / m.min())
    return [[len(m), spread, float(e.min())], [len(m), spread, float(e.max())]]


def _around(rows: tuple[Measured, ...], chain: Chain | None) -> tuple[Measured, ...]:
    """Return the rows of chains around a chain: of each that reaches it alone, or else of all."""
    unknown = any(row.numerical_error is None for row in rows)
    if chain is None or _from_one_end(chain) is None or unknown:
        return ()
    least, most = np.array(_place(chain))
    known = [_DRAWN.get(row.chain) or _place(_chains()[row.chain][0]) for row in rows]
    low, high = np.array(known).transpose(1, 0, 2)
    low, high = low * (1.0 - 1e-12), high * (1.0 + 1e-12)  # a spread is a quotient, and is rounded
    alone = ((low <= least) & (most <= high)).all(axis=1)
    if alone.any():
        return tuple(row for row, reached in zip(rows, alone, strict=True) if reached)
    return rows if (low.min(axis=0) <= least).all() and (most <= high.max(axis=0)).all() else ()
