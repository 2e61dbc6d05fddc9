"""The paper's measured parameters: ball types A to D, Tables 1 and 2, the ten test sequences.

They are read from ``data/``, whose README gives their origin, units and doubtful readings.
"""

import csv
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from cradle.chain import Chain
from cradle.closed_form import largest_ratios
from cradle.input.values import a, one_number, one_of, shown
from cradle.models.correlation import ImpulseCorrelation

if TYPE_CHECKING:  # at run time imported where they are used: `import cradle` stays light
    from importlib.resources.abc import Traversable

    import pandas as pd


def data_folder() -> "Traversable":
    """Return the folder of the data files: inside the installed package, or beside it."""
    from importlib.resources import files

    installed = files("cradle") / "data"
    return installed if installed.is_dir() else Path(__file__).parents[1] / "data"


@cache
def table_rows(name: str) -> tuple[Mapping[str, str], ...]:
    """Return the rows of a data file, such as "benchmarks.csv", as texts by column; read-only."""
    with (data_folder() / name).open(encoding="utf-8") as file:
        return tuple(map(MappingProxyType, csv.DictReader(file)))


@cache
def ball_masses() -> Mapping[str, float]:
    """Return the mass in kg of each ball type, "A" to "D"; read-only.

    Examples
    --------
    >>> from cradle.tables import ball_masses
    >>> ball_masses()["D"]
    0.166
    """
    rows = table_rows("masses.csv")
    return MappingProxyType({row["ball"]: float(row["mass_kg"]) for row in rows})


@cache
def paper_sequences() -> Mapping[str, int]:
    """Return the ten test sequences and the numbers of the paper's figures of them; read-only.

    Examples
    --------
    >>> from cradle import paper_sequences
    >>> list(paper_sequences())
    ['BABC', 'BABB', 'BABA', 'BBCB', 'CDAB', 'CDADB', 'ABCCA', 'ABACA', 'ABCCAB', 'BCACBA']
    """
    rows = table_rows("sequences.csv")
    return MappingProxyType({row["sequence"]: int(row["figure"]) for row in rows})


def restitution_table() -> "pd.DataFrame":
    """Return Table 1, the coefficients of restitution of all pairs of ball types, as a DataFrame.

    Examples
    --------
    >>> from cradle import restitution_table
    >>> print(restitution_table())
             A     B     C     D
    ball
    A     0.97  0.53  0.31  0.94
    B     0.53  0.36  0.28  0.38
    C     0.31  0.28  0.27  0.30
    D     0.94  0.38  0.30  0.85
    """
    import pandas as pd

    return pd.DataFrame(table_rows("restitution.csv")).set_index("ball").astype(float)


def ratio_table() -> "pd.DataFrame":
    """Return Table 2, the Impulse Correlation Ratios of all triplets, as a DataFrame of 64 rows.

    The bound is that of three balls (Eq. 34); in longer chains the next triplet raises it (Eq. 53).

    Examples
    --------
    >>> from cradle import ratio_table
    >>> table = ratio_table()
    >>> print(table[~table.admissible].round(4).to_string(index=False))
    triplet  ratio  bound  admissible
        CCA  0.462 0.4592       False
        DBB  0.710 0.5000       False
        DBC  0.755 0.5000       False
    """
    import pandas as pd

    table = pd.DataFrame(table_rows("ratios.csv")).astype({"ratio": float})
    masses = [[ball_masses()[ball] for ball in triplet] for triplet in table.triplet]
    table["bound"] = largest_ratios(masses, [0.0], [0.0])[0]
    return table.assign(admissible=table.ratio <= table.bound)


def paper_chain(
    sequence: str | Iterable[str], speed: float = 1.0, *,
    excess: Literal["raise", "saturate"] = "raise", meeting: float = 0.5,
) -> tuple[Chain, ImpulseCorrelation]:  # fmt: skip
    """Build a chain of the paper's balls, the first one striking the others at rest.

    Pairs of neighbours have the restitution of Table 1.  At ball Y of the neighbours X, Y, Z the
    forward ratio is the entry XYZ of Table 2, the backward ratio the entry ZYX.

    Parameters
    ----------
    sequence : str or iterable of str
        Ball types, first ball first: two letters or more, A to D; else a ValueError or TypeError.
    speed, excess, meeting
        Velocity of the first ball, m/s; the other two are as for `ImpulseCorrelation`.

    Examples
    --------
    >>> from cradle import paper_chain
    >>> chain, model = paper_chain("CDAB", speed=0.5)
    >>> chain.restitution.tolist()                            # CD, DA, AB
    [0.3, 0.94, 0.53]
    >>> model.forward, model.backward                         # CDA, DAB; ADC, BAD
    ((0.196, 0.09), (0.001, 0.05))
    """
    try:
        masses, balls = ball_masses(), list(sequence)
    except TypeError:
        words = f"sequence is {a(type(sequence).__name__)}; must be letters, as in 'ABC'"
        raise TypeError(words) from None
    for position, ball in enumerate(balls):
        one_of(f"sequence[{position}]", ball, [*masses])
    if len(balls) < 2:
        raise ValueError(f"sequence = {shown(sequence)}; must name at least 2 balls")
    triplets = ["".join(three) for three in zip(balls, balls[1:], balls[2:], strict=False)]
    table_1 = {row["ball"]: row for row in table_rows("restitution.csv")}
    table_2 = {row["triplet"]: float(row["ratio"]) for row in table_rows("ratios.csv")}
    velocities = [one_number("speed", speed)] + [0.0] * (len(balls) - 1)
    restitution = [float(table_1[ball][other]) for ball, other in pairwise(balls)]
    forward = [table_2[triplet] for triplet in triplets]
    backward = [table_2[triplet[::-1]] for triplet in triplets]
    model = ImpulseCorrelation(forward, backward, meeting=meeting, excess=excess)
    return Chain([masses[ball] for ball in balls], velocities, restitution), model
