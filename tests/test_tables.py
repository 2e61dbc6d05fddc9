"""Tables 1 and 2 and the chains built from them."""

import csv
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from cradle import tables
from cradle.tables import (
    ball_masses,
    paper_chain,
    paper_sequences,
    ratio_table,
    restitution_table,
)

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


def test_interchange_hypothesis_would_repair_all_four_entries():
    table = ratio_table().set_index("triplet")
    for one, other in [("DBB", "BBD"), ("DBC", "CBD")]:
        assert table.ratio[one] <= table.bound[other]
        assert table.ratio[other] <= table.bound[one]
    used = {
        triplet
        for sequence in paper_sequences()
        for i in range(len(sequence) - 2)
        for triplet in (sequence[i : i + 3], sequence[i : i + 3][::-1])
    }
    assert used.isdisjoint({"DBB", "BBD", "DBC", "CBD"})


def test_masses_are_in_kilograms():
    assert dict(ball_masses()) == {"A": 0.045, "B": 0.053, "C": 0.053, "D": 0.166}


def test_ten_sequences_five_of_four_balls_three_of_five_two_of_six():
    lengths = [len(sequence) for sequence in paper_sequences()]
    assert [lengths.count(n) for n in (4, 5, 6)] == [5, 3, 2]
    assert sorted(paper_sequences().values()) == [10] * 4 + [11] * 2 + [12] * 4


def test_shared_tables_cannot_be_changed():
    with pytest.raises(TypeError):
        ball_masses()["A"] = 1.0


def test_paper_chain_by_hand():
    chain, model = paper_chain("ABCCA", speed=1.5, excess="saturate", meeting=0.25)
    np.testing.assert_array_equal(chain.masses, [0.045, 0.053, 0.053, 0.053, 0.045])
    np.testing.assert_array_equal(chain.velocities, [1.5, 0, 0, 0, 0])
    np.testing.assert_array_equal(chain.restitution, [0.53, 0.28, 0.27, 0.31])
    np.testing.assert_array_equal(model.forward, [0.111, 0.319, 0.462])  # ABC, BCC, CCA
    np.testing.assert_array_equal(model.backward, [0.435, 0.414, 0.216])  # CBA, CCB, ACC
    assert model.meeting == 0.25
    assert model.excess == "saturate"


@pytest.mark.parametrize("sequence", list(paper_sequences()))
def test_reversing_the_balls_exchanges_the_directions(sequence):
    chain, model = paper_chain(sequence)
    mirrored, mirrored_model = paper_chain(sequence[::-1])
    np.testing.assert_array_equal(mirrored.masses, chain.masses[::-1])
    np.testing.assert_array_equal(mirrored.restitution, chain.restitution[::-1])
    np.testing.assert_array_equal(mirrored_model.forward, model.backward[::-1])
    np.testing.assert_array_equal(mirrored_model.backward, model.forward[::-1])


def test_two_balls_need_no_ratio():
    chain, model = paper_chain("DA")
    np.testing.assert_array_equal(chain.restitution, [0.94])
    assert len(model.forward) == 0


def test_letters_may_come_in_a_list():
    for letters in (["A", "B", "C"], ("A", "B", "C"), np.array(["A", "B", "C"]), iter("ABC")):
        assert paper_chain(letters) == paper_chain("ABC")


def test_long_sequences_are_made_or_refused_at_once():
    start = time.process_time()
    chain, model = paper_chain("ABCA" * 75, excess="saturate")
    assert (len(chain), len(model.forward)) == (300, 298)
    with pytest.raises(ValueError, match=r"^sequence\[299\] = 'x'; must be one of A, B, C, D$"):
        paper_chain("ABC" * 99 + "ABx")
    assert time.process_time() - start < 1.0


# --- files that are wrong ------------------------------------------------------------------


@pytest.fixture
def edited(tmp_path, root, monkeypatch):
    """Return a function that edits a copy of one of the four tables, and has it read."""
    cached = (tables.ball_masses, tables.paper_sequences, tables._restitution, tables._ratios)

    def edit(name, old, new):
        for file in ("masses.csv", "restitution.csv", "ratios.csv", "sequences.csv"):
            shutil.copy(root / "data" / file, tmp_path)
        data = (tmp_path / name).read_bytes()
        if old is None:
            (tmp_path / name).unlink()
        else:
            assert data.count(old) >= 1
            (tmp_path / name).write_bytes(data.replace(old, new, 1))
        for function in cached:
            function.cache_clear()
        monkeypatch.setattr(tables, "data_folder", lambda: tmp_path)

    yield edit
    for function in cached:
        function.cache_clear()


#: What is edited, and the refusal; its first word is the file.
WRONG = [
    (b"B,0.053", b"B,-0.053", "masses.csv, row 3, column mass_kg = -0.053; must be"),
    (b"B,0.053", b"B,0", "masses.csv, row 3, column mass_kg = 0.0; must be above 0"),
    (b"B,0.053", b"B,nan", "masses.csv, row 3, column mass_kg = nan; must be finite"),
    (b"B,0.053", b"B,", "masses.csv, row 3, column mass_kg = ''; must be a number"),
    (b"B,0.053", b"B", "masses.csv, row 3 is ['B']; must have 2 cells: ball, m"),
    (b"B,0.053", b"B,0,053", "masses.csv, row 3 is ['B', '0', '053']; must have 2"),
    (b"0.053", b'"0,053"', "masses.csv, row 3, column mass_kg = '0,053'; must be a "),
    (b"B,0.053", b"", "masses.csv, row 3 is []; must have 2 cells: ball, m"),
    (b"B,0.053", b"A,0.053", "masses.csv, row 3, column ball = 'A'; must be there once"),
    (b"B,0.053", b"b,0.053", "masses.csv, row 3, column ball = 'b'; must be one capit"),
    (b"ball,mass_kg", b"ball;mass_kg", "masses.csv, row 1 is ['ball;mass_kg']; must"),
    (b"ball", b"\xef\xbb\xbfball", "masses.csv begins with a byte-order mark"),
    (b"ball", b"b\xe4ll", "masses.csv is no UTF-8 text: byte 1"),
    (None, None, "masses.csv is missing: there is no file"),
    (b"0.31", b"1.5", "restitution.csv, row 2, column C = 1.5; must lie in [0, 1]"),
    (b"0.31", b"0.32", "restitution.csv, row 2, column C = '0.32'; must be equal"),
    (b"\nD,", b"\nE,", "restitution.csv, row 5, column ball = 'E'; must be one of A"),
    (None, None, "restitution.csv is missing: there is no file"),
    (b"AAB,0.232\n", b"", "ratios.csv has no row 'AAB' in column triplet"),
    (b"AAB,0.232", b"AAB,-0.232", "ratios.csv, row 3, column ratio = -0.232; must lie"),
    (b"AAB,0.232", b"AAA,0.232", "ratios.csv, row 3, column triplet = 'AAA'; must be "),
    (b"BABB", b"BAXB", "sequences.csv, row 3, column sequence = 'BAXB'; must be two"),
    (b"BABB,10", b"BABB,ten", "sequences.csv, row 3, column figure = 'ten'; must be"),
]


@pytest.mark.parametrize(("old", "new", "message"), WRONG, ids=[row[2] for row in WRONG])
def test_a_wrong_table_is_named_with_row_and_column(edited, old, new, message):
    name = re.match(r"\w+\.csv", message)[0]
    edited(name, old, new)
    kind = FileNotFoundError if old is None else ValueError
    with pytest.raises(kind, match="^" + re.escape(message)):
        paper_sequences() if name == "sequences.csv" else paper_chain("ABC")


def test_a_table_changed_rightly_is_read(edited):
    """The fixture itself reads the copy: else the refusals above would prove nothing."""
    edited("masses.csv", b"A,0.045", b"A,0.5")
    assert paper_chain("AB")[0].masses.tolist() == [0.5, 0.053]


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
