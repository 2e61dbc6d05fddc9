"""What must hold for the independent solver itself, before anything is compared with it."""

import random
from functools import partial

import mpmath
import pytest
from chains import FIG_8, changes
from reference import EventLimit, Impact, solve

solve_float = partial(solve, number=float)


@pytest.fixture(autouse=True)
def fifty_digits():
    with mpmath.workdps(50):
        yield


def random_chain(rng, size=None):
    """A chain within the bounds, often with e or a ratio at the ends of its range."""
    n = size or rng.randint(2, 6)
    decades = rng.choice([0, 1, 2])
    masses = [10 ** rng.uniform(-decades / 2, decades / 2) for _ in range(n)]
    speed = rng.choice(
        [
            lambda: [1.0] + [0.0] * (n - 1),
            lambda: sorted((rng.uniform(-1, 1) for _ in range(n)), reverse=True),
            lambda: [rng.uniform(-1, 1) for _ in range(n)],
            lambda: [rng.choice([0.0, 0.0, 1.0, 0.5, -1.0]) for _ in range(n)],
        ]
    )
    e = rng.choice([lambda: 0.0, lambda: 1.0, rng.random, lambda: rng.choice([0.0, 1.0, 0.4])])
    part = rng.choice([lambda: 0.0, lambda: 1.0, rng.random, lambda: rng.choice([0.0, 1.0, 0.6])])
    return masses, speed(), [e() for _ in range(n - 1)], *within_bounds(masses, part)


def within_bounds(masses, part):
    """Forward and backward ratios as parts of their bounds, Eq. 53 and its mirror."""
    forward, ahead = [], 0.0
    for here, beyond in reversed(list(zip(masses[1:], masses[2:]))):
        ahead = part() * beyond / (beyond + here * (1 - ahead))
        forward.insert(0, ahead)
    backward, behind = [], 0.0
    for beyond, here in zip(masses[:-2], masses[1:-1]):
        behind = part() * beyond / (beyond + here * (1 - behind))
        backward.append(behind)
    return forward, backward


def check_invariants(masses, velocities, restitution, outcome, tolerance):
    """Momentum, exact energy ledger, impulses, order, and no idle contact ever overlapping."""
    after = outcome.velocities
    speed = max(abs(v) for v in velocities) or 1
    momentum = sum(m * speed for m in masses)
    for i, m in enumerate(masses):
        left = outcome.impulses[i - 1] if i > 0 else 0
        right = outcome.impulses[i] if i < len(masses) - 1 else 0
        assert abs(m * (after[i] - velocities[i]) - (left - right)) <= tolerance * momentum
    loss = sum(m * (v - w) * (v + w) / 2 for m, v, w in zip(masses, velocities, after))
    ledger = sum((1 - e * e) * w for e, w in zip(restitution, outcome.absorbed))
    assert abs(loss - ledger) <= tolerance * momentum * speed
    assert loss >= -tolerance * momentum * speed
    assert all(a - b <= tolerance * speed for a, b in zip(after, after[1:]))
    for before, now in zip(outcome.path_impulses, outcome.path_impulses[1:]):
        assert all(b >= a - tolerance * momentum for a, b in zip(before, now))
    idle = {c for c, (a, b) in enumerate(zip(velocities, velocities[1:])) if a < b}
    idle |= idle_stretches(velocities)
    for (kind, c), v in zip(outcome.events, outcome.path[1:]):
        if kind == "close":
            idle.discard(c)
        elif kind in ("end", "collapse"):
            idle.add(c)
        if kind != "maximum_compression":  # there one run may be ahead of the other
            assert all(v[c] - v[c + 1] <= tolerance * speed for c in idle)
    assert len(idle) == len(masses) - 1


def idle_stretches(velocities):
    """Contacts of touching stretches in which nothing approaches."""
    rest, stretch = set(), []
    closing = [a - b for a, b in zip(velocities, velocities[1:])]
    for c, u in [*enumerate(closing), (None, -1)]:
        if u >= 0:
            stretch.append(c)
        else:
            if all(closing[k] == 0 for k in stretch):
                rest |= set(stretch)
            stretch = []
    return rest


# --- invariants ----------------------------------------------------------------------------


@pytest.mark.parametrize("excess", ["raise", "saturate"])
def test_invariants_of_random_chains(excess):
    rng = random.Random(2001)
    seen = {"meetings": 0, "held": 0, "collapsed": 0, "finished": 0}
    for _ in range(400):
        masses, velocities, restitution, forward, backward = random_chain(rng)
        if excess == "saturate":
            forward = [rng.choice([0.0, 1.0, rng.random()]) for _ in forward]
            backward = [rng.choice([0.0, 1.0, rng.random()]) for _ in backward]
        try:
            outcome = solve_float(
                masses, velocities, restitution, forward, backward, excess=excess, max_events=20000
            )
        except EventLimit:
            continue
        check_invariants(masses, velocities, restitution, outcome, 1e-11)
        seen["finished"] += 1
        seen["meetings"] += outcome.meetings > 0
        seen["held"] += bool(outcome.held)
        seen["collapsed"] += outcome.collapsed
    assert seen["finished"] > 390
    assert min(seen.values()) > 10, seen  # the sample reaches every rule


def test_invariants_in_fifty_digits_and_float_agrees():
    rng = random.Random(575)
    same = 0
    for _ in range(40):
        chain = random_chain(rng, size=rng.randint(3, 5))
        try:
            plain = solve_float(*chain, max_events=2000)
        except EventLimit:
            continue
        exact = solve(*chain, excess="saturate")  # a rounded bound may lie an ulp above the bound
        tolerance = mpmath.mpf(10) ** (-28 if exact.collapsed else -45)
        masses, velocities, restitution = ([mpmath.mpf(x) for x in part] for part in chain[:3])
        check_invariants(masses, velocities, restitution, exact, tolerance)
        if not exact.collapsed and plain.events == exact.events:
            same += 1
            assert plain.velocities == pytest.approx(list(map(float, exact.velocities)), abs=1e-11)
    assert same > 20


def test_mirrored_single_striker():
    # Strictly inside the ranges: at an exact tie "the left one first" is not symmetric.
    rng = random.Random(68)
    met = 0
    for _ in range(150):
        n = rng.randint(3, 6)
        masses = [rng.uniform(0.3, 3) for _ in range(n)]
        velocities = [1.0] + [0.0] * (n - 1)
        restitution = [rng.uniform(0.2, 1) for _ in range(n - 1)]
        forward, backward = within_bounds(masses, partial(rng.uniform, 0.05, 0.95))
        meeting = rng.choice([0.0, 0.5, 0.5, 1.0, rng.random()])
        one = solve_float(masses, velocities, restitution, forward, backward, meeting=meeting)
        two = solve_float(
            masses[::-1],
            [-v for v in velocities[::-1]],
            restitution[::-1],
            backward[::-1],
            forward[::-1],
            meeting=1 - meeting,
        )
        met += one.meetings > 0
        assert one.velocities == pytest.approx([-v for v in two.velocities[::-1]], abs=1e-10)
    assert met > 20


def test_boost_and_units():
    rng = random.Random(583)
    for _ in range(60):
        n = rng.randint(3, 5)
        masses = [rng.uniform(0.3, 3) for _ in range(n)]
        velocities = [rng.uniform(-1, 1) for _ in range(n)]
        restitution = [rng.uniform(0.2, 1) for _ in range(n - 1)]
        ratios = within_bounds(masses, partial(rng.uniform, 0.05, 0.95))
        one = solve_float(masses, velocities, restitution, *ratios)
        two = solve_float(
            [1000 * m for m in masses], [3 * v + 0.25 for v in velocities], restitution, *ratios
        )
        expected = [3 * v + 0.25 for v in one.velocities]
        assert two.velocities == pytest.approx(expected, abs=1e-10)


# --- three balls, closed form --------------------------------------------------------------


def test_closed_form_of_three_balls():
    """Eqs. 24, 30-33 for chains with one collision per contact, all but one ball at rest."""
    rng = random.Random(24)
    checked = 0
    while checked < 60:
        m1, m2, m3 = (mpmath.mpf(rng.uniform(0.2, 4)) for _ in range(3))
        e2, e3 = (mpmath.mpf(rng.uniform(0.3, 1)) for _ in range(2))
        a = rng.random() * m3 / (m2 + m3)
        outcome = solve([m1, m2, m3], [1, 0, 0], [e2, e3], a, 0)
        if outcome.collisions != [1, 1]:
            continue
        first = (1 + e2) * m1 * m2 / ((1 - a) * m1 + m2)
        root = mpmath.sqrt(1 - a * (m2 / m3 + 1))
        second = (1 + e3 * root) * (1 + e2) * m1 * m2 * m3 / (((1 - a) * m1 + m2) * (m2 + m3))
        assert abs(outcome.impulses[0] - first) < 1e-45
        assert abs(outcome.impulses[1] - second) < 1e-45
        checked += 1


@pytest.mark.parametrize("r2", ["0.3", "1", "2"])
def test_equation_44_separates_one_collision_per_contact(r2):
    a, e, r2 = mpmath.mpf("0.15"), mpmath.mpf("0.5"), mpmath.mpf(r2)
    edge = (1 + e) * (1 + e * mpmath.sqrt(1 - a * (1 + r2))) / (e * (1 + r2)) - (1 + a / e)

    def collisions(r1):
        return solve([1, r1, r1 / r2], [1, 0, 0], e, a).collisions

    step = mpmath.mpf(10) ** -20
    assert collisions(edge + step) == [1, 1]
    assert collisions(edge - step)[0] > 1


def test_figure_4_ends():
    sequential = solve([1, 1, 1], [1, 0, 0], 1, 0)
    assert sequential.velocities == [0, 0, 1]
    together = solve([1, 1, 1], [1, 0, 0], 1, "0.5")
    expected = [-mpmath.mpf(1) / 3, mpmath.mpf(2) / 3, mpmath.mpf(2) / 3]
    assert max(abs(a - b) for a, b in zip(together.velocities, expected)) < 1e-45


def test_figure_5_sequence():
    outcome = solve([1, 1, 1], [1, "0.8", 0], "0.2", "0.1")
    assert changes(outcome.events) == [
        ("end", 0),
        ("close", 0),
        ("end", 1),
        ("close", 1),
        ("end", 0),
        ("end", 1),
    ]


def test_figure_7_digits():
    outcome = solve([1, "0.01", 1], [1, 0, 0], 1, "0.15")
    assert [mpmath.nstr(v, 3) for v in outcome.velocities] == ["-0.00287", "0.347", "0.999"]
    # The middle ball hangs on the last digits of the input: 6e-5 more ratio give the printed .348.
    nudged = solve([1, "0.01", 1], [1, 0, 0], 1, "0.15006")
    assert mpmath.nstr(nudged.velocities[1], 3) == "0.348"


def test_figure_8_sequence():
    outcome = solve([1] * 4, [1, "0.5", 0, 0], 1, "0.1")
    assert changes(outcome.events) == FIG_8
    assert outcome.meetings == 1
    row = outcome.events.index(("close", 1)) + 1
    assert outcome.path[row][1] == pytest.approx(outcome.path[row][2], abs=1e-45)


# --- R7 ------------------------------------------------------------------------------------

ABCCA = (
    ["0.045", "0.053", "0.053", "0.053", "0.045"],
    [1, 0, 0, 0, 0],
    ["0.53", "0.28", "0.27", "0.31"],
    ["0.111", "0.319", "0.462"],
    ["0.435", "0.414", "0.262"],
)


def test_abcca_is_above_its_bound():
    with pytest.raises(ValueError, match=r"forward\[2\] = 0\.462; bound at ball 3 is 0\.4591836"):
        solve(*ABCCA)
    outcome = solve(*ABCCA, excess="saturate")
    assert outcome.held == {3}
    assert outcome.velocities[3] == pytest.approx(outcome.velocities[4], abs=1e-45)


def test_hold_is_the_limit_of_chatter():
    """A held contact moves as at its bound, whatever the nominal ratio above it."""
    at_bound = solve([1, 1, 1], [1, 0, 0], "0.7", "0.5")
    for ratio in ("0.6", "1"):
        above = solve([1, 1, 1], [1, 0, 0], "0.7", ratio, excess="saturate")
        assert above.held == {1}
        assert max(abs(a - b) for a, b in zip(above.velocities, at_bound.velocities)) < 1e-45
    assert at_bound.held == set()


def test_compressed_contact_is_not_held():
    """While u > 0 the nominal ratio stays in force."""
    free = solve([1, 1, 1], [1, "0.5", 0], "0.7", "0.6", "0.1", excess="saturate")
    assert free.held == set()
    at_bound = solve([1, 1, 1], [1, "0.5", 0], "0.7", "0.5", "0.1")
    assert max(abs(a - b) for a, b in zip(free.velocities, at_bound.velocities)) > 0.01


# --- R8 ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("right", "first"), [("0.1", 1), ("0.05", 2), ("0.2", 1)])
def test_double_closing_on_one_free_ball(right, first):
    """R8.6: the contact with the smaller |u| closes, at a tie the left one."""
    right = mpmath.mpf(right)
    velocities = [1, mpmath.mpf("-0.1"), 0, right, right - mpmath.mpf("1.1")]
    outcome = solve([1] * 5, velocities, 1, "0.1")
    # The other contact is then a gap at u = 0, and closes as such.
    assert outcome.events[:2] == [("close", first), ("close", 3 - first)]
    check_invariants([1] * 5, velocities, [1] * 4, outcome, mpmath.mpf(10) ** -45)


def test_generic_tie_of_two_gaps_takes_the_left():
    """A mirror-symmetric chain: both gaps are met at the same fractions."""
    masses, velocities = [1] * 6, [3, "-0.5", "1.3", "-1.3", "0.5", -3]
    outcome = solve(masses, velocities, 1, "0.1")
    closed = [c for kind, c in outcome.events if kind == "close"]
    assert closed[:2] == [1, 3]
    check_invariants(
        masses, [mpmath.mpf(v) for v in velocities], [1] * 5, outcome, mpmath.mpf(10) ** -45
    )


def test_meeting_reaches_both_ends_of_the_overlap():
    rows = []
    for meeting in ("0", "0.5", "1"):
        outcome = solve([1] * 4, [1, "0.5", 0, 0], 1, "0.1", meeting=meeting)
        check_invariants(
            [1] * 4, [1, mpmath.mpf("0.5"), 0, 0], [1] * 3, outcome, mpmath.mpf(10) ** -45
        )
        rows.append(outcome.path[outcome.events.index(("close", 1)) + 1][1])
    assert rows[0] < rows[1] < rows[2]
    assert abs(rows[1] - (rows[0] + rows[2]) / 2) < 1e-45


def test_gap_beyond_closes_first_when_a_run_would_pass_it(monkeypatch):
    """R8.4, a rare case: the pair that was to meet stays apart for the moment."""
    beyond = []
    original = Impact.passed_on_the_way

    def watch(self, g, parts, left, right):
        found = original(self, g, parts, left, right)
        if found:
            beyond.append((len(self.events), g, found[1]))
        return found

    monkeypatch.setattr(Impact, "passed_on_the_way", watch)
    masses, velocities = [0.25, 1, 2, 5, 0.5, 1], [0.3, 0.1, 0.3, -0.1, 0.1, -0.9]
    outcome = solve_float(masses, velocities, 1, 0.05)
    assert beyond
    before, waiting, closed = beyond[0]
    later = [c for kind, c in outcome.events[before:] if kind == "close"]
    assert abs(waiting - closed) == 2
    assert later[0] == closed
    check_invariants(masses, velocities, [1] * 5, outcome, 1e-11)


# --- R9 ------------------------------------------------------------------------------------


def test_energy_stored_at_zero_speeds_is_no_collapse():
    outcome = solve([1, 1, 1], [1, 0, "0.5"], 1, "0.1")
    assert [mpmath.nstr(v, 5) for v in outcome.velocities] == ["-0.012989", "0.52708", "0.98591"]
    assert not outcome.collapsed


@pytest.mark.parametrize(
    ("masses", "e", "ratio"), [([1, 1, 1], 0, 0), ([1, "0.01", 1], "0.5", "0.15")]
)
def test_infinite_sequences_end_with_the_common_velocity(masses, e, ratio):
    outcome = solve(masses, [1, 0, 0], e, ratio)
    common = 1 / sum(mpmath.mpf(m) for m in masses)
    assert outcome.collapsed
    assert max(abs(v - common) for v in outcome.velocities) < 1e-29


CHATTER = ([2, "0.1", "0.2", 5], [1, "0.5", 0, 0], [0, "0.5", 0], ["0.8", "0.1"], ["0.8", 1])


def test_chatter_beside_a_finite_closing_speed():
    outcome = solve(*CHATTER, excess="saturate")
    first = next(i for i, (kind, _) in enumerate(outcome.events) if kind == "collapse")
    before = outcome.path[first]
    assert outcome.events[first : first + 2] == [("collapse", 0), ("collapse", 1)]
    assert abs(before[0] - before[1]) < 1e-29
    assert before[2] - before[3] > 0.1
    common = mpmath.mpf("2.05") / mpmath.mpf("7.3")
    assert max(abs(v - common) for v in outcome.velocities) < 1e-29


def test_threshold_is_a_limit():
    """Ten digits less in the threshold move the outcome by no more than the threshold."""
    near = solve(*CHATTER, excess="saturate", collapse_below=mpmath.mpf(10) ** -20)
    far = solve(*CHATTER, excess="saturate")
    assert len(near.events) < len(far.events)
    assert max(abs(a - b) for a, b in zip(near.velocities, far.velocities)) < 1e-19


def test_nested_infinite_sequence_ends():
    """Inside every cycle of the outer sequence the first three contacts collapse on their own."""
    forward = [0.967963550258582, 0.04515107491767867, 0.23414204067392064, 0.40810942738654143]
    backward = [0.20344454463172412, 0.5687905977876264, 0.927494733732026, 0.17420000215542086]
    outcome = solve_float([1] * 6, [1, 0, 0, 0, 0, 0], 0, forward, backward, excess="saturate")
    assert outcome.collapsed
    assert outcome.velocities == pytest.approx([1 / 6] * 6, abs=1e-12)


def test_long_elastic_chain_near_the_bound_is_not_collapsed():
    n = 14
    forward, backward = within_bounds([1.0] * n, lambda: 0.999)
    outcome = solve_float([1] * n, [1] + [0] * (n - 1), 1, forward, backward)
    assert not outcome.collapsed
    assert sum(v * v for v in outcome.velocities) == pytest.approx(1, abs=1e-12)


def test_elastic_light_middle_ball_is_finite():
    """Of the order of sqrt(heavy / light) impacts, none of them a collapse."""
    counts = [
        sum(solve_float([1, light, 1], [1, 0, 0], 1, 0).collisions) for light in (1e-2, 1e-4, 1e-6)
    ]
    for few, many in zip(counts, counts[1:]):
        assert 8 < many / few < 12


# --- input ---------------------------------------------------------------------------------


def test_nothing_happens_without_approach():
    outcome = solve([1, 1, 1], [0, 0, 1], 1, "0.1")
    assert outcome.velocities == [0, 0, 1]
    assert outcome.events == []


def test_event_limit_reports_what_was_reached():
    with pytest.raises(EventLimit) as caught:
        solve_float([1, 1e-6, 1], [1, 0, 0], 1, 0, max_events=100)
    assert len(caught.value.outcome.events) > 100


@pytest.mark.parametrize("ratio", ["-0.1", "1.1"])
def test_ratio_outside_its_range(ratio):
    with pytest.raises(ValueError, match=r"\[0, 1\]"):
        solve([1, 1, 1], [1, 0, 0], 1, ratio, excess="saturate")
