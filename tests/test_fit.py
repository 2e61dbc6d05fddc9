"""Fits to measured shots: data read and refused, searches, confidence sets, predictions."""

import io
import re

import fit_example
import fit_study
import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq, least_squares, minimize
from scipy.stats import binom, chi2
from shots import MASS, columns, outcome
from stored import DATA, read

from cradle import (
    Chain,
    ImpulseCorrelation,
    collide,
    paper_chain,
    post_impact_velocities,
    ratio_table,
)
from cradle.closed_form import three_balls
from cradle.fit import (
    Fit,
    Shots,
    estimate,
    frames,
    ratio,
    read_shots,
    read_tracker,
    restitution,
    velocities_from_tracks,
)
from cradle.fit.parameters import chi_squares, pair_keys, ratio_keys, triplet_keys
from cradle.fit.result import FOLDED, SKEW, Group
from cradle.fit.search import RISE, refine, scan
from cradle.fit.tracks import Track


def any_shots(before, sigma, errors=None, moved=None):
    """Shots of balls A, B, C whichever of them move; ratio 0.1 to the right, 0.2 to the left."""
    rows, model = [], ImpulseCorrelation([0.1], [0.2])
    for shot, v in enumerate(before):
        after = collide(Chain([0.045, 0.053, 0.06], v, [0.6, 0.7]), model)
        for ball, letter in enumerate("ABC"):
            error = 0.0 if errors is None else errors[shot][ball]
            uncertain = sigma * (v[ball] != 0 if moved is None else ball in moved)
            rows.append((shot, ball + 1, letter, after.chain.masses[ball], v[ball],
                         after.velocities[ball] + error, sigma, uncertain))  # fmt: skip
    names = ("shot", "ball", "type", "mass", "before", "after", "sigma", "sigma_before")
    return read_shots({"set": ["ABC"] * len(rows)} | dict(zip(names, map(list, zip(*rows)))))


def pairs_of(name, error):
    chain, _ = paper_chain(name, excess="saturate")
    keys = ["".join(sorted(name[i : i + 2])) for i in range(len(name) - 1)]
    return {key: (float(e), error) for key, e in zip(keys, chain.restitution)}


# --- reading -----------------------------------------------------------------------------------


def good():
    return columns("AB", [1.0, 1.5], outcome("AB"), 0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.update(sigmab=t["sigma"]), "column 'sigmab': write 'sigma', or another name"),
        (lambda t: t.pop("sigma"), r"column 'sigma' is missing \(standard error"),
        (lambda t: t.update(mass=[45, 53] * 2), r"row 1, column mass: 45 kg is unlikely; .*grams"),
        (lambda t: t.update(after=[17.0, 70, 26, 105]), "row 2, column after: 70 m/s is unlikely"),
        (lambda t: t["after"].__setitem__(0, 0.9), "row 2, column after: set AB, shot 0: ball 1"),
        (lambda t: t["after"].__setitem__(1, 1.2), "gains .* % of its energy"),
        (lambda t: t["after"].__setitem__(3, "x"), "column after = 'x'; must be a number, its"),
        (lambda t: t["after"].__setitem__(3, True), "column after = True; must be a number, its"),
        (lambda t: t["after"].__setitem__(3, np.nan), "row 4, column after = nan; must be finite"),
        (lambda t: t["ball"].__setitem__(1, 3), r"row 1, column ball: set AB, shot 0 has balls"),
        (lambda t: t["ball"].__setitem__(1, 1.5), "row 2, column ball: 1.5; must be 1, 2"),
        (lambda t: t["mass"].__setitem__(2, 0.05), "row 3, column mass: 0.05; balls of type A"),
        (lambda t: t["type"].__setitem__(3, "C"), "row 4, column type: 'C'; ball 2 of set AB"),
        (lambda t: t["type"].__setitem__(1, "A-2"), "row 2, column type: 'A-2'; must be a name wi"),
        (lambda t: t["type"].__setitem__(0, ""), "row 1, column type: ''; must be a name withou"),
        (lambda t: t["before"].__setitem__(0, -1.0), "row 1, column before: .*no balls approach"),
        (lambda t: t["sigma"].__setitem__(2, 0.0), "row 3, column sigma = 0.0; must be above 0"),
        (lambda t: t["mass"].__setitem__(0, -0.045), "row 1, column mass = -0.045; must be above"),
        (lambda t: t.update(Sigma=t.pop("sigma")), "Sigma: write Sigma in small letters"),
        (lambda t: t["set"].append("AB"), "columns have different lengths"),
        (lambda t: t.update({k: [] for k in t}), "the table has no rows"),
        (lambda t: [t.update({f"{k}1": t.pop(k)}) for k in [*t]],
         "no column of set, .* `cradle film`"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused_by_row_and_column(change, message):
    table = good()
    read_shots(table)
    change(table)
    with pytest.raises(ValueError, match=message):
        read_shots(table)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda _: restitution("shots.csv"), "shots is a str; must be a Shots"),
        (lambda _: ratio(None, {"AB": 0.5}), "shots is a NoneType; must be a Shots"),
        (lambda shots: ratio(shots, 0.53), "restitution is a float; must be a Mapping"),
        (
            lambda shots: ratio(shots, {"AB": 0.5}, known=[0.1]),
            "known is a list; must be a Mapping",
        ),
    ],
)
def test_wrong_types_are_refused_by_name(call, message):
    """A Series of pandas has names, too."""
    shots = read_shots(columns("ABA", [1.0], outcome("ABA"), 0.01))
    with pytest.raises(TypeError, match=f"^{message}$"):
        call(shots)
    named = {"AB": 0.5}
    assert str(ratio(shots, pd.Series(named))["ABA"]) == str(ratio(shots, named)["ABA"])


def test_sigma_is_given_once():
    table = good()
    with pytest.raises(ValueError, match=r"sigma = 0.01; the table has a column sigma: leave out"):
        read_shots(table, sigma=0.01)
    errors = table.pop("sigma")
    assert read_shots(table, sigma=errors[0])["AB"].sigma.tolist() == [errors[:2], errors[2:]]
    with pytest.raises(ValueError, match=r"^sigma = -1.0; must be above 0"):
        read_shots(table, sigma=-1)


def test_a_missing_error_is_left_out():
    """Empty cells of a file are NaN in a DataFrame of pandas."""
    table = pd.DataFrame(good() | {"sigma_before": [0.02, None, np.nan, pd.NA]})
    assert read_shots(table)["AB"].sigma_before.tolist() == [[0.02, 0.0], [0.01, 0.0]]


@pytest.mark.parametrize("name", ["a;b", 'a "b" c', "a\tb", "d'or"])
def test_names_may_have_the_signs_of_other_tables(tmp_path, name):
    """The header tells what stands between the columns."""
    pd.DataFrame(good() | {"set": name}).to_csv(tmp_path / "named.csv", index=False)
    assert read_shots(tmp_path / "named.csv").sets[0].name == name


def test_a_quote_that_is_not_closed_is_refused_by_its_line(tmp_path):
    pd.DataFrame(good() | {"set": "a\nb"}).to_csv(tmp_path / "broken.csv", index=False)
    with pytest.raises(ValueError, match=r"^line 2: 1 values; the header has 8 columns"):
        read_shots(tmp_path / "broken.csv")


def test_a_repeated_column_is_refused(tmp_path):
    """Which of them counts nobody would see."""
    table = pd.DataFrame(good())
    twice = pd.concat([table, table["after"]], axis=1)
    twice.to_csv(tmp_path / "twice.csv", index=False)
    for source in (twice, tmp_path / "twice.csv"):
        with pytest.raises(ValueError, match="column 'after' is there 2 times; keep one"):
            read_shots(source)


def test_one_table_three_ways(tmp_path):
    """Columns, a DataFrame, and a file in grams and cm/s with comments and a byte-order mark."""
    table = good()
    frame = pd.DataFrame(table)
    path = tmp_path / "shots.csv"
    scaled = frame.assign(mass=1e3 * frame.mass, before=100 * frame.before,
                          after=100 * frame.after, sigma=100 * frame.sigma)  # fmt: skip
    text = "# a comment\n" + scaled.to_csv(index=False) + "\n# the end\n"
    path.write_text(text, encoding="utf-8-sig")
    three = [read_shots(table), read_shots(frame),
             read_shots(path, mass_unit="g", velocity_unit="cm/s")]  # fmt: skip
    for shots in three:
        np.testing.assert_allclose(shots["AB"].after, three[0]["AB"].after, rtol=1e-14)
        np.testing.assert_allclose(shots["AB"].masses, [0.045, 0.053], rtol=1e-14)
        np.testing.assert_allclose(shots["AB"].sigma_before, [[0.01, 0]] * 2, rtol=1e-14)
    with pytest.raises(ValueError, match=r"line 3, column mass: 53 kg|line 3, column mass: 45 kg"):
        read_shots(path)
    path.write_text(text.replace("AB,0,2,B", "AB,0,2,B,7"), encoding="utf-8")
    with pytest.raises(ValueError, match="line 4: 9 values; the header has 8 columns"):
        read_shots(path)


def test_momentum_shows_a_wrong_mass():
    shots = read_shots(good())
    assert shots.momentum_check()[0] < 1e-20
    wrong = good()
    wrong["mass"] = [0.050 if m == 0.045 else m for m in wrong["mass"]]
    residuals = read_shots(wrong)["AB"].momentum_residuals
    after = outcome("AB")
    gain = 0.050 * after[0] + 0.053 * after[1] - 0.050
    assert residuals[0] == pytest.approx(gain / (0.01 * np.sqrt(2 * 0.05**2 + 0.053**2)))


def test_mean_of_shots_at_different_speeds():
    """Shots without errors have the outcome as their mean; its error falls with their number."""
    table = columns("ABA", [0.5, 1.0, 2.0], outcome("ABA"), 0.01)
    table["sigma_before"] = [0.02, 0.0, 0.0] * 3
    mean, error = read_shots(table)["ABA"].mean_after(1.5)
    np.testing.assert_allclose(mean, 1.5 * outcome("ABA"), rtol=1e-14)
    share = outcome("ABA")
    # 0.01 of the velocity after, and 0.02 of the striker's: over 0.5, 1 and 2 m/s.
    expected = 1.5 * 0.01 * np.sqrt((1 + 4 * share**2) * (4 + 1 + 0.25)) / 3
    np.testing.assert_allclose(error, expected, rtol=1e-12)
    both = columns("AB", [1.0], collide(Chain([0.045, 0.053], [1, -1], 0.5),
                                        ImpulseCorrelation(0)).velocities, 0.01)  # fmt: skip
    both["before"] = [1.0, -1.0]
    with pytest.raises(ValueError, match="set AB has shots that do not begin with ball 1"):
        read_shots(both)["AB"].mean_after()


# --- search ------------------------------------------------------------------------------------


def test_scan_finds_minima_narrower_than_a_cell_and_level_stretches():
    (found,), *_ = scan(lambda x: 1e10 * (x[:, 0] - 0.30071) ** 2, np.ones(1))
    assert found.modes[0].value == pytest.approx(0.30071, abs=1e-8)
    ((low, high),) = found.intervals
    assert high - low == pytest.approx(2 * np.sqrt(RISE * 1e-10), rel=1e-3)
    (level,), *_ = scan(lambda x: 0 * x[:, 0], np.ones(1))
    assert level.intervals == ((0.0, 1.0),)


def test_refine_where_the_grid_is_far_above_the_minimum():
    """Parameters that do not matter have the whole range, the one that does a cell or two."""
    found, *_ = refine(lambda x: ((x[:, 0] - 0.3137) / 0.002) ** 2, np.full(3, 0.5))
    (low, high), *others = [scan.intervals[0] for scan in found]
    assert 0.28 < low < 0.3137 < high < 0.35
    np.testing.assert_allclose(others, [(0, 0.5)] * 2, atol=1e-15)


def test_refine_of_a_minimum_that_no_cell_is_small_enough_for():
    """It ends with cells of a millionth, of which the best one stands for the set."""
    asked = []

    def narrow(x):
        asked.append(len(x))
        assert len(asked) < 2000
        return 1e40 * ((x - 0.3137) ** 2).sum(axis=1)

    for found in refine(narrow, np.ones(2))[0]:
        ((low, high),) = found.intervals
        assert low < found.modes[0].value < high < low + 2e-6
        assert found.modes[0].value == pytest.approx(0.3137, abs=1e-6)


def test_refine_against_an_ellipse():
    matrix = 1e5 * np.array([[2.0, 1.5], [1.5, 2.0]])
    centre = np.array([0.21, 0.33])
    found, *_ = refine(
        lambda x: np.einsum("pi,ij,pj->p", x - centre, matrix, x - centre), np.array([0.5, 0.6])
    )
    best = [one.modes[0].value for one in found]
    np.testing.assert_allclose(best, centre, atol=1e-5)
    half = np.sqrt(RISE * np.diag(np.linalg.inv(matrix)))
    for axis in (0, 1):
        ((low, high),) = found[axis].intervals
        assert low == pytest.approx(centre[axis] - half[axis], abs=0.12 * half[axis])
        assert high == pytest.approx(centre[axis] + half[axis], abs=0.12 * half[axis])


# --- restitution -------------------------------------------------------------------------------


def test_restitution_of_exact_data_and_its_error():
    """The interval is that of linear error propagation, worked out by hand."""
    sigma, speeds = 0.004, [0.5, 1.0, 1.5, 2.0]
    found = restitution(read_shots(columns("AB", speeds, outcome("AB"), sigma)))
    one = found["AB"]
    assert one.value == pytest.approx(0.53, abs=1e-7)
    assert found.chi_square < 1e-8
    assert found.degrees_of_freedom == 7
    # d after / d e = (-m2, m1) v / (m1 + m2); the striker's speed v is profiled over.
    m1, m2, v = 0.045, 0.053, outcome("AB")
    slope = np.array([-m2, m1]) / (m1 + m2)
    seen = slope @ slope - (slope @ v) ** 2 / (1 + v @ v)
    error = sigma / np.sqrt(seen * np.square(speeds).sum())
    ((low, high),) = one.intervals
    assert (high - low) / (2 * np.sqrt(RISE)) == pytest.approx(error, rel=1e-3)


# --- ratio -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ABBB", "ABCA", "BDDD", "CDDD"])
def test_a_ratio_that_acts_for_some_values_of_the_others_is_seen(name):
    """The backward one at the second ball; all values must be tried, not only a plane of them."""
    (shots,) = read_shots(columns(name, [1.0], outcome(name), 0.01)).sets
    bounds = {key: estimate._bound(key, MASS) for key in ratio_keys(name)}
    forward, backward = triplet_keys(name)
    draws = np.random.default_rng(1).random((2, 20_000, 2))
    f, b = (x * [bounds[key] for key in keys] for x, keys in zip(draws, (forward, backward)))
    e = paper_chain(name, excess="saturate")[0].restitution
    without = b.copy()
    without[:, 0] = 0.0
    ends = [
        post_impact_velocities(shots.masses, shots.before, e, f, x, excess="saturate")
        for x in (b, without)
    ]
    assert 0 < (abs(ends[1] - ends[0]).max(axis=1) > 1e-6).mean() < 0.2
    given = dict(zip(pair_keys(name), e.tolist()))
    assert backward[0] in estimate._acting(shots, bounds, given)


@pytest.mark.parametrize("name", ["AAA", "ABC", "BAC", "BCD", "DAA", "DDD", "CAA", "BDC"])
def test_exact_data_give_the_ratio_back(name):
    true = paper_chain(name)[1].forward[0]
    known = {} if name == name[::-1] else {name[::-1]: paper_chain(name[::-1])[1].forward[0]}
    shots = read_shots(columns(name, [0.5, 1.0, 2.0], outcome(name), 0.003))
    found = ratio(shots, pairs_of(name, 0.0), known=known)
    assert found[name].value == pytest.approx(true, abs=2e-6)
    assert found.chi_square < 1e-3
    assert any(low <= true <= high for low, high in found[name].intervals)


def test_confidence_set_by_another_route():
    """Profile by Nelder and Mead over e2, e3 and all speeds, impacts by the paper's formulas."""
    name, sigma = "ABA", 0.01
    random = np.random.default_rng(3)
    speeds, errors = [0.8, 1.3], sigma * random.standard_normal((2, 3))
    shots = read_shots(columns(name, speeds, outcome(name), sigma, errors))
    e, error = {"AB": (0.53, 0.008)}, 0.008
    masses, data = shots["ABA"].masses, shots["ABA"].after

    def chi(a):
        def squares(p):
            v = np.array([[p[0], 0, 0], [p[1], 0, 0]])
            model = three_balls(masses, v, np.array([[p[2], p[2]]]), np.array([a, a]))
            return (
                (((data - model) / sigma) ** 2).sum()
                + (((p[:2] - speeds) / sigma) ** 2).sum()
                + ((p[2] - 0.53) / error) ** 2
            )

        start = [*speeds, 0.53]
        return minimize(squares, start, method="Nelder-Mead",
                        options={"xatol": 1e-8, "fatol": 1e-10, "maxiter": 4000}).fun  # fmt: skip

    one = ratio(shots, e)[name]
    lowest = chi(one.value)
    assert chi(one.value - 0.003) > lowest < chi(one.value + 0.003)
    ((low, high),) = one.intervals
    width = high - low
    ends = [brentq(lambda a: chi(a) - lowest - RISE, *bracket, xtol=1e-6)
            for bracket in ((max(low - 0.5 * width, 0.0), one.value),
                            (one.value, high + 0.5 * width))]  # fmt: skip
    np.testing.assert_allclose([low, high], ends, atol=0.01 * width)


def lowest_chi_square(before, moved, ratios):
    """Chi-square from `fit`, and by least squares over the velocities before, shot by shot."""
    sigma = 0.003
    errors = sigma * np.random.default_rng(1).standard_normal((len(before), 3))
    shots = any_shots(before, sigma, errors, moved)["ABC"]
    free = shots.sigma_before > 0
    forward, backward = ratios
    model = ImpulseCorrelation([forward], [backward])

    def residuals(shift):
        v = shots.before.astype(float)
        v[free] += sigma * shift
        after = [collide(Chain(shots.masses, row, [0.6, 0.7]), model).velocities for row in v]
        return np.concatenate([shift, ((shots.after - after) / sigma).ravel()])

    if free.any():
        lowest = 2 * least_squares(residuals, np.zeros(free.sum()), xtol=1e-12).cost
    else:
        lowest = (residuals(np.zeros(0)) ** 2).sum()
    values = {("A", "B", "C"): forward, ("C", "B", "A"): backward}
    (found,) = chi_squares([shots], values | {("A", "B"): 0.6, ("B", "C"): 0.7}, [])
    return found, lowest


@pytest.mark.parametrize("ratios", [(0.1, 0.2), (0.15, 0.1)])
@pytest.mark.parametrize(
    ("before", "moved"),
    [
        ([[0, 0, -1]], None),
        ([[0, 0, -1], [0, 0, -0.7]], None),
        ([[2, 0.3, 0]], [0]),
        ([[2, 0.3, 0]], [1]),
        ([[2, 0.3, 0]], [0, 1]),
        ([[2, 0, -1]], [0]),
        ([[2, 0, -1]], []),
        ([[1, 0, 0]], None),
        ([[1, 0, 0], [0, 0, -1]], None),
    ],
)
def test_chi_square_whichever_balls_move(before, moved, ratios):
    found, lowest = lowest_chi_square(before, moved, ratios)
    assert found == pytest.approx(lowest, rel=1e-4)


@pytest.mark.parametrize("moved", [[0, 1], [0, 1, 2]])
def test_an_error_of_a_ball_at_rest_counts(moved):
    """Outcomes have a kink where balls touch at rest: the profile is near the lowest, no more."""
    before, ratios = [[1, 0, 0]], (0.1, 0.2)
    found, lowest = lowest_chi_square(before, moved, ratios)
    assert found == pytest.approx(lowest, rel=0.03)
    assert found < 0.95 * lowest_chi_square(before, [0], ratios)[0]


RIGHT, LEFT, SLOW = [1, 0, 0], [0, 0, -1], [0, 0, -0.7]


@pytest.mark.parametrize(
    "before", [[LEFT], [LEFT, SLOW], [RIGHT, LEFT, SLOW], [LEFT, RIGHT, SLOW], [LEFT, SLOW, RIGHT]]
)
def test_each_shot_tells_the_ratio_of_its_way(before):
    """Shots to the right tell one ratio, those to the left the other, whichever comes first."""
    found = ratio(any_shots(before, 0.003), {"AB": 0.6, "BC": 0.7})
    both = RIGHT in before
    for name, true in (("CBA", 0.2), ("ABC", 0.1))[: 1 + both]:
        assert found[name].value == pytest.approx(true, abs=1e-4 if both else 2e-6)
    assert found.chi_square < 1e-3
    assert found.degrees_of_freedom == 3 * len(before) - 1 - both


@pytest.mark.parametrize("before", [[RIGHT, [0, 0, -0.5]], [LEFT, SLOW]])
def test_shots_from_both_ends_are_drawn(before):
    """Data and prediction, whichever of the two ratios is asked for."""
    shots = any_shots(before, 0.003)
    found = ratio(shots, {"AB": 0.6, "BC": 0.7})
    for name in ("ABC", "CBA"):
        _, data = found.plot(name)
        drawn = [bars.lines[0].get_xydata() for bars in data.containers]
        speed = np.abs(before).max(axis=1)
        after = shots["ABC"].after / speed[:, np.newaxis]
        for ball, points in enumerate(drawn):
            expected = np.column_stack([speed, after[:, ball]])
            np.testing.assert_allclose(points, expected, rtol=1e-15)
        # Exact data of the fit: a line for shots that begin alike, else a dash a shot.
        lines = [line for line in data.lines if line.get_label() == "_predicted"]
        predicted = np.transpose([line.get_ydata() for line in lines])
        assert {line.get_marker() for line in lines} == {"_" if before[0][0] else "None"}
        np.testing.assert_allclose(predicted, after, atol=1e-4)


def test_two_moving_balls():
    """They part with half of the speed at which they meet; so is the prediction that is drawn."""
    table = columns("AA", [1.0] * 3, [0.1, 0.7], 0.001)
    table["before"] = [1.0, -0.2] * 3
    found = restitution(read_shots(table))
    assert found["AA"].value == pytest.approx(0.5, abs=1e-7)
    _, data = found.plot("AA")
    lines = [line.get_ydata() for line in data.lines if line.get_label() == "_predicted"]
    np.testing.assert_allclose(lines, [[0.1] * 2, [0.7] * 2], atol=1e-6)


def test_what_the_data_do_not_tell():
    """Ball 1 of BDA never comes back to be struck again: the backward ratio acts in no shot."""
    shots = read_shots(columns("BDA", [1.0, 1.5], outcome("BDA"), 0.003))
    found = ratio(shots, pairs_of("BDA", 0.0))
    assert found["BDA"].identified
    silent = found["ADB"]
    assert not silent.identified
    assert silent.value is None
    assert "not identified" in str(silent)
    told = found.predict("ADB")  # with any ratio up to the bound
    assert (told.upper - told.lower).max() > 0.05
    shots = read_shots(columns("BDA", [1.0], outcome("BDA"), 0.4))
    rough = ratio(shots, pairs_of("BDA", 0.0))["BDA"]
    assert not rough.identified
    assert rough.value is None
    assert rough.intervals == ((0.0, rough.bound),)


def test_two_ratios_explain_one_outcome():
    """DAA: outcomes at .215 and near .398 are a hundredth apart."""
    (row,) = read("fit_precision.csv", triplet="DAA")
    shots = read_shots(columns("DAA", [1.0] * 5, outcome("DAA"), 0.02))
    fit = ratio(shots, pairs_of("DAA", 0.0), known={"AAD": 0.131})
    one = fit["DAA"]
    assert len(one.intervals) == 2
    assert fit.rows()[0]["intervals"] == fit.table().loc["DAA", "intervals"] == one.intervals
    assert len([m for m in one.modes if m.excess < RISE]) == 2
    assert one.modes[1].value == pytest.approx(float(row["second"]), abs=0.005)


@pytest.mark.parametrize("name", ["DBB", "CCA"])
def test_data_of_the_bound_end_there(name):
    """The three entries of Table 2 above their bound act like the bound: chi-square is level."""
    shots = read_shots(columns(name, [1.0, 1.5], outcome(name), 0.003))
    known = {name[::-1]: paper_chain(name[::-1], excess="saturate")[1].forward[0]}
    one = ratio(shots, pairs_of(name, 0.0), known=known)[name]
    assert one.at_bound == "upper"
    assert one.value == pytest.approx(one.bound)
    assert "at its upper bound" in str(one)


@pytest.mark.parametrize(
    ("given", "known", "message"),
    [
        ({"AC": 0.3}, None, "restitution has no 'AB', which set ABA needs"),
        ({"AB": 1.3}, None, "must lie in"),
        ({"AB": (0.3, -0.1)}, None, r"restitution\['AB'\]\[1\] = -0.1; a standard error"),
        ({"AB": (0.3, 0.1, 0.1)}, None, "must be a number, or a number and its error"),
        ({"AB": 0.3}, {"ABA": 1.3}, r"known\['ABA'\] = 1.3; must be 0 to the bound"),
        ({"AB": 0.3}, {"ABA": -0.1}, r"known\['ABA'\] = -0.1; must be 0 to the bound"),
        ({"AB": 0.3}, {"AAC": 0.1}, r"known\['AAC'\]; must name three of the balls A, B"),
        ({"AB": 0.3}, {"AB": 0.1}, r"known\['AB'\]; must name three of the balls A, B"),
    ],
)
def test_missing_knowledge_is_named(given, known, message):
    shots = read_shots(columns("ABA", [1.0], outcome("ABA"), 0.01))
    with pytest.raises(ValueError, match=message):
        ratio(shots, given, known=known)
    with pytest.raises(ValueError, match="no set has two balls"):
        restitution(shots)
    with pytest.raises(ValueError, match="no set has three balls"):
        ratio(read_shots(good()), {"AB": 0.5})


# --- tracks ------------------------------------------------------------------------------------

MINUS = "\N{MINUS SIGN}"
#: What programs export, and what it holds: positions in m at 0 and 0.03 s, by the balls' names.
EXPORTS = {
    "Tracker 4": ("mass_A\nt\tx\ty\n0.00\t0.10\t0.5\n0.03\t-0.12\t0.5\n", {"mass A": [0.1, -0.12]}),
    "Tracker 6": (
        "\tmass A\t\t\t\nt\tx\ty\tv\t\n0\t1.0E-1\t0.5\t\t\n0.03\t-1.2E-1\t0\t2\t\n0.06\t\t\t\t\n",
        {"mass A": [0.1, -0.12]},
    ),
    "Tracker, several": (
        "#multi:\n,A,,B,,\nt,x,y,x,y,\n0.00,0.10,0.5,0.20,0.5,\n0.03,0.12,0.5,,,\n",
        {"A": [0.1, 0.12], "B": [0.2]},
    ),
    "Tracker, times for each ball": (
        "#multi:\nA\t\t\tB\nt\tx\ty\tt\tx\ty\n0\t0.1\t0\t\t\t\n\t\t\t0\t0.2\t0\n"
        "0.03\t0.3\t0\t0.03\t0.4\t0\n",
        {"A": [0.1, 0.3], "B": [0.2, 0.4]},
    ),
    "Kinovea, text": (
        "#Kinovea Trajectory data export\n#T X Y\n\n# left ball\n0 0.1 2\n0.03 0.2 2\n\n"
        "# B\n0 0.5 2\n0.03 0.6 2\n\n",
        {"left ball": [0.1, 0.2], "B": [0.5, 0.6]},
    ),
    "Kinovea, decimal commas": (
        f"Time;A/0/X;A/0/Y;B/0/X;B/0/Y\n0;1,5;2;5;2\n0,03;{MINUS}2,5;2;;\n",
        {"A": [1.5, -2.5], "B": [5]},
    ),
    "Kinovea, one ball": (
        '"Time (ms)","X (cm)","Y (cm)"\n0,1.0,2\n30,2.0,2\n',
        {"track": [0.01, 0.02]},
    ),
    "Logger Pro": (
        '"Latest: Time (s)","Latest: X (mm)","Latest: Y (mm)","Latest: X 2 (mm)",'
        '"Latest: X Velocity (m/s)"\n0,1,2,5,2\n0.03,2,2,6,3\n',
        {"X": [0.001, 0.002], "X 2": [0.005, 0.006]},
    ),
    "Logger Pro, text": (
        "Vernier Format 2\nUntitled.cmbl 3/18/2011 10:29:33 .\nRun 1\nTime\tX\tY\nt\tx\ty\n"
        "s\tcm\tcm\n\n0\t1\t2\n0.03\t2\t2\n",
        {"Run 1": [0.01, 0.02]},
    ),
    "Logger Pro, units in brackets": ("t\tx\n(s)\t(cm)\n0\t1\n0.03\t2\n", {"track": [0.01, 0.02]}),
    "Capstone, byte-order mark": (
        "\ufeffTime (s) Run #1;Position (m) Run #1;Position, Ch 2 (m) Run #1;Velocity (m/s) Run #1"
        "\n0;0,1;0,5;0\n0,03;0,2;0,6;0\n",
        {"Position": [0.1, 0.2], "Position, Ch 2": [0.5, 0.6]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("program", EXPORTS)
def test_exports_of_video_programs(tmp_path, program):
    """A unit that the file names counts, else the one that is told."""
    text, held = EXPORTS[program]
    (tmp_path / "export.txt").write_text(text, encoding="utf-8")
    tracks = read_tracker(tmp_path / "export.txt")
    assert {name: track.positions.tolist() for name, track in tracks.items()} == held
    slow = read_tracker(tmp_path / "export.txt", time_scale=0.125, unit=0.1)
    scale = 1.0 if "(" in text or "\tcm" in text else 0.1
    for name, places in held.items():
        np.testing.assert_allclose(tracks[name].times, [0, 0.03][: len(places)], rtol=1e-14)
        np.testing.assert_allclose(slow[name].times, 0.125 * tracks[name].times, rtol=1e-14)
        np.testing.assert_allclose(slow[name].positions, np.multiply(scale, places), rtol=1e-14)


def test_balls_are_in_the_order_of_the_titles(tmp_path):
    """Whichever is marked first; NaN is no mark."""
    text = "#multi:\n,A,,B,,\nt,x,y,x,y,\n0,,,0.2,0.5,\n0.03,NaN,NaN,0.22,0,\n0.06,0.1,0,,,\n"
    (tmp_path / "export.txt").write_text(text, encoding="utf-8")
    tracks = read_tracker(tmp_path / "export.txt")
    marks = {name: [part.tolist() for part in track] for name, track in tracks.items()}
    assert list(marks.items()) == [("A", [[0.06], [0.1]]), ("B", [[0, 0.03], [0.2, 0.22]])]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n3,4\n", "export.txt has no column of positions: a line of titles must begin"),
        ("", "export.txt has no column of positions"),
        ("t,A/x,B/x\n", "export.txt has no marks below its titles"),
        ("t,y\n0,1\n", "export.txt has no column of positions"),
        (
            "t,A,B\n0,1,2\n",
            "t or Time and name x too, as Tracker, Kinovea, Logger Pro "
            "and Capstone do; if each column is a ball, write A/x, B/x",
        ),
        ("t,x\n0,1\n0,1000,-0,05\n", "line 3: 4 values under 2 titles (between commas, decimals n"),
        ("A\nt\tx\n0\t1\n1\there\n", "export.txt, line 4, column x: 'here'; must be a number"),
        ("A\nt\tx\n0\t1\n1\tinf\n", "export.txt, line 4, column x: 'inf'; must be a number"),
        ("#T X Y\n0:00:00:03 1.0 2.0\n", "line 2, column T: '0:00:00:03'; must be a number"),
        ('t,x\n"0,0",1\n', "line 2, column t: '0,0'; must be a number, its decimals after a point"),
        (
            "Time (s) Run #1,Position (m) Run #1,Time (s) Run #2,Position (m) Run #2\n0,1,0,2\n",
            "the times of Position do not rise; where one ball follows the other, write its name, "
            "'# A', above; or columns named A/x, B/x",
        ),
        ("t,x\n0,1\n0,2\n", "the times of track do not rise; where one ball follows the other"),
        ("t,x (px)\n0,1\n", "line 2, column x: px; say how large a pixel is, in m: unit"),
        ("t (frames),x\n0,1\n", "column t: unit 'frames'; must be in s, ms, m, cm, mm or px"),
        ("t,x\n0,1\n33,1\n", "marks 33 s apart; if the times are in ms, divide time_scale by"),
        ("t;x\n0;1,5\n0,1;2.5\n", "decimals with a comma in line 2 and with a point in line 3"),
    ],
)
def test_exports_that_are_refused(tmp_path, text, message):
    (tmp_path / "export.txt").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(message)):
        read_tracker(tmp_path / "export.txt")


@pytest.mark.parametrize("length", [None, 0.3, 0.1])
def test_velocities_from_exact_tracks(monkeypatch, length):
    """Positions on a rail, or of pendulums by Runge-Kutta; the impact between two frames."""
    monkeypatch.setattr(fit_example, "LENGTH", length)
    after, times = outcome("ABC"), (np.arange(49) - 24.3) / 240
    tracks = {}
    for k in range(3):
        before = 1.2 if k == 0 else 0.0
        speeds = np.where(times < 0, before, 1.2 * after[k])
        if length is None:
            way = speeds * times
        else:
            way = np.where(times < 0, fit_example.swing(before, times),
                           fit_example.swing(1.2 * after[k], times))  # fmt: skip
        tracks["ABC"[k]] = Track(times + 3.0, 0.035 * k + way)
    found = velocities_from_tracks(tracks, length=length)
    assert found.time == pytest.approx(3.0, abs=2e-5)
    np.testing.assert_allclose(found.before, [1.2, 0, 0], atol=1e-4)
    np.testing.assert_allclose(found.after, 1.2 * after, atol=1e-4)
    with pytest.raises(ValueError, match="1 tracks; needs two balls and more"):
        velocities_from_tracks({"A": tracks["A"]}, length=length)
    with pytest.raises(ValueError, match=r"tracks must be in the order .* all from one origin"):
        velocities_from_tracks({"C": tracks["C"], "A": tracks["A"]}, length=length, striker=1)
    mirrored = {name: Track(t, -x) for name, (t, x) in reversed(tracks.items())}
    from_right = velocities_from_tracks(mirrored, length=length)
    np.testing.assert_allclose(from_right.before, -found.before[::-1], atol=1e-9)
    np.testing.assert_allclose(from_right.after, -found.after[::-1], atol=1e-9)


def test_velocities_of_balls_lifted_together():
    """Ball 1 comes .6 mm behind ball 2, so that its impact is .9 ms later: a part of a frame."""
    after, times = np.array([-0.03, 0.12, 0.6, 0.69]), (np.arange(121) - 60.3) / 240
    noise, tracks = np.random.default_rng(5).normal(0.0, 4e-4, (4, 121)), {}
    for k, late in enumerate([0.0006 / 0.7, 0.0, 0.0, 0.0]):
        t, before = times - late, 0.7 if k < 2 else 0.0
        way = np.where(t < 0, fit_example.swing(before, t), fit_example.swing(after[k], t))
        tracks["ABCD"[k]] = Track(times, 0.022 * k + way + noise[k])
    found = velocities_from_tracks(tracks, length=fit_example.LENGTH, striker=(0, 1))
    assert (abs(found.after - after) < 4 * found.sigma).all()
    assert (abs(found.before - [0.7, 0.7, 0, 0]) <= 4 * found.sigma_before).all()
    assert found.sigma.max() < 0.002
    mirrored = {name: Track(t, -x) for name, (t, x) in reversed(tracks.items())}
    from_right = velocities_from_tracks(mirrored, length=fit_example.LENGTH, striker=[2, 3])
    np.testing.assert_allclose(from_right.before, -found.before[::-1], atol=1e-6)
    with pytest.raises(ValueError, match="striker = 4; must be a whole number, from 0 to 3"):
        velocities_from_tracks(tracks, striker=(0, 4))


@pytest.mark.parametrize(("rate", "count"), [(30, 20), (60, 20), (240, 40)])
def test_errors_of_velocities_are_those_of_the_marks(monkeypatch, rate, count):
    """The squares of errors over their standard errors average to 1, within four of its errors."""
    monkeypatch.setattr(fit_example, "FRAMES_PER_SECOND", rate)
    monkeypatch.setattr(fit_example, "FRAMES", max(24, rate // 4))
    random = np.random.default_rng(8)
    squares = []
    for _ in range(count):
        tracks, _ = fit_example.film("AB", 1.0, random)
        found = velocities_from_tracks(
            tracks, length=fit_example.LENGTH, scatter=fit_example.SCATTER
        )
        assert found.window <= np.pi / 2 * np.sqrt(fit_example.LENGTH / 9.81)
        squares += [((found.before[0] - 1) / found.sigma_before[0]) ** 2,
                    *((found.after - outcome("AB")) / found.sigma) ** 2]  # fmt: skip
    assert np.mean(squares) == pytest.approx(1, abs=4 * np.sqrt(2 / len(squares)))


def test_a_window_that_does_not_fit(monkeypatch):
    """Balls that hang, taken for a level track, or of another length: refused, or cut short."""
    monkeypatch.setattr(fit_example, "FRAMES", 60)
    random = np.random.default_rng(8)
    for _ in range(5):
        tracks, _ = fit_example.film("AB", 1.0, random)
        with pytest.raises(ValueError, match=r"window = .* s; .* if the balls hang, give their le"):
            velocities_from_tracks(tracks)
        with pytest.raises(
            ValueError,
            match=r"window = 0.2 s; .* are length and frame rate right, "
            r"is there one impact, are all strikers named",
        ):
            velocities_from_tracks(tracks, length=0.2, window=0.2)
        # A wall at 0.15 s: what is after it is not used.
        track = tracks["B"]
        late = track.times > track.times[60] + 0.15
        there = np.where(late, track.positions[~late][-1], track.positions)
        found = velocities_from_tracks(tracks | {"B": Track(track.times, there)}, length=0.3)
        assert found.window < 0.15
        np.testing.assert_allclose(found.after, outcome("AB"), atol=4 * found.sigma.max())


def test_a_film_that_bends_by_chance(monkeypatch):
    """Right films whose longest window does not fit: a shorter one is used, with wider errors."""
    monkeypatch.setattr(fit_example, "FRAMES_PER_SECOND", 60)
    monkeypatch.setattr(fit_example, "LENGTH", 0.15)
    monkeypatch.setattr(fit_example, "SCATTER", 1e-4)
    for seed in (45, 57, 299, 309):
        tracks, _ = fit_example.film("AB", 1.0, np.random.default_rng(seed))
        with pytest.raises(ValueError, match="otherwise than by such a motion"):
            velocities_from_tracks(tracks, length=0.25)
        found = velocities_from_tracks(tracks, length=0.15)
        assert found.window < 0.13
        assert (abs(found.after - outcome("AB")) < 3 * found.sigma).all()
        alone = velocities_from_tracks(tracks, length=0.15, window=found.window)
        assert (found.sigma > alone.sigma).all()
        # Two pictures of B are missing after the impact: a window with five marks is left.
        times, marks = tracks["B"]
        seen = np.arange(times.size) != np.searchsorted(times, found.time) + np.array([[1], [2]])
        few = Track(times[seen.all(axis=0)], marks[seen.all(axis=0)])
        found = velocities_from_tracks(tracks | {"B": few}, length=0.15)
        assert (abs(found.after - outcome("AB")) < 3 * found.sigma).all()


@pytest.mark.parametrize("ball", ["A", "B"])
@pytest.mark.parametrize("at", [12, 30])
def test_a_wrong_mark_is_named(ball, at):
    """By ball and time, on either side, of a ball that moves or rests; right marks are not."""
    tracks, _ = fit_example.film("AB", 1.0, np.random.default_rng(8))
    assert velocities_from_tracks(tracks, length=0.3).strays == ()
    times, marks = tracks[ball]
    wrong = tracks | {ball: Track(times, marks + 0.01 * (np.arange(times.size) == at))}
    with pytest.warns(UserWarning, match=f"the mark of {ball} at {times[at]:.4g} s is off by 0.0"):
        ((k, moment, off),) = velocities_from_tracks(wrong, length=0.3).strays
    assert ("AB"[k], moment) == (ball, times[at])
    assert off == pytest.approx(0.01, rel=0.2)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_ball_at_rest_before_and_after(noise):
    """Its velocity is zero, with an error of its own, whether its marks scatter or not."""
    times, random = (np.arange(49) - 24.3) / 240, np.random.default_rng(1)
    marks = noise * random.standard_normal((3, 49))
    moving = fit_example.swing(1.0, times)
    marks[0] += np.where(times < 0, moving, 0.0)
    marks[1] += 0.035
    marks[2] += 0.07 + np.where(times < 0, 0.0, moving)
    tracks = {name: Track(times, row) for name, row in zip("ABC", marks)}
    found = velocities_from_tracks(tracks, length=0.3)
    np.testing.assert_allclose(found.before, [1, 0, 0], atol=1e-5 + 40 * noise)
    np.testing.assert_allclose(found.after, [0, 0, 1], atol=1e-5 + 40 * noise)
    assert (found.sigma > 0).all()


def test_tracks_may_be_lists_and_are_asked():
    """Of two lists, of arrays, or as a file has them; a mark that is no number is named."""
    tracks = read_tracker(DATA / "video_synthetic.txt")
    lists = {name: Track(*map(np.ndarray.tolist, ball)) for name, ball in tracks.items()}
    found, told = (velocities_from_tracks(t, length=0.3) for t in (tracks, lists))
    assert all(map(np.array_equal, found[:5], told[:5]))
    for wrong, message in (
        ([0.1] * 48, r"tracks\['A'\]\[1\] has shape \(48,\), tracks\['A'\]\[0\] has \(49,\)"),
        ([np.nan] * 49, r"tracks\['A'\]\[1, 0\] = nan; must be finite"),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            velocities_from_tracks(lists | {"A": Track(lists["A"].times, wrong)}, length=0.3)
        with pytest.raises(ValueError, match=f"^{message}"):
            frames(lists | {"A": Track(lists["A"].times, wrong)})
    turned = {name: Track(*np.flip(ball, axis=1)) for name, ball in tracks.items()}
    with pytest.raises(ValueError, match=r"^times of B\[1\] = 0\.\d+; must rise"):
        velocities_from_tracks(turned, length=0.3)
    for call in (velocities_from_tracks, frames):
        with pytest.raises(TypeError, match=r"^tracks is a list; must be"):
            call(list(tracks.values()))


def test_tracks_and_velocities_can_be_compared():
    """As objects: arrays have no one truth."""
    one, other = (read_tracker(DATA / "video_synthetic.txt")["A"] for _ in range(2))
    assert one == one != other
    assert len({one, other}) == 2


def test_correlations_are_those_of_the_ellipse():
    """A likelihood on a grid against the inverse of its matrix."""
    matrix = 1e4 * np.array([[2.0, 1.2], [1.2, 3.0]])
    axis = np.linspace(0.0, 0.1, 101)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    excess = np.einsum("pi,ij,pj->p", points - 0.05, matrix, points - 0.05)
    group = Group((tuple("ABC"), tuple("CBA")), points, np.exp(-excess / 2))
    found = Fit(Shots(()), {}, {}, (group,), 0.0, 1).correlations()
    spread = np.linalg.inv(matrix)
    expected = spread[0, 1] / np.sqrt(spread[0, 0] * spread[1, 1])
    assert found == {("ABC", "CBA"): pytest.approx(expected, abs=1e-4)}


def test_summary_names_what_is_off():
    """Twelve shots without errors but one, four of its errors off; a ratio beside its pair."""
    errors = np.zeros((12, 3))
    errors[7, 1] = 0.04
    shots = read_shots(columns("ABA", [1.0] * 12, outcome("ABA"), 0.01, errors))
    found = ratio(shots, pairs_of("ABA", 0.0))
    text = found.summary().splitlines()
    assert text[0] == f"{found['ABA']}, standard error {found['ABA'].standard_error:.2g}"
    chance = chi2.sf(found.chi_square, 35)
    assert text[1].endswith(f"degrees of freedom 35, chance {chance:.2g}")
    size, largest = re.fullmatch(
        r"residuals of ABA: (\S+) standard errors, the largest (\S+) \(shot 7, ball 2\)", text[2]
    ).groups()
    # Its own error, and that of the striker's speed with which it goes.
    alone = 0.04 / (0.01 * np.hypot(1, outcome("ABA")[1]))
    assert float(largest) == pytest.approx(alone, abs=0.4)
    assert float(size) == pytest.approx(alone / 6, abs=0.1)


def test_a_set_that_is_no_bell_curve_is_said():
    """CBD has a fold at its ratio; ABA has none."""
    for name, folded in (("CBD", True), ("ABA", False)):
        shots = read_shots(columns(name, [0.5, 1.0, 1.5, 2.0], outcome(name), 0.01))
        known = {} if name == "ABA" else {"DBC": 0.5}
        found = ratio(shots, pairs_of(name, 0.0), known=known)
        assert found[name].folded == folded
        assert (FOLDED in found.summary()) == folded


@pytest.mark.parametrize(("e", "sigma"), [(0.97, 0.02), (0.02, 0.02), (0.8, 0.05)])
def test_a_bell_curve_that_the_range_cuts_off_is_one(e, sigma):
    """Twenty fits of one pair near an end of its range: nothing is said of their sets."""
    random, sides = np.random.default_rng(7), []
    for _ in range(20):
        after = [(1.0 - e) / 2.0, (1.0 + e) / 2.0] + sigma * random.standard_normal(2)
        table = {"set": "AA", "shot": 1, "ball": [1, 2], "type": "A", "mass": 1.0}
        table |= {"before": [1.0, 0.0], "after": np.sort(after), "sigma_before": 0.0}
        shots = read_shots({k: np.broadcast_to(x, 2) for k, x in table.items()}, sigma=sigma)
        found = restitution(shots)
        (low, high), value = found["AA"].intervals[0], found["AA"].value
        sides.append((value - low) / (high - value or 1.0))
        assert not found["AA"].folded
        assert FOLDED not in found.summary()
    assert max(sides) > SKEW or min(sides) < 1.0 / SKEW  # the range does cut them off


@pytest.mark.parametrize("e", [0.0, 0.01, 0.5, 0.99, 1.0])
def test_an_error_is_no_smaller_where_the_range_cuts_the_set_off(e):
    """Equal balls part with e: velocities (1 - e)/2 and (1 + e)/2 tell it to sigma times root 2."""
    table = {"set": "AA", "shot": 1, "ball": [1, 2], "type": "A", "mass": 1.0, "sigma_before": 0.0}
    table |= {"before": [1.0, 0.0], "after": [(1.0 - e) / 2.0, (1.0 + e) / 2.0]}
    shots = read_shots({k: np.broadcast_to(x, 2) for k, x in table.items()}, sigma=0.01)
    assert restitution(shots)["AA"].standard_error == pytest.approx(0.01 * 2**0.5, rel=1e-6)


def test_predictions_cover():
    """A chain of five from pairs and triplets, 12 times: the truth is nearly always inside."""
    truth, inside = outcome("ABABA"), []
    random = np.random.default_rng(11)
    for _ in range(12):
        tables = [
            pd.DataFrame(columns(name, [0.5, 1.0, 1.5, 2.0], outcome(name), 0.01,
                                 0.01 * random.standard_normal((4, len(name)))))
            for name in ("AB", "ABA", "BAB")
        ]  # fmt: skip
        shots = read_shots(pd.concat(tables))
        predicted = ratio(shots, restitution(shots)).predict("ABABA")
        inside += ((predicted.lower <= truth) & (truth <= predicted.upper)).tolist()
    assert binom.ppf(1e-3, 60, 0.9) <= sum(inside)


# --- stored data -------------------------------------------------------------------------------


def test_synthetic_example_is_what_the_script_makes(monkeypatch):
    monkeypatch.setattr(fit_example, "SETS", {"BAC": 1})
    monkeypatch.setattr(fit_example, "SPEEDS", fit_example.SPEEDS[:1])
    rows, text = fit_example.experiment()
    assert text == (DATA / "video_synthetic.txt").read_text(encoding="utf-8")
    lines = (DATA / "shots_synthetic.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# SYNTHETIC")
    kept = [line.split(",") for line in lines if line.startswith("BAC,1,")]
    for made, line in zip(rows, kept, strict=True):
        assert list(map(str, made[:5])) == line[:5]
        np.testing.assert_allclose([float(x) for x in made[5:7]],
                                   [float(x) for x in line[5:7]], atol=2e-4)  # fmt: skip


def test_synthetic_row_and_swing_are_what_the_script_makes():
    rows = [row for lifted in (1, 2, 3) for row in fit_example.row_of(lifted)]
    comment, header, *lines = (DATA / "row_synthetic.csv").read_text(encoding="utf-8").splitlines()
    assert comment.startswith("# SYNTHETIC")
    assert header == ",".join(fit_example.HEADER.split())
    for made, line in zip(rows, lines, strict=True):
        *stored, after, sigma, sigma_before = line.split(",")
        assert [str(x) for x in (*made[:6], *made[7:])] == [*stored, sigma, sigma_before]
        assert float(made[6]) == pytest.approx(float(after), abs=1.1e-5)
    films = {
        "swing_synthetic.txt": fit_example.film_of_a_swing,
        "row_film_synthetic.txt": fit_example.film_of_the_row,
    }
    for name, film in films.items():
        stored = (DATA / name).read_text(encoding="utf-8").splitlines()
        made = film().splitlines()
        assert made[:3] == stored[:3]
        places = (np.loadtxt(text, skiprows=3, encoding="utf-8") for text in (made, stored))
        np.testing.assert_allclose(*places, rtol=0, atol=1.1e-5)


def test_example_ends_in_the_values_it_was_made_with():
    shots = read_shots(DATA / "shots_synthetic.csv")
    squares, count = shots.momentum_check()
    assert abs(squares - count) < 4 * np.sqrt(2 * count)
    e = restitution(shots)
    assert e["AB"].value == pytest.approx(0.53, abs=3 * e["AB"].standard_error)
    some = Shots(tuple(s for s in shots.sets if s.name in ("ABA", "ACA")))
    found = ratio(some, e)
    for name, true in (("ABA", 0.127), ("ACA", 0.262)):
        assert found[name].value == pytest.approx(true, abs=3 * found[name].standard_error)
    assert found.probability > 1e-3
    predicted = found.predict("ABA", 1.0)
    np.testing.assert_allclose(predicted.median, outcome("ABA"), atol=0.01)
    assert found.predict("AB", 2.0).median == pytest.approx(2 * outcome("AB"), abs=0.02)
    for same in ("A-B-A", ("A", "B", "A")):
        assert repr(found.predict(same)) == repr(predicted)
    with pytest.raises(ValueError, match="the ratio of BAB is not known"):
        found.predict("ABABA")
    with pytest.raises(ValueError, match="no mass is known of type 'D'"):
        found.predict("ABD")
    assert found.table().loc["ABA", "value"] == found["ABA"].value
    left, right = found.plot("ABA")
    assert left.get_xlabel() == "ratio ABA"
    assert len(right.containers) == 3


def test_study_covers_as_often_as_it_says():
    """95 of 100, over all triplets, at each noise: within what chance allows."""
    rows = read("fit_study.csv")
    assert len(rows) == 3 * 64
    assert {row["triplet"] for row in rows} == set(ratio_table().triplet)
    for noise in ("0.003", "0.01", "0.03"):
        some = [row for row in rows if row["noise"] == noise]
        trials = sum(int(row["datasets"]) for row in some)
        covered = sum(int(row["covered"]) for row in some)
        assert binom.ppf(1e-4, trials, 0.95) <= covered <= binom.ppf(1 - 1e-4, trials, 0.99)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("triplet", "noise"), [("ABA", 0.03), ("CCA", 0.003), ("ACC", 0.003)])
def test_study_is_what_the_script_makes(triplet, noise):
    made = fit_study.study(triplet, noise)
    (row,) = read("fit_study.csv", triplet=triplet, noise=str(noise))
    assert int(row["covered"]) == made[5]
    np.testing.assert_allclose(float(row["width"]), float(made[6]), rtol=0.02)


@pytest.mark.parametrize("triplet", ["AAA", "BBD", "CBD", "DAA"])
def test_precision_is_what_the_script_makes(triplet):
    (row,) = read("fit_precision.csv", triplet=triplet)
    for name, value in zip(fit_study.PRECISION[1:], fit_study.precision(triplet)[1:], strict=True):
        assert bool(row[name]) == bool(value) or value == 0
        if row[name] and float(row[name]) > 1e-4:
            assert float(value) == pytest.approx(float(row[name]), rel=2e-3, abs=2e-4), name


def test_files_that_are_no_table_of_ours(tmp_path):
    """As spreadsheets save them: each says what to do."""
    lines = (DATA / "shots_template.csv").read_text(encoding="utf-8").splitlines()
    cases = {
        "decimals with a comma in line 4 and with a point in line 5": [
            line.replace(",", ";").replace(".", "," if n == 3 else ".")
            for n, line in enumerate(lines)
        ],
        r"13 values; the header has 9 columns \(between commas, decimals need a point": [
            line.replace("0.", "0,") for line in lines
        ],
        "set ABA has the balls AB alone; is the row of ball 3 missing": lines[:-1],
    }
    for number, (words, table) in enumerate(cases.items()):
        path = tmp_path / f"{number}.csv"
        path.write_text("\n".join(table) + "\n", encoding="utf-8")
        with pytest.raises(ValueError, match=words):
            read_shots(path)
    same = repr(read_shots(DATA / "shots_template.csv").sets[1].after)
    for marks in (",.", ";.", ";,", "\t.", "\t,"):
        text = "\n".join(lines).translate(str.maketrans(",.-", f"{marks}{MINUS}"))
        text = f"sep={marks[0]}\n{text}"  # as some spreadsheets want to be told
        path.write_text(text, encoding="utf-8-sig")
        assert repr(read_shots(path).sets[1].after) == same
        assert repr(read_shots(io.StringIO(text)).sets[1].after) == same
    path.write_text("\n".join(lines), encoding="utf-16")
    with pytest.raises(ValueError, match=r"2.csv is no UTF-8 text \(byte 0\); save it as CSV in"):
        read_shots(path)
    # Rows without a cell filled say nothing.
    path.write_text("\n".join([*lines, ",,,,,,,,", "", " , "]), encoding="utf-8")
    assert len(read_shots(path)["AB"].shots) == 2
    # Any other name is free, whatever balls it has.
    for other in ("first day", "ABA-2", "ABAb"):
        path.write_text("\n".join(lines).replace("\nABA,", f"\n{other},"), encoding="utf-8")
        assert [one.name for one in read_shots(path).sets] == ["AB", other]
