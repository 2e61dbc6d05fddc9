"""Every chapter runs from top to bottom when a reader changes its ratios and other parameters.

nbval runs the stored numbers of cells tagged `parameters`; here others take their place.
"""

import ast
import itertools

import matplotlib.pyplot as plt
import nbformat
import pytest
from chapters import code, in_memory, run

# Chapter -> other admissible values: each line is one run of the whole chapter.
CHANGES = {
    "intro": [{"ratio": 0}, {"ratio": 0.31}, {"ratio": 0.5}],
    "problem": [{"ratio": 0}, {"ratio": 0.4}, {"ratio": 0.5}],
    "compliance": [{"gamma": 0.2}, {"gamma": 30}],
    "three_balls": [
        {"ratio": 0, "restitution": [0, 1]},
        {"ratio": 0.4, "masses": [3, 1, 2], "velocities": [1, 0.2, 0]},
        {"ratio": 0.5, "restitution": [0.5, 0.3]},  # at the bound
    ],
    "own_solver": [
        {"ratio": 0.4, "masses": [3, 1, 2], "velocities": [1, 0.2, 0]},
        {"ratio": 0, "restitution": [0, 1]},
    ],
    "multiple_impacts": [
        {"chosen_ratio": 0.1, "chosen_e": 0.2},  # the six events of Fig. 5
        {"chosen_ratio": 0.35, "chosen_e": 0.9},  # others
        {"chosen_ratio": 0},
    ],
    "patterns": [{"RATIO": 0.3, "E": 0.8}, {"RATIO": 0.5, "E": 0.3}],
    "n_balls": [{"ratio": 0}, {"ratio": 0.05}, {"ratio": 0.33}, {"ratio": 0.5}],
    "toy": [{"ratio": 0.05, "pulled_back": 0.02}, {"ratio": 0.3}],
    "engines": [{"step": 1 / 240}, {"step": 1e-4}],
    "forces": [{"masses": [1, 2, 1]}],
    "forces_method": [{"masses": [1, 2, 1]}],
    "laws": [{"ratio": 0}, {"ratio": 0.4}],
    "extremes": [{"ratio": 0}, {"ratio": 0.3}],
    "table_2": [
        {"velocity_error": 0.05, "height_error": 0.0002},
        {"velocity_error": 0.001},
    ],
    "beyond": [{"ratio": 0, "restitution": 0.9}, {"ratio": 0.5, "restitution": 1}],
}
#: All but the first run of a chapter belong to the weekly tests, as do chapters that take longest.
LONG = ("toy", "beyond", "multiple_impacts")
RUNS = [
    pytest.param(
        chapter, changes,
        id=f"{chapter}-{changes}",
        marks=[pytest.mark.exhaustive] * (changes is not runs[0] or chapter in LONG),
    )
    for chapter, runs in CHANGES.items()
    for changes in runs
]  # fmt: skip
#: The other ratios, over what is written.
FACTOR = 0.8


def parameters(cells: list) -> dict[str, object]:
    """Return the parameters of a chapter as stored, and check that they are plain numbers."""
    found: dict[str, object] = {}
    for cell in cells:
        if "parameters" in cell.metadata.get("tags", []):
            for line in ast.parse(cell.source).body:
                assert isinstance(line, ast.Assign), ast.unparse(line)
                (target,) = line.targets
                assert target.id not in found
                found[target.id] = ast.literal_eval(line.value)
    return found


def draw_and_close():
    """Take the place of plt.show, so that a figure that cannot be drawn is seen."""
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()
    plt.close("all")


@pytest.fixture
def pictures_in_memory():
    with in_memory(draw_and_close):
        yield


@pytest.mark.parametrize("chapter", CHANGES)
def test_every_parameter_is_changed(chapter: str):
    stored = parameters(code(chapter))
    assert stored
    for name, value in stored.items():
        assert any(run_.get(name, value) != value for run_ in CHANGES[chapter]), name
    assert set(itertools.chain.from_iterable(CHANGES[chapter])) <= set(stored)
    numbered = "problem compliance three_balls multiple_impacts patterns n_balls"
    assert {"intro", *numbered.split()} <= set(CHANGES)


@pytest.mark.usefixtures("pictures_in_memory")
@pytest.mark.parametrize(("chapter", "changes"), RUNS)
def test_chapter_runs_with_other_numbers(chapter: str, changes: dict):
    run(code(chapter), changes, FACTOR)


@pytest.mark.usefixtures("pictures_in_memory")
def test_measure_runs_with_a_reader_s_own_file(root, tmp_path, monkeypatch):
    """Two sets only, no chain of four: no cell may fail; and with another phone."""
    lines = (root / "data" / "shots_synthetic.csv").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines[1:] if line.split(",")[0] in ("set", "AB", "ABA")]
    (tmp_path / "my_shots.csv").write_text("\n".join(kept) + "\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    # These take longest and use none of this: fits to a synthetic row and a synthetic swing.
    other = {"gaps-law", "gaps-found", "gaps-told"}
    other |= {"swing-fit", "fig-swing", "swing-notes"}
    assert other < {cell.id for cell in code("measure")}
    cells = [cell for cell in code("measure") if cell.id not in other]
    run(cells, {"frame_rate": 120, "mark_error": 0.001, "length": 0.31})
    names = run(code("measure_ratios"), {})
    assert names["mine"].name == "my_shots.csv"
    assert [one.name for one in names["shots"].sets] == ["AB", "ABA"]
    assert names["check"].name == "ABA"
    assert not plt.get_fignums()


@pytest.mark.usefixtures("pictures_in_memory")
def test_a_cell_tied_to_the_stored_number_is_seen():
    cells = [
        nbformat.v4.new_code_cell("ratio = 0.15", metadata={"tags": ["parameters"]}),
        nbformat.v4.new_code_cell("outcome = {0.15: 'here'}[ratio]"),
    ]
    assert run(cells, {})["outcome"] == "here"
    with pytest.raises(KeyError):
        run(cells, {"ratio": 0.2})
    cells[1].source = "for ratio in (0.1, 0.2):\n    assert ratio in (0.1, 0.2)"
    run(cells, {})
    with pytest.raises(AssertionError):
        run(cells, {}, factor=0.8)
