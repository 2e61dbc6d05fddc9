"""Tables 1 and 2 and the chains built from them."""

import csv
import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from cradle import tables
from cradle.tables import ball_masses, paper_chain, paper_sequences, ratio_table, restitution_table

# Table 2 in the order in which the paper prints it: first two balls down, last ball across.
# A second reading of the source, independent of data/ratios.csv.
PRINTED_TABLE_2 = """
AA .167 .232 .218 .131    BA .374 .296 .088 .050    CA .495 .499 .400 .129    DA .215 .090 .101 .782
AB .127 .104 .111 .600    BB .340 .310 .216 .390    CB .435 .455 .342 .390    DB .416 .710 .755 .730
AC .262 .268 .216 .664    BC .389 .408 .319 .731    CC .462 .414 .338 .744    DC .430 .449 .441 .744
AD .101 .055 .001 .329    BD .041 .046 .001 .446    CD .196 .171 .122 .495    DD .056 .058 .001 .080
"""


def test_table_1_is_symmetric_and_has_the_printed_entries():
    table = restitution_table()
    assert list(table.index) == list(table.columns) == list("ABCD")
    np.testing.assert_array_equal(table, table.T)
    upper = [table.loc[a, b] for i, a in enumerate("ABCD") for b in "ABCD"[i:]]
    assert upper == [0.97, 0.53, 0.31, 0.94, 0.36, 0.28, 0.38, 0.27, 0.30, 0.85]


def test_table_2_equals_a_second_reading():
    fields = PRINTED_TABLE_2.split()
    printed = {
        fields[i] + last: float(value)
        for i in range(0, len(fields), 5)
        for last, value in zip("ABCD", fields[i + 1 : i + 5], strict=True)
    }
    table = ratio_table()
    assert len(printed) == 64
    assert dict(zip(table.triplet, table.ratio, strict=True)) == printed
    assert len(table) == 64


def test_bound_is_eq_34_and_three_entries_break_it():
    table = ratio_table().set_index("triplet")
    assert list(table.columns) == ["ratio", "bound", "admissible"]
    assert table.admissible.dtype == bool
    assert table.bound["CCA"] == pytest.approx(45 / (53 + 45), rel=1e-15)
    assert table.bound["ABD"] == pytest.approx(166 / (53 + 166), rel=1e-15)
    assert list(table.index[~table.admissible]) == ["CCA", "DBB", "DBC"]


def test_masses_are_in_kilograms_and_stay():
    assert dict(ball_masses()) == {"A": 0.045, "B": 0.053, "C": 0.053, "D": 0.166}
    with pytest.raises(TypeError):
        ball_masses()["A"] = 1.0
    with pytest.raises(TypeError):  # they are kept for the next call
        tables.table_rows("masses.csv")[0]["mass_kg"] = "1"


def test_paper_chain_by_hand():
    chain, model = paper_chain("ABCCA", speed=1.5, excess="saturate", meeting=0.25)
    np.testing.assert_array_equal(chain.masses, [0.045, 0.053, 0.053, 0.053, 0.045])
    np.testing.assert_array_equal(chain.velocities, [1.5, 0, 0, 0, 0])
    np.testing.assert_array_equal(chain.restitution, [0.53, 0.28, 0.27, 0.31])
    np.testing.assert_array_equal(model.forward, [0.111, 0.319, 0.462])  # ABC, BCC, CCA
    np.testing.assert_array_equal(model.backward, [0.435, 0.414, 0.216])  # CBA, CCB, ACC
    assert model.meeting == 0.25
    assert model.excess == "saturate"


def test_any_number_of_letters_in_any_list():
    chain, model = paper_chain("DA")
    assert (chain.restitution.tolist(), model.forward) == ([0.94], ())
    chain, model = paper_chain("ABCA" * 75, excess="saturate")
    assert (len(chain), len(model.forward)) == (300, 298)
    for letters in (["A", "B", "C"], ("A", "B", "C"), np.array(["A", "B", "C"]), iter("ABC")):
        assert paper_chain(letters) == paper_chain("ABC")


def test_the_stored_tables_are_whole():
    """Each row stands once, and sequences are of known balls."""
    triplets = ["".join(three) for three in product("ABCD", repeat=3)]
    assert list(tables.ratio_table().triplet) == triplets
    for name in ("masses.csv", "restitution.csv", "ratios.csv", "sequences.csv"):
        rows = tables.table_rows(name)
        assert len({next(iter(row.values())) for row in rows}) == len(rows)
        assert all(None not in (*row, *row.values()) for row in rows)
    assert all(set(sequence) <= set("ABCD") for sequence in paper_sequences())
    assert sorted(paper_sequences().values()) == [10] * 4 + [11] * 2 + [12] * 4


def test_data_readme_names_every_file_and_column(root: Path):
    readme = (root / "data" / "README.md").read_text(encoding="utf-8")
    files = sorted((root / "data").glob("*.csv"))
    assert [path.name for path in files] == sorted(re.findall(r"^\| `(\w+\.csv)` \|", readme, re.M))
    for path in files:
        assert f"`{path.name}`" in readme
        with path.open(encoding="utf-8") as file:
            header = next(csv.reader(line for line in file if not line.startswith("#")))
        # Single letters are ball types, explained together.
        assert all(f"`{column}`" in readme for column in header if len(column) > 1)
