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

from cradle import Chain, SpringChain, collide, outcomes, post_impact_velocities
from cradle.closed_form import back_impact_line, one_collision_each
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


def test_fig_beyond_map():
    """Two collisions above Eq. 44, more below; white where the sequence is infinite."""
    axis = np.geomspace(0.01, 3, 250)
    m1, m3 = np.broadcast_arrays(1 / axis[:, None], 1 / axis)
    masses = np.stack([m1, np.ones_like(m1), m3], axis=-1)
    found = outcomes(masses, [1, 0, 0], 0.5, 0.15)
    assert found.collapsed.size == number(CHAPTER.glued["map-live"])
    above = axis[:, None] > back_impact_line(axis, 0.5, 0.5, 0.15)[None, :]
    np.testing.assert_array_equal((found.collisions == 1).all(axis=-1), above)
    once = one_collision_each(masses, np.array([1.0, 0, 0]), np.full(2, 0.5), 0.15)
    np.testing.assert_array_equal(once, above)
    assert 0.05 < found.collapsed.mean() < 0.5  # it is seen
    assert axis[np.argwhere(found.collapsed).max()] < 0.3
    ax = CHAPTER.figures["fig-beyond-map"].axes[0]
    count = ax.collections[0].get_array().reshape(250, 250)
    for row, column in ((240, 240), (190, 190), (140, 210), (210, 90), (120, 170), (110, 110)):
        done = solve(masses[row, column].tolist(), [1, 0, 0], 0.5, 0.15, number=float)
        assert count[row, column] == sum(kind == "end" for kind, _ in done.events), (row, column)
    x, r1 = ax.get_lines()[0].get_xydata().T
    line = 1.5 * (1 + 0.5 * np.sqrt(1 - 0.15 * (1 + x))) / (0.5 * (1 + x)) - 1.3  # Eq. 44
    np.testing.assert_allclose(r1, line, rtol=1e-12)


def test_fig_beyond_front():
    """Above: the closed form for any length; below: a leader that slows down with every ball."""
    upper, lower = CHAPTER.figures["fig-beyond-front"].axes
    drawn = {k: [] for k in range(3)}
    for number_of, line in enumerate(points(upper)):  # three of marks, two of the formula
        drawn[number_of % 3].append(line)
    assert [len(lines) for lines in drawn.values()] == [2, 2, 1]
    for k, line in ((k, line) for k, lines in drawn.items() for line in lines):
        expected = [[*ends(ratio)[[2, 1]], 0][k] for ratio in line[:, 0]]
        # Near 1/2 the root is steep.
        np.testing.assert_allclose(line[:-1, 1], expected[:-1], rtol=0, atol=1e-12)
        assert line[-1, 1] == pytest.approx(expected[-1], abs=1e-7)
    lengths = np.array([10, 20, 40, 80, 160])
    written = dict(text.get_text().split(": q = ") for text in lower.texts)
    lines = points(lower)
    assert len(written) == 3
    assert len(lines) == 6
    for ratio, fitted, marks in zip((0, 0.3, 0.45), lines[::2], lines[1::2]):
        q = written[str(ratio) if ratio else "ratio 0"]
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
    slowest = column(longest, "cpu_seconds").max()
    assert CHAPTER.glued["seconds-most"] == f"{float(f'{slowest:.1e}'):g} s"
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
    """The count of collisions, the point where the order becomes chance, and the front."""
    digits, counts = CHAPTER.figures["fig-beyond-stability"].axes
    written = iter(digits.texts)
    for k, ratio in enumerate((0.0, 0.1, 0.3, 0.45)):
        rows = find("losses", restitution=0.99, ratio=ratio, collapsed=0.0)
        balls, collisions = column(rows, "balls", "collisions").T
        np.testing.assert_allclose(points(counts)[k][:, 1], collisions / (balls * (balls - 1) / 2))
        assert digits.get_yticklabels()[k].get_text() == f"{ratio:g}"
        for place, (length, kept) in enumerate(column(rows, "balls", "kept")):
            mark = next(written)
            assert mark.get_position() == (place, k)
            assert float(mark.get_text()) == kept
            assert float(digits.get_xticklabels()[place].get_text()) == length
    for e in (0.9, 0.99, 0.999):
        # At ratio zero, Newton's rule for two balls, from ball to ball.
        for row in find("losses", restitution=e, ratio=0.0, collapsed=0.0):
            kept = ((1 + e) / 2) ** (row["balls"] - 1)
            np.testing.assert_allclose(row["last"], kept, rtol=1e-9)
    for e in (0.99, 0.999):
        for row in find("losses", restitution=e, ratio=0.0):
            if row["balls"] <= 240:
                assert row["collisions"] == row["balls"] * (row["balls"] - 1) / 2
            assert row["kept"] == row["balls"]
        for ratio in (0.1, 0.3, 0.45):
            rows = find("losses", restitution=e, ratio=ratio)
            count = column(rows, "collisions") / (column(rows, "balls") ** 2 / 2)
            assert 0.5 < count.min() < 0.8
            assert 1.2 < count[-1] < 2.0
            assert rows[-1]["orders"] == rows[-1]["chains"]
            assert rows[-1]["kept"] <= 2
    finite = find("losses", collapsed=0.0)
    assert column(finite, "spread").max() < 2e-3
    assert column([row for row in finite if row["restitution"] > 0.9], "spread").max() < 2e-5
    assert (column(finite, "fast_least") == column(finite, "fast_most")).all()
    assert CHAPTER.glued["fast-same"] == "all"
    # A change of masses that is not a rounding error: the leader stays, others do not.
    masses, velocities = np.ones((9, 120)), struck(120)[1]
    masses[1:] *= 1 + 1e-15 * uniform(np.random.default_rng(5), -1, 1, (8, 120))
    after = outcomes(masses, velocities, 0.99, 0.3).velocities
    off = np.abs(after / after[0] - 1).max(axis=0)
    assert off[-1] < 1e-4
    assert off[1:-2].max() > 1e-3


def test_fig_beyond_springs():
    """Ratios by the leader and by the striker; tails and fronts."""
    along, tail = CHAPTER.figures["fig-beyond-springs"].axes
    told = [float(a) for a in CHAPTER.glued["along-five"].split(", ")]
    np.testing.assert_allclose(points(along)[0], list(zip((2, 3, 4), told)), atol=5.1e-5)
    best = float(CHAPTER.glued["ratio-leader"])
    spheres = collide(Chain(*struck(40), 1), SpringChain(1.0)).velocities
    expected = spheres, np.concatenate([ends(best)[:1], np.zeros(5)])
    for k, (v, off) in enumerate(zip(expected, (0, 2e-4), strict=True)):
        np.testing.assert_allclose(points(tail)[k][:, 1], v[:6], rtol=0, atol=off)
    # A ratio that gives the leader is nearly right for the next balls, too.
    assert abs(spheres[-2] - ends(best)[1]) < 0.03
    last, first, second = column(
        find("springs", exponent=1.5), "last", "first", "second_last"
    ).T  # fmt: skip
    tried = np.linspace(0, 0.5, 500_001)
    by_leader = np.interp(-last, -ends(tried)[:, 2], tried)  # it falls with the ratio
    by_striker = -2 * first / (1 - first)
    names = "ratio-leader", "ratio-three", "ratio-striker"
    CHAPTER.tells(dict(zip(names, (by_leader[-1], by_leader[0], by_striker[-1]))))
    CHAPTER.tells({"leader-asks": by_leader[-1]})
    assert (np.diff(by_leader[:8]) > 0).all()
    assert np.abs(by_striker - by_striker[-1]).max() < 3e-4
    np.testing.assert_allclose(by_leader[0], by_striker[0], atol=1e-5)
    # The front of the long row keeps more momentum than the striker's ratio allows.
    assert last[-1] + second[-1] > 1 - first[-1] + 0.05
    last, fast = column(find("springs", exponent=1.0), "last", "fast").T
    assert (np.diff(last) < 0).all()
    assert (np.diff(fast) >= 0).all()
    assert last[-1] < 2 / 3  # slower than any constant ratio's leader


def test_ratios_that_differ_from_ball_to_ball_give_the_springs():
    """The ratios that the text quotes, with the velocities of another program."""
    ratios = [float(a) for a in CHAPTER.glued["along-five"].split(", ")]
    after = post_impact_velocities(*struck(5), 1.0, ratios, excess="saturate")
    np.testing.assert_allclose(after, HERTZ["five equal"], rtol=0, atol=2e-4)
    rough = CHAPTER.glued["along-rough"].replace(" and", ",").split(", ")
    assert rough == [f"{a:.2f}" for a in ratios]


def test_these_ratios_miss_springs_when_two_strike():
    """With backward ratios as they are, and as the mirror image asks."""
    ratios = [float(a) for a in CHAPTER.glued["along-five"].split(", ")]
    springs = collide(Chain(*struck(5, 2), 1), SpringChain(1.0)).velocities
    for name, backward in (("two-miss", ratios), ("two-mirrored", ratios[::-1])):
        options = {"backward": backward, "excess": "saturate"}
        after = post_impact_velocities(*struck(5, 2), 1.0, ratios, **options)
        CHAPTER.tells({name: np.abs(after - springs).max()})


def test_two_strikers_have_no_closed_form():
    """Four balls fly off at the stored ratio, and the leader is faster in a longer row."""
    leaders = []
    for balls in (20, 50, 200):
        after = outcomes(*struck(balls, 2), 1.0, 0.3).velocities
        assert (after > 0.01).sum() == 4
        leaders.append(after[-1])
    assert leaders[0] < leaders[1] - 0.02 < leaders[2] - 0.04
    for name, balls in (("short", 20), ("long", 100)):
        after = solve([1] * balls, struck(balls, 2)[1].tolist(), 1, 0.3, number=float)
        assert float(CHAPTER.glued[f"two-{name}"]) == pytest.approx(after.velocities[-1], abs=6e-3)


def test_a_leader_predicted_from_shorter_rows():
    """Exercise 2: what 20 and 40 balls say of 160."""
    names = "leader-20", "leader-40", "kept", "guess", "solved"
    few, more, kept, guess, solved = (float(CHAPTER.glued[name]) for name in names)
    after = solve([1] * 20, struck(20)[1].tolist(), 0.99, 0.3, number=float).velocities
    assert few == pytest.approx(after[-1], abs=6e-5)
    assert kept == pytest.approx((more / few) ** (1 / 20), abs=1e-4)
    assert guess == pytest.approx(more * kept**120, abs=5e-3)
    assert solved == pytest.approx(outcomes(*struck(160), 0.99, 0.3).velocities[-1], abs=6e-4)
    assert solved == pytest.approx(guess, abs=2e-3)
