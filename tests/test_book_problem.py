"""Chapter "The problem": momentum, restitution, and the two answers (Eqs. 1-6, Fig. 1)."""

from fractions import Fraction

import numpy as np
import pytest
from chains import uniform
from chapters import Chapter, number
from scipy.optimize import brentq
from test_book_n_balls import outcome
from truth import solve

from cradle import Chain, ImpulseCorrelation, collide, paper_chain, paper_sequences

EQUAL = Chain([1, 1, 1], [1, 0, 0], 1)
CHAPTER, READING = Chapter("problem"), Chapter("reading")


def elastic(m1, v1, m2, v2):
    """Two balls, e = 1: each velocity is mirrored in that of the centre of mass."""
    centre = (m1 * v1 + m2 * v2) / (m1 + m2)
    return 2 * centre - v1, 2 * centre - v2


def random_chain(rng):
    chain = Chain(
        uniform(rng, 0.5, 2, 3), np.sort(uniform(rng, -1, 1, 3))[::-1], uniform(rng, 0.2, 1, 2)
    )
    return chain, ImpulseCorrelation(uniform(rng, 0, 0.2))


@pytest.mark.parametrize("equation", [1, 2, 3])
def test_eqs_1_to_3_momentum_of_each_ball(equation: int):
    rng = np.random.default_rng(1)
    for _ in range(50):
        chain, model = random_chain(rng)
        trace = collide(chain, model)
        tau_2, tau_3 = trace.path_impulses.T
        push = {1: -tau_2, 2: tau_2 - tau_3, 3: tau_3}[equation]
        ball = equation - 1
        change = chain.masses[ball] * (trace.path[:, ball] - chain.velocities[ball])
        np.testing.assert_allclose(change, push, rtol=0, atol=1e-13)
        # A contact can only push: what makes the signs those of Eqs. 1-3.
        assert (np.diff(trace.path_impulses, axis=0) >= 0).all()
        assert trace.impulses[0] > 0


def test_eq_4_kinematic_restitution():
    """For two balls kinematic and energetic restitution agree."""
    rng = np.random.default_rng(4)
    for e in uniform(rng, 0, 1, 50):
        chain = Chain(uniform(rng, 0.1, 10, 2), [uniform(rng, 0, 1), uniform(rng, -1, 0)], e)
        v = collide(chain, ImpulseCorrelation(0)).velocities
        before = chain.velocities[0] - chain.velocities[1]
        assert v[0] - v[1] == pytest.approx(-e * before, rel=0, abs=1e-13)


def test_eqs_1_to_4_leave_one_unknown():
    """Unknown: three velocities and two impulses; rows: Eqs. 1-4 for some masses."""
    rows = np.array(
        [[2, 0, 0, 1, 0], [0, 3, 0, -1, 1], [0, 0, 5, 0, -1], [1, -1, 0, 0, 0]], dtype=float
    )
    assert [5 - np.linalg.matrix_rank(rows[:count]) for count in (3, 4)] == [2, 1]
    assert CHAPTER.printed("sympy-count").splitlines() == [
        "Eqs. 1-3: 5 unknowns, rank 3, 2 missing",
        "Eqs. 1-4: 5 unknowns, rank 4, 1 missing",
    ]


def test_eq_5_fused_rest():
    first, rest = elastic(Fraction(1), Fraction(1), Fraction(2), Fraction(0))
    expected = [float(x) for x in (first, rest, rest)]
    for velocities in (
        solve([1, 1, 1], [1, 0, 0], 1, "0.5").velocities,
        collide(EQUAL, ImpulseCorrelation(0.5)).velocities,
    ):
        np.testing.assert_allclose([float(v) for v in velocities], expected, rtol=0, atol=1e-14)
    assert f"({first}, {rest}, {rest})" in CHAPTER.printed("sympy-answers")


def test_eq_6_sequential():
    v1, v2 = elastic(Fraction(1), Fraction(1), Fraction(1), Fraction(0))
    v2, v3 = elastic(Fraction(1), v2, Fraction(1), Fraction(0))
    expected = [float(x) for x in (v1, v2, v3)]
    for velocities in (
        solve([1, 1, 1], [1, 0, 0], 1, 0).velocities,
        collide(EQUAL, ImpulseCorrelation(0)).velocities,
    ):
        np.testing.assert_allclose([float(v) for v in velocities], expected, rtol=0, atol=1e-14)
    assert f"({v1}, {v2}, {v3})" in CHAPTER.printed("sympy-answers")


def test_the_ends_of_the_ratio_are_the_two_answers():
    """The cell names the answer that it meets and asserts none: a reader may change the ratio."""
    lines = CHAPTER.printed("cradle-answers-code").splitlines()
    ends = {line.split(":")[0]: line.rpartition("  ")[2] for line in lines}
    assert ends == {"ratio 0": "Eq. 6", "ratio 0.15": "in between", "ratio 0.5": "Eq. 5"}


def test_fig_1_is_drawn_and_described():
    cell = CHAPTER.cells["draw-impulses"]
    assert any("image/svg+xml" in output.get("data", {}) for output in cell.outputs)
    assert cell.metadata["mystnb"]["figure"]["name"] == "fig-p1"
    alt = cell.metadata["mystnb"]["image"]["alt"]
    assert all(word in alt for word in ("Three balls", "tau 2", "tau 3", "velocity before"))


def test_fig_own_problem_family():
    """The ellipse holds the conserving outcomes; the model walks the possible arc."""
    rng = np.random.default_rng(6)
    for _ in range(100):
        m, v = uniform(rng, 0.1, 10, 3), uniform(rng, -1, 1, 3)
        u2, u3 = v[0] - v[1], v[1] - v[2]
        relative = m[0] * m[1] * u2**2 + m[1] * m[2] * u3**2 + m[0] * m[2] * (u2 + u3) ** 2
        centre = m @ v / m.sum()
        assert m @ v**2 == pytest.approx(m.sum() * centre**2 + relative / m.sum(), rel=1e-12)
    # The plotted curve, turned back into velocities: momentum and energy are those before.
    for angle in np.radians(np.arange(0, 360, 5)):
        radius = 1 / np.sqrt(1 + np.sin(angle) * np.cos(angle))
        u2, u3 = radius * np.cos(angle), radius * np.sin(angle)
        v3 = (1 - u2 - 2 * u3) / 3
        v = np.array([v3 + u3 + u2, v3 + u3, v3])
        assert v.sum() == pytest.approx(1, abs=1e-14)
        assert (v**2).sum() == pytest.approx(1, abs=1e-14)
    # The model's dots: on the curve, ordered from one end of the arc to the other.
    dots = [solve([1, 1, 1], [1, 0, 0], 1, f"0.{i}").velocities for i in range(6)]
    u2, u3 = np.array([[float(v[0] - v[1]), float(v[1] - v[2])] for v in dots]).T
    np.testing.assert_allclose(u2**2 + u2 * u3 + u3**2, 1, rtol=0, atol=1e-14)
    assert (np.diff(u2) < 0).all()
    assert (np.diff(u3) > 0).all()
    np.testing.assert_allclose([u2[0], u3[0], u2[-1], u3[-1]], [0, -1, -1, 0], rtol=0, atol=1e-14)


def test_a_light_middle_ball_meets_outcomes_more_than_once():
    """Masses 1, 1/2, 1: ratio 1/2 is one end of the arc, 2/3 the other; on the way some return."""

    def after(ratio):
        return [float(v) for v in solve([1, 0.5, 1], [1, 0, 0], 1, ratio).velocities]

    assert after(0.5) == pytest.approx([0, 0, 1], abs=1e-7)  # balls 1 and 2 together
    assert after(2 / 3) == pytest.approx([-0.2, 0.8, 0.8], abs=1e-7)  # balls 2 and 3
    same = brentq(lambda ratio: after(ratio)[0] - after(0.6)[0], 0.0, 0.5, xtol=1e-14)
    assert after(same) == pytest.approx(after(0.6), abs=1e-12)
    assert 0.6 - same > 0.3


def test_the_two_lines_of_the_second_closing_speed():
    """Equal balls: it rises to 2(1 - 2a)/(2 - a), and this line has the part 2a of compression."""
    for a in (0.1, 0.15, 0.25, 0.4):
        exact = solve([1, 1, 1], [1, 0, 0], 1, a)
        bend, turn = (1 + exact.events.index(k) for k in (("end", 0), ("maximum_compression", 1)))
        closing = [float(row[1] - row[2]) for row in exact.path]
        assert closing[0] == 0
        assert closing[bend] == pytest.approx(2 * (1 - 2 * a) / (2 - a), rel=1e-12)
        assert closing[turn] == pytest.approx(0, abs=1e-12)
        assert closing[-1] < 0
        impulses = [float(row[1]) for row in exact.path_impulses]
        assert impulses[bend] / impulses[turn] == pytest.approx(2 * a, rel=1e-12)


def test_fig_own_problem_definitions():
    """Energy left by three definitions of e = 1, in closed form (equal balls)."""
    for a in np.linspace(0, 0.499, 12):
        trace = collide(EQUAL, ImpulseCorrelation(a))
        left, right = trace.impulses
        row = 1 + trace.events.index(("maximum_compression", 1))
        compressed = trace.path_impulses[row, 1]

        def energy(right, left=left):
            return (1 - left) ** 2 + (left - right) ** 2 + right**2

        assert energy(2 * compressed) == pytest.approx((4 + a**2) / (2 - a) ** 2, rel=1e-13)
        assert energy(left / 2) == pytest.approx((2 + a**2) / (2 - a) ** 2, rel=1e-13)
        assert energy(right) == pytest.approx(1, rel=1e-13)
    assert READING.glued["problem-poisson-most"] == f"{(4 + 0.499**2) / (2 - 0.499) ** 2:.3f}"
    assert READING.glued["problem-newton-least"] == f"{2 / 4:.3f}"


def test_exercise_2_heavy_middle():
    rows = {
        line.split()[0]: [float(x) for x in line.split()[1:]]
        for line in READING.printed("problem-heavy").splitlines()[1:3]
    }
    for name, ratio in (("sequential", 0), ("between", 1 / 6)):
        v = [float(x) for x in solve([1, 2, 1], [1, 0, 0], 1, ratio).velocities]
        np.testing.assert_allclose(rows[name][1:4], v, rtol=0, atol=5e-5)


def test_what_the_rules_matter():
    """The table of the model's parts, by the reference solver and the textbook solver."""
    fig_8 = [1] * 4, [1, "0.5", 0, 0], 1, "0.1"

    def after(velocities=fig_8[1], **options):
        found = solve([1] * 4, velocities, 1, "0.1", number=float, **options)
        return np.array([float(v) for v in found.velocities])

    image = -after([0, 0, "-0.5", -1])[::-1]
    assert CHAPTER.glued["mirror"] == f"{abs(image - after()).max():.2f}"
    places = [after(meeting=x) for x in np.linspace(0, 1, 11).tolist()]
    assert number(CHAPTER.glued["meeting"]) == pytest.approx(np.ptp(places, 0).max(), abs=6e-4)
    read = [outcome(way).velocities for way in DRIVES]
    spread = np.ptp([[float(v) for v in velocities] for velocities in read], 0).max()
    assert CHAPTER.glued["readings"] == f"{spread:.2f}"
    ten = {}
    for name in paper_sequences():
        chain, model = paper_chain(name, excess="saturate")
        balls = list(chain.masses), list(chain.velocities), list(chain.restitution)
        found = [
            solve(*balls, model.forward, model.backward, meeting=x, excess="saturate", number=float)
            for x in (0.0, 0.5, 1.0)
        ]
        moved = np.ptp([[float(v) for v in one.velocities] for one in found], 0).max()
        ten[name] = moved, found[1].held
    assert number(CHAPTER.glued["meeting-ten"]) == pytest.approx(
        max(moved for moved, _ in ten.values()), rel=0.02
    )
    held = sum(bool(contacts) for _, contacts in ten.values())
    assert CHAPTER.glued["held"] == ["none", "one", "two", "three"][held]


DRIVES = ("forward", "backward"), ("forward", "forward"), ("backward", "backward")
