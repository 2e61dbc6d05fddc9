"""What was measured of the models, read from `benchmarks.csv`, the table that the book shows.

No number is an estimate: it was measured on this very chain, or is the worst of those measured on
chains around it, or there is none.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from cradle.chain import Chain
from cradle.input.values import Vector
from cradle.models.correlation import ImpulseCorrelation
from cradle.runtime import compile as runtime
from cradle.tables import paper_chain, table_rows

#: The groups of the table that are chosen from, and in each the model.
LAWS = {
    "event": "ImpulseCorrelation",
    "springs": "SpringChain, Hertz",
    "many springs": "spring_velocities, Hertz",
    "energy": "EnergyDistribution, Hertz",
    "outcome": "SequentialCollisions",
}

_DIGIT = 2.0**-53  # of the closing speed: no answer is nearer to the true one


class Measured(NamedTuple):
    """One model in one setting, on one chain or at its worst on several; None: not measured."""

    setting: str
    parameter: float  # the setting as a number
    chains: tuple[str, ...]  # their names
    numerical_error: float | None  # of velocities, from the exact answer, over the closing speed
    model_error: float | None  # the same from Hertz springs
    seconds: float  # time of an impact
    gives: frozenset[str]  # "velocities", "impulses", "path", "forces", "times"


@cache
def rows(group: str) -> tuple[Measured, ...]:
    """Return the rows of a group, in settings that this installation and its calls have."""
    kernel = "compiled" if runtime.available() else "plain"
    calls = f"{kernel}, one call with its path", f"{kernel}, batch"
    lines, found = table_rows("benchmarks.csv"), []
    # Times are told in a unit that was measured beside them, and that has one length here.
    timed = [line for line in lines if line["time_ratio"]]
    units = [float(line["microseconds"]) / float(line["time_ratio"]) for line in timed]
    for line in lines:
        if line["model"] == "two balls" and line["setting"].startswith("all: "):
            # A batch of two balls, by `post_impact_velocities`.
            line = {**line, "group": "event", "model": LAWS["event"], "setting": "compiled, batch"}
        there = group != "event" or line["setting"] in calls
        if (line["group"], line["model"]) == (group, LAWS[group]) and there:
            error = line["numerical_error"]
            apart = line["model_error"] if line["model_reference"].startswith("Hertz") else ""
            found.append(Measured(
                line["setting"], float(line["parameter"] or 0.0), (line["chain"],),
                max(float(error), _DIGIT) if error else None, float(apart) if apart else None,
                float(line["time_ratio"]) * 1e-6 * float(np.median(units)),
                frozenset(line["gives"].split(", ")),
            ))  # fmt: skip
    return tuple(found)


def evidence(
    rows: tuple[Measured, ...], chain: Chain | None, ratios: ImpulseCorrelation | None = None
) -> tuple[str, list[Measured]]:
    """Return where the settings were measured, and what: "here", "around" a chain, "elsewhere"."""
    settings: dict[str, list[Measured]] = {}
    for row in rows:
        settings.setdefault(row.setting, []).append(row)
    every = list(settings.values())
    if chain is not None:
        name = measured_chain(chain, ratios)
        if here := [row for row in rows if row.chains == (name,)]:
            return "here", here
        if around := [_worst(found) for same in every if (found := _around(same, chain))]:
            return "around", around
    # On the most chains: it orders the settings, and says nothing of this chain.
    return "elsewhere", [_worst(same) for same in every if len(same) == max(map(len, every))]


def _worst(rows: list[Measured]) -> Measured:
    """Return one setting on several chains as one row: the largest error, the longest time."""
    return rows[0]._replace(
        chains=tuple(row.chains[0] for row in rows),
        numerical_error=max(row.numerical_error or 0.0 for row in rows),
        seconds=max(row.seconds for row in rows),
    )


@cache
def _chains() -> dict[str, tuple[Chain, ImpulseCorrelation]]:
    """Return the measured chains that are not random, with their ratios."""
    same = ImpulseCorrelation(np.ravel(paper_chain("AAA")[1].forward)[0])
    elastic = {"three equal": [1.0] * 3, "five equal": [1.0] * 5, "light middle": [1.0, 0.01, 1.0]}
    chains = {name: (Chain(m, np.eye(len(m))[0]), same) for name, m in elastic.items()}
    for name, n, e in ("three lossy", 3, 0.9), ("five lossy", 5, 0.7):
        chains[name] = Chain([1.0] * n, np.eye(n)[0], e), same
    return chains | {"ABCCA": paper_chain("ABCCA", excess="saturate")}


def measured_chain(chain: Chain, ratios: ImpulseCorrelation | None = None) -> str:
    """Return the name of the measured chain that this is; empty if it is none."""
    own = _figures(chain, ratios)
    for name, (other, model) in _chains().items():
        known = _figures(other, ratios and model)
        if own.shape == known.shape and np.allclose(own, known, rtol=1e-12, atol=0.0):
            return name
    return ""


def _figures(chain: Chain, ratios: ImpulseCorrelation | None = None) -> Vector:
    """Return masses over the striker's, restitution, ratios of a row struck at one end; or none."""
    m, e, u = chain.masses, chain.restitution, chain.closing_speeds
    laws = [] if ratios is None else [*ratios.ratios(len(m))]
    if u[-1] > 0.0 and not u[:-1].any():
        m, e, u, laws = m[::-1], e[::-1], u[::-1], [part[::-1] for part in laws[::-1]]
    if not u[0] > 0.0 or u[1:].any():
        return np.zeros(0)
    return np.concatenate([m / m[0], e, *laws])


# What places chains: balls, spread of masses, restitution; of `random_chains` in the benchmarks.
_DRAWN = {f"{n} balls, random": [[n, 1.0, 0.3], [n, 16.0, 1.0]] for n in (2, 3, 6)}


def _place(chain: Chain) -> list[list[float]]:
    m, e = chain.masses, chain.restitution
    spread = float(m.max() / m.min())
    return [[len(m), spread, float(e.min())], [len(m), spread, float(e.max())]]


def _around(rows: list[Measured], chain: Chain) -> list[Measured]:
    """Return the rows of chains around a chain: of each that reaches it alone, or else of all."""
    if not _figures(chain).size or any(row.numerical_error is None for row in rows):
        return []
    least, most = np.array(_place(chain))
    names = [row.chains[0] for row in rows]
    known = [_DRAWN.get(name) or _place(_chains()[name][0]) for name in names]
    low, high = np.array(known).transpose(1, 0, 2)
    low, high = low * (1.0 - 1e-12), high * (1.0 + 1e-12)  # a spread is a quotient, and is rounded
    alone = ((low <= least) & (most <= high)).all(axis=1)
    if alone.any():
        return [row for row, reached in zip(rows, alone, strict=True) if reached]
    return rows if (low.min(axis=0) <= least).all() and (most <= high.max(axis=0)).all() else []
