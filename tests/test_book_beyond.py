"""What book/beyond.ipynb says, from the stored table (long_chains.py) and by second routes."""

from functools import cache, partial

import judge
import long_chains
import numpy as np
import pytest
from chains import HERTZ, uniform
from chapters import Chapter, number, points
from kernels import needs_numba
from problem import Problem
from stored import numbers
from truth import solve

from cradle import (
    Chain,
    ImpulseCorrelation,
    SpringChain,
    collide,
    outcomes,
    post_impact_velocities,
)
from cradle.kernel.state import LIMITS

CHAPTER = Chapter("beyond")


table = cache(partial(numbers, "long_chains.csv"))


def find(group, **equal):
    return [row for row in table() if row.items() >= {"group": group, **equal}.items()]


def column(rows, *names):
    found = np.array([[row[name] for name in names] for row in rows])
    return found[:, 0] if len(names) == 1 else found


def struck(balls, strikers=1):
    velocities = np.zeros(balls)
    velocities[:strikers] = 1.0
    return np.ones(balls), velocities


def ends(ratio):
    root = np.sqrt(1.0 - 2.0 * np.asarray(ratio))
    return np.stack([-np.asarray(ratio), 1.0 - root, 1.0 + root], axis=-1) / (
        2.0 - np.asarray(ratio)[..., None]
    )


def test_every_row_of_the_benchmark_is_stored():
    assert list(table()[0]) == long_chains.COLUMNS
    b = long_chains
    assert len(find("map")) == 1
    assert len(find("elastic")) == len(b.ELASTIC_RATIOS) * len(b.ELASTIC_BALLS)
    assert len(find("losses")) == len(b.LOSSES_RATIOS) * sum(map(len, b.LOSSES.values()))
    assert len(find("springs")) == sum(map(len, b.SPRINGS.values()))


def test_stored_elastic_rows_have_the_closed_form():
    rows = find("elastic")
    stored = column(rows, "first", "second_last", "last")
    np.testing.assert_allclose(stored, ends(column(rows, "ratio")), rtol=0, atol=1e-10)
    assert (column(rows, "collisions") == column(rows, "balls") - 1).all()
    assert not column(rows, "collapsed").any()
    for row in rows:
        assert row["fast"] == (1 if row["ratio"] == 0 else 2)
        assert row["back"] == (0 if row["ratio"] == 0 else 1)
        assert abs(row["third_last"]) < 1e-15


@needs_numba
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.15, 0.3, 0.45, 0.5])
def test_longest_rows_again(ratio):
    stored = find("elastic", ratio=ratio)
    balls = int(max(row["balls"] for row in stored)) if stored else 1000
    found = outcomes(*struck(balls), 1.0, ratio)
    np.testing.assert_allclose(found.velocities[[0, -2, -1]], ends(ratio), rtol=0, atol=1e-13)
    assert np.abs(found.velocities[1:-2]).max() < 1e-14
    assert (found.collisions == 1).all()


def test_rows_of_linear_springs_by_their_modes():
    """All contacts closed is a linear system: exact until the first contact opens."""
    row = find("springs", exponent=1.0, balls=3.0)[0]
    # Frequencies of three equal balls on two equal springs are 1 and sqrt 3.
    times, fast = np.linspace(0, 6, 600_001), np.sqrt(3)
    one, three = np.sin(times), np.sin(fast * times) / fast
    # Compressions x1 - x2 and x2 - x3 for the start (1, 0, 0).
    first, second = (one + three) / 2, (one - three) / 2
    opens = np.argmax((first < 0) & (times > 0.1))
    slow, quick = np.cos(times[opens]) / 2, np.cos(fast * times[opens]) / 6
    speeds = 1 / 3 + np.array([slow + quick, -2 * quick, quick - slow])
    # Then the last two balls part alone: energy of their spring, which is not yet open.
    relative = np.hypot(speeds[1] - speeds[2], np.sqrt(2) * second[opens])
    middle = (speeds[1] + speeds[2]) / 2
    expected = [speeds[0], middle - relative / 2, middle + relative / 2]
    stored = [row["first"], row["second_last"], row["last"]]
    np.testing.assert_allclose(stored, expected, rtol=0, atol=2e-5)


def test_fig_beyond_front():
    """The closed form at the far end of a long row."""
    (ax,) = CHAPTER.figures["fig-beyond-front"].axes
    drawn = {k: [] for k in range(3)}
    for number_of, line in enumerate(points(ax)):  # three of marks, two of the formula
        drawn[number_of % 3].append(line)
    assert [len(lines) for lines in drawn.values()] == [2, 2, 1]
    for k, line in ((k, line) for k, lines in drawn.items() for line in lines):
        expected = [[*ends(ratio)[[2, 1]], 0][k] for ratio in line[:, 0]]
        # Near 1/2 the root is steep.
        np.testing.assert_allclose(line[:-1, 1], expected[:-1], rtol=0, atol=1e-12)
        assert line[-1, 1] == pytest.approx(expected[-1], abs=1e-7)


def test_fig_beyond_leader():
    """A leader that slows down with every ball."""
    (ax,) = CHAPTER.figures["fig-beyond-leader"].axes
    lengths = np.array([10, 20, 40, 80, 160])
    written = dict(text.get_text().split(": q = ") for text in ax.texts)
    lines = points(ax)
    assert len(written) == 3
    assert len(lines) == 6
    for ratio, fitted, marks in zip((0, 0.3, 0.45), lines[::2], lines[1::2]):
        q = written[f"ratio {ratio:g}"]
        leaders = [outcomes(*struck(n), 0.99, ratio).velocities[-1] for n in lengths]
        np.testing.assert_array_equal(marks, np.transpose([lengths, leaders]))
        # The same part from ball to ball, whatever the length.
        parts = np.divide(leaders[1:], leaders[:-1]) ** (1 / lengths[:-1])
        np.testing.assert_allclose(parts, parts[-1], rtol=1e-4)
        assert float(q) == pytest.approx(parts[-1], abs=6e-5)
        np.testing.assert_allclose(fitted[:, 1], leaders, rtol=0.01)


def test_fig_inventory_time():
    """Time in proportion to the length, from a thousand balls on."""
    (ax,) = Chapter("extremes_inventory").figures["fig-inventory-time"].axes
    for line, ratio in zip(points(ax), (0.0, 0.1, 0.3, 0.5)):
        rows = find("elastic", ratio=ratio)
        np.testing.assert_array_equal(line, column(rows, "balls", "cpu_seconds"))
    for ratio in long_chains.ELASTIC_RATIOS:
        rows = [row for row in find("elastic", ratio=ratio) if row["balls"] >= 1000]
        slope = np.polyfit(np.log(column(rows, "balls")), np.log(column(rows, "time_ratio")), 1)[0]
        assert 0.9 < slope < 1.1
    longest = find("elastic", balls=100_000.0)
    assert column(longest, "cpu_seconds").max() < 1.0  # a long chain in a second
    assert LIMITS.cut == 2.0**-120  # as the text has it


def test_copies_are_told_apart_by_decimals():
    """Where copies come out differently, so they do over numbers of a hundred digits."""
    masses, velocities, restitutions = long_chains.copies(0.9, 20)
    found = outcomes(masses, velocities, restitutions, 0.3).velocities
    for k in (1, 2):
        given = masses[k], velocities, restitutions[k], np.full(18, 0.3), np.full(18, 0.3)
        problem = Problem(*(x.tolist() for x in given))
        assert judge.off(problem, judge.exact(problem).velocities, found[k]) < 1e-15
    assert abs(found[1, -1] / found[2, -1] - 1.0) > 5e-6


def test_fig_beyond_stability():
    """The table as drawn, and the front."""
    (digits,) = CHAPTER.figures["fig-beyond-stability"].axes
    written = iter(digits.texts)
    for k, ratio in enumerate((0.0, 0.1, 0.3, 0.45)):
        rows = find("losses", restitution=0.99, ratio=ratio, collapsed=0.0)
        assert digits.get_yticklabels()[k].get_text() == f"{ratio:g}"
        for place, (length, kept) in enumerate(column(rows, "balls", "kept")):
            mark = next(written)
            assert mark.get_position() == (place, k)
            assert mark.get_text() == ("all" if kept == length else f"{kept:g}")
            assert float(digits.get_xticklabels()[place].get_text()) == length
    for e in (0.9, 0.99, 0.999):
        # At ratio zero, Newton's rule for two balls, from ball to ball.
        for row in find("losses", restitution=e, ratio=0.0, collapsed=0.0):
            kept = ((1 + e) / 2) ** (row["balls"] - 1)
            np.testing.assert_allclose(row["last"], kept, rtol=1e-9)
    for e in (0.99, 0.999):
        for row in find("losses", restitution=e, ratio=0.0):
            assert row["kept"] == row["balls"]
        for ratio in (0.1, 0.3, 0.45):
            rows = find("losses", restitution=e, ratio=ratio)
            assert rows[-1]["orders"] == rows[-1]["chains"]
            assert rows[-1]["kept"] <= 2
    finite = find("losses", collapsed=0.0)
    rows_99 = [row for row in finite if row["restitution"] == 0.99]
    assert column(finite, "spread").max() < 2e-3
    assert column([row for row in finite if row["restitution"] > 0.9], "spread").max() < 2e-5
    assert (column(finite, "fast_least") == column(finite, "fast_most")).all()
    assert CHAPTER.glued["fast-same"] == "all"
    front = [row for row in finite if row["restitution"] > 0.9 and row["ratio"] > 0]
    assert {*column(front, "fast_least", "fast_most").ravel()} == {
        number(CHAPTER.glued["fast-near"])
    }
    endless = [row for row in find("losses") if row["collapsed"]]
    assert {(row["balls"], row["restitution"]) for row in endless} == {(100, 0.9)}
    assert number(CHAPTER.glued["endless"]) == len(endless)
    CHAPTER.tells({"spread-endless": column(endless, "spread").max()})
    pairwise = find("losses", restitution=0.9, ratio=0.0)
    unsafe = [row["balls"] for row in pairwise if row["kept"] < row["balls"] and row in finite]
    assert unsafe == [number(CHAPTER.glued["pairwise-unsafe"])]  # no longer one
    assert number(CHAPTER.glued["loss-rows"]) == len(finite)
    fewer = [row for row in rows_99 if row["kept"] < row["balls"]]
    assert number(CHAPTER.glued["unsafe"]) == min(column(fewer, "balls")) == 20
    assert column(fewer, "ratio").all()
    # A change of masses that is not a rounding error: the leader stays, others do not.
    masses, velocities = np.ones((9, 120)), struck(120)[1]
    masses[1:] *= 1 + 1e-15 * uniform(np.random.default_rng(5), -1, 1, (8, 120))
    after = outcomes(masses, velocities, 0.99, 0.3).velocities
    off = np.abs(after / after[0] - 1).max(axis=0)
    assert off[-1] < 1e-4
    assert off[1:-2].max() > 1e-3
    CHAPTER.tells({"slow-change": 100 * off[1:-2].max()})


def test_fig_beyond_springs():
    """Ratios along five balls and by the leader; the tail."""
    along, tail = CHAPTER.figures["fig-beyond-springs"].axes
    rough = CHAPTER.glued["along-rough"].replace(" and", ",").split(", ")
    assert rough == [f"{a:.2f}" for a in points(along)[0][:, 1]]
    end = CHAPTER.glued["end-hertz"].replace(" and", ",").split(", ")
    row_40 = find("springs", exponent=1.5, balls=40.0)[0]
    assert end == [f"{row_40[name]:.3f}" for name in ("third_last", "second_last", "last")]
    spheres = collide(Chain(*struck(40), 1), SpringChain(1.0)).velocities
    tried = np.linspace(0, 0.5, 500_001)
    rows = find("springs", exponent=1.5)
    # It falls with the ratio.
    by_leader = np.interp(-column(rows, "last"), -ends(tried)[:, 2], tried)
    best = by_leader[-1]
    expected = spheres, np.concatenate([ends(best)[:1], np.zeros(5)])
    for k, (v, off) in enumerate(zip(expected, (0, 2e-4), strict=True)):
        np.testing.assert_allclose(points(tail)[k][:, 1], v[:6], rtol=0, atol=off)
    assert rows[2]["balls"] == 5
    named = {"leader-asks": best, "ratio-three": by_leader[0], "leader-five": by_leader[2]}
    CHAPTER.tells(named)
    CHAPTER.tells({"striker-hertz": spheres[0], "striker-ratio": ends(best)[0]})
    assert number(CHAPTER.glued["back-hertz"]) == (spheres < -0.01).sum() == rows[-1]["back"]
    assert (np.diff(by_leader[:8]) > 0).all()


def test_ratios_that_differ_from_ball_to_ball_give_the_springs_for_one_strike():
    """The ratios drawn, with the velocities of another program; two strikers miss them."""
    along, _ = CHAPTER.figures["fig-beyond-springs"].axes
    ratios = points(along)[0][:, 1]
    after = post_impact_velocities(*struck(5), 1.0, ratios, excess="saturate")
    np.testing.assert_allclose(after, HERTZ["five equal"], rtol=0, atol=2e-4)
    model = ImpulseCorrelation(ratios, excess="saturate")
    assert (collide(Chain(*struck(5), 1), model).collisions == 1).all()
    # By hand: the impulses of the first two contacts, from the velocities of balls 1 and 2.
    first, second, _ = ratios
    tau_2 = 2 / (2 - first)
    start = (1 - first) * tau_2 - (1 - second) * first * tau_2
    rest = (start + np.sqrt(start**2 + (2 - second) * start * first * tau_2)) / (2 - second)
    by_hand = [1 - tau_2, tau_2 - first * tau_2 - rest]
    np.testing.assert_allclose(by_hand, HERTZ["five equal"][:2], rtol=0, atol=2e-4)
    # One ratio for all leaves ball 2 at rest.
    assert HERTZ["five equal"][1] < -0.03
    springs = collide(Chain(*struck(5, 2), 1), SpringChain(1.0)).velocities
    options = {"backward": ratios[::-1], "excess": "saturate"}
    after = post_impact_velocities(*struck(5, 2), 1.0, ratios, **options)
    CHAPTER.tells({"two-mirrored": np.abs(after - springs).max()})


def test_a_leader_predicted_from_shorter_rows():
    """The exercise: what 20 and 40 balls say of 160."""
    names = "leader-20", "leader-40", "kept", "guess", "solved"
    few, more, kept, guess, solved = (float(CHAPTER.glued[name]) for name in names)
    after = solve([1] * 20, struck(20)[1].tolist(), 0.99, 0.3, number=float).velocities
    assert few == pytest.approx(after[-1], abs=6e-5)
    assert kept == pytest.approx((more / few) ** (1 / 20), abs=1e-4)
    assert guess == pytest.approx(more * kept**120, abs=5e-3)
    assert solved == pytest.approx(outcomes(*struck(160), 0.99, 0.3).velocities[-1], abs=6e-4)
    assert solved == pytest.approx(guess, abs=2e-3)
