"""`cradle fit` on small tables: what is given beside the shots, and tables as they come."""

import json

import pytest
from click.testing import CliRunner
from commands import call

from cradle.command.solve import main
from cradle.fit import ratio, read_shots, restitution
from cradle.tables import data_folder


def predicted(line):
    return [row["velocity"] for row in json.loads(call(f"{line} --json"))["prediction"]]


@pytest.fixture
def shots(tmp_path, monkeypatch):
    """The template as a file, and of it the pairs alone and the triplet alone; the header first."""
    lines = (data_folder() / "shots_template.csv").read_text(encoding="utf-8").splitlines()[2:]
    tables = {
        "shots.csv": lines,
        "pairs.csv": [line for line in lines if not line.startswith("ABA,")],
        "triplet.csv": [line for line in lines if not line.startswith("AB,")],
    }
    for name, kept in tables.items():
        (tmp_path / name).write_text("\n".join(kept) + "\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


# --- what is given and known ---------------------------------------------------------------------


@pytest.mark.usefixtures("shots")
def test_where_all_is_known_the_table_is_empty():
    line = "fit triplet.csv --restitution AB=0.53:0.01 --known ABA=0.11"
    header = ["name", "kind", "value", "intervals", "minima", "identified", "at_bound", "bound"]
    first, *notes = call(line).splitlines()
    assert first.split() == header
    assert "fit: no ratio is fitted; those of --known are taken as they are" in notes
    assert not any("chi-square 0.0 of 0" in note for note in notes)
    assert call(f"{line} --csv").strip().split(",") == header
    assert json.loads(call(f"{line} --json"))["rows"] == []
    text = call(f"{line} --predict ABA")
    assert "the set was not fitted: it changes no ratio" in text
    assert "this is no check" not in text


@pytest.mark.usefixtures("shots")
def test_a_fit_of_nothing_has_a_table_and_no_picture():
    fit = ratio(read_shots("triplet.csv"), {"AB": (0.53, 0.01)}, known={"ABA": 0.11})
    assert fit.table().empty
    assert fit.table().index.name == "name"
    with pytest.raises(ValueError, match="nothing was fitted; there is nothing to draw"):
        fit.plot()


@pytest.mark.usefixtures("shots")
def test_pairs_with_what_is_known_predict_longer_chains():
    known = "--predict ABA --known ABA=0.1"
    alone = predicted(f"fit pairs.csv {known}")
    assert alone == predicted(f"fit shots.csv --without ABA {known}")
    assert alone == predicted(f"fit shots.csv {known}")
    # e = 0.9, and momentum.
    pair = predicted("fit pairs.csv --predict AA --restitution AA=0.9")
    assert pair == pytest.approx([0.05, 0.95], abs=1e-12)


@pytest.mark.usefixtures("shots")
def test_a_known_ratio_is_one_number_up_to_its_bound():
    table, bound = read_shots("shots.csv"), 0.045 / 0.098
    assert ratio(table, {"AB": 0.53}, known={"ABA": bound}).known == {"ABA": bound}
    for wrong, words in ((bound + 1e-6, "must be 0 to the bound"), ((0.1, 0.2), "one number")):
        with pytest.raises(ValueError, match=rf"known\['ABA'\] = .*; must .*{words[-9:]}"):
            ratio(table, {"AB": 0.53}, known={"ABA": wrong})


# --- tables as they come -------------------------------------------------------------------------


def test_a_table_comes_from_standard_input(shots):
    text = (shots / "shots.csv").read_text()
    piped = CliRunner().invoke(main, ["fit", "-"], input=text, catch_exceptions=False)
    assert piped.output == call("fit shots.csv")


@pytest.mark.usefixtures("shots")
def test_a_summary_is_that_of_python():
    text = call("fit shots.csv --summary")
    pairs = restitution(table := read_shots("shots.csv"))
    both = [pairs.summary(), ratio(table, pairs).summary()]
    assert text.startswith("\n".join(both))
    assert "residuals of AB: " in text
    assert text.splitlines()[-1].startswith("momentum: chi-square ")


def test_momentum_that_is_lost_is_marked(shots):
    """Balls a fifth too heavy: each shot gains momentum by many of its errors."""
    words = "; masses, velocities or their errors are wrong"
    assert words not in call("fit shots.csv")
    wrong = (shots / "shots.csv").read_text().replace("0.053,", "0.064,")
    (shots / "wrong.csv").write_text(wrong)
    assert words in call("fit wrong.csv")
