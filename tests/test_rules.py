"""The named cases of the rules: R2 to R9, exact zeros, ties, and infinite sequences."""

import mpmath
import numpy as np
import pytest
from chains import local_orders
from delicate import CHAINS, chains_of, seen
from truth import as_meant, solve

from cradle import Chain, ImpulseCorrelation, collide
from cradle.models.correlation import MAX_EVENTS


def solved(masses, velocities, restitution, forward, backward=None, **options):
    options.setdefault("excess", "saturate")
    model = ImpulseCorrelation(forward, backward, **options)
    return collide(Chain(masses, velocities, restitution), model)


def agrees(trace, atol=1e-13, **options):
    """Compare with fifty digits (and in every event, if none collapsed); return that outcome."""
    chain, model = trace.chain, trace.model
    parts = (chain.masses, chain.velocities, chain.restitution)
    with mpmath.workdps(50):
        exact = solve(
            *(part.tolist() for part in parts),
            model.forward,
            model.backward,
            meeting=model.meeting,
            excess="saturate",
            number=as_meant,
            **options,
        )
        after = [float(v) for v in exact.velocities]
        impulses = [float(p) for p in exact.impulses]
    np.testing.assert_allclose(trace.velocities, after, rtol=0, atol=atol)
    np.testing.assert_allclose(trace.impulses, impulses, rtol=0, atol=10 * atol)
    assert trace.collapsed == exact.collapsed
    if not exact.collapsed:
        contacts = len(after) - 1
        assert local_orders(trace.events, contacts) == local_orders(exact.events, contacts)
    return exact


def closings(trace):
    return [contact for kind, contact in trace.events if kind == "close"]


def common_velocity(trace):
    return trace.chain.momentum / trace.chain.masses.sum()


# --- R2, R3: start, end, recompression -----------------------------------------------------


@pytest.mark.parametrize(
    ("velocities", "impulses"),
    [
        ([1, 0, 0, 0, 0], [1, 0.2, 0.04, 0.008]),  # one source, driven forward
        ([2, 1.5, 1, 0.5, 0], [1, 0.2, 0.04, 0.008]),  # the leftmost approaching one is the source
        ([1, 1, 1, 0, 0], [0.09, 0.3, 1, 0.2]),  # contacts on its left at u = 0: driven backward
        ([1, 1, 0, 1, 0], [0.3, 1, 0, 1]),  # two touching stretches
        ([0, 0, 1, 0.9, 2], [0, 0, 1, 0]),  # a stretch that nothing approaches stays idle
        ([0, 0, 1, 1, 2], [0, 0, 0, 0]),
    ],
)
def test_start(velocities, impulses):
    """R2: what touches, and its impulses up to the first event, relative to those of the source."""
    trace = solved([1, 1.1, 0.9, 1.2, 1], velocities, 0.5, 0.2, 0.3)
    touching = trace.collisions - [closings(trace).count(c) for c in range(4)]
    np.testing.assert_array_equal(touching, np.array(impulses) > 0)
    if trace.events:
        agrees(trace)
        first = next(row for row in trace.path_impulses if row.any())
        for c in range(3):
            if impulses[c] and impulses[c + 1]:
                ratio = impulses[c + 1] / impulses[c]
                assert first[c + 1] == pytest.approx(ratio * first[c], rel=1e-14)


def test_recompression():
    """A contact in restitution is compressed again: the definition of its end holds for totals.

    Contact 1 is driven at a ratio between Eq. 34 and Eq. 53: it can open only while contact 2 is
    idle.  When contact 2 closes, contact 1 turns back into compression.
    """
    trace = solved([4, 1, 1, 5], [1, 0.5, 0, 0.01], [0.8, 1, 1], [0.7, 0.8], 0.1, excess="raise")
    exact = agrees(trace)
    assert exact.recompressions > 0
    assert [tuple(event) for event in trace.events] == exact.events
    kinds = [event.kind for event in trace.events if event.contact == 1]
    assert kinds[-4:] == ["close", "maximum_compression", "maximum_compression", "end"]
    np.testing.assert_allclose(trace.absorbed, [float(w) for w in exact.absorbed], atol=1e-14)
    loss = trace.chain.kinetic_energy - 0.5 * trace.chain.masses @ trace.velocities**2
    assert loss == pytest.approx(trace.energy_loss, rel=1e-13)


def test_plastic_contact_ends_at_zero_even_if_it_is_driven():
    """R3: e = 0 and u = 0 after compression is an end, and the speed there is an exact zero."""
    trace = solved([1, 1, 1], [1, 0.9, 0], [1, 0], 0.1)
    agrees(trace)
    ends = [row for row, event in enumerate(trace.events, 1) if tuple(event) == ("end", 1)]
    assert ends
    for row in ends:
        assert trace.path[row, 1] == trace.path[row, 2]
    assert trace.velocities[1] == trace.velocities[2]


# --- R6: ratio zero ------------------------------------------------------------------------


def test_ratio_zero_is_a_sequence_of_pairs():
    """Johnson's model: every pair by itself, the driver first."""
    rng = np.random.default_rng(6)
    for _ in range(20):
        m, e = np.sort(0.5 + 1.5 * rng.random(5))[::-1].copy(), rng.random(4)
        v = [1.0, 0.0, 0.0, 0.0, 0.0]
        for c in range(4):
            common = (m[c] * v[c] + m[c + 1] * v[c + 1]) / (m[c] + m[c + 1])
            u = v[c] - v[c + 1]
            v[c] = common - e[c] * u * m[c + 1] / (m[c] + m[c + 1])
            v[c + 1] = common + e[c] * u * m[c] / (m[c] + m[c + 1])
        if v == sorted(v):
            np.testing.assert_allclose(solved(m, [1, 0, 0, 0, 0], e, 0).velocities, v, atol=1e-15)


def test_equal_elastic_balls_at_ratio_zero_swap_velocities_exactly():
    trace = solved([1] * 7, [1] + [0] * 6, 1, 0)
    assert trace.velocities.tolist() == [0] * 6 + [1]
    assert trace.collisions.tolist() == [1] * 6


@pytest.mark.parametrize(
    ("forward", "backward"),
    [((0, 0.3, 0.4), (0.2, 0, 0.3)), ((0.3, 0, 0), (0, 0.4, 0)), ((0.3, 0, 0.2), (0, 0, 0.5))],
)
def test_some_ratios_zero_are_the_limit_of_small_ones(forward, backward):
    """All zero ratios of a run are one vanishing number."""
    chain = [1, 2, 1, 0.5, 1], [1, 0.3, 0, 0, -0.5], [0.5, 0.7, 0.9, 0.6]
    exact = solved(*chain, forward, backward).velocities
    for tiny in (1e-7, 1e-9):
        near = solved(
            *chain, [a or tiny for a in forward], [b or tiny for b in backward]
        ).velocities
        assert np.abs(near - exact).max() < 30 * tiny
    agrees(solved(*chain, forward, backward))


def test_vanishing_rates_keep_a_closing_run_from_stalling():
    """A gap driven from both sides at ratio zero: two vanishing factors in one run."""
    trace = solved([1, 2, 3, 1, 2, 1], [1, 0, -0.2, 0.3, 0, -1], 0.6, 0, 0)
    agrees(trace)


# --- R7: the largest admissible ratio ------------------------------------------------------


def test_held_contact_moves_as_at_its_bound():
    at_bound = solved([1, 1, 1], [1, 0, 0], 0.7, 0.5)
    for ratio in (0.5000001, 0.6, 1.0):
        held = solved([1, 1, 1], [1, 0, 0], 0.7, ratio)
        assert held.saturated == (1,)
        assert held.velocities[1] == held.velocities[2]
        np.testing.assert_allclose(held.velocities, at_bound.velocities, rtol=0, atol=1e-15)
    assert at_bound.saturated == ()


def test_mirrored_hold():
    """Backward, in a chain whose masses all differ: the mirror image of the forward one."""
    m, e, f, b = [1, 2, 0.7, 1.3], [0.4, 0.8, 0.6], [0.9, 0.8], [0.7, 1.0]
    one = solved(m, [1, 0, 0, 0], e, f, b)
    two = solved(m[::-1], [0, 0, 0, -1], e[::-1], b[::-1], f[::-1])
    np.testing.assert_allclose(one.velocities, -two.velocities[::-1], rtol=0, atol=1e-15)
    assert sorted(2 - c for c in two.saturated) == list(one.saturated)
    assert one.saturated
    agrees(one)
    agrees(two)


def test_bound_needs_the_ratio_in_force_of_the_next_contact():
    """Eq. 53 for four balls, both contacts held: the second at 1/2, the first at 1 / (2 - 1/2)."""
    held = solved([1] * 4, [1, 0, 0, 0], 1, [1.0, 1.0])
    assert held.saturated == (1, 2)
    at_bounds = solved([1] * 4, [1, 0, 0, 0], 1, [2 / 3, 1 / 2])
    np.testing.assert_allclose(held.velocities, [-0.5, 0.5, 0.5, 0.5], atol=1e-15)
    # An ulp of the ratio 2/3 releases a speed of the order of its square root.
    np.testing.assert_allclose(at_bounds.velocities, held.velocities, atol=3e-8)


def test_nominal_ratio_stays_in_force_while_a_contact_is_compressed():
    free = solved([1, 1, 1], [1, 0.5, 0], 0.7, 0.6, 0.1)
    assert free.saturated == ()
    agrees(free)
    bound = solved([1, 1, 1], [1, 0.5, 0], 0.7, 0.5, 0.1)
    assert np.abs(free.velocities - bound.velocities).max() > 0.01


# --- R8: runs that meet --------------------------------------------------------------------


def test_a_gap_beyond_closes_first():
    """R8.4: a run on its way to a meeting would pass its neighbour across the other gap."""
    trace = solved([0.25, 1, 2, 5, 0.5, 1], [0.3, 0.1, 0.3, -0.1, 0.1, -0.9], 1, 0.05)
    exact = agrees(trace)
    assert closings(trace) == [c for kind, c in exact.events if kind == "close"]
    # The gap that closes first: its balls have one velocity there, the other gap's have not.
    row, c = next((i, c) for i, (kind, c) in enumerate(trace.events, 1) if kind == "close")
    assert c in (1, 3)
    assert trace.path[row, c] == pytest.approx(trace.path[row, c + 1], abs=1e-15)
    other = 4 - c
    assert trace.path[row, other] < trace.path[row, other + 1] - 0.01


def test_generic_tie_of_two_gaps_takes_the_left():
    """A mirror-symmetric chain: both gaps are reached at the same fractions."""
    trace = solved([1] * 6, [3, -0.5, 1.3, -1.3, 0.5, -3], 1, 0.1)
    assert closings(trace)[:2] == [1, 3]
    agrees(trace)


#: Chains whose gaps tie in the larger part, and the contact that closes first.
TIED = [
    (3, [0.5, 1, 0.5, 1, 1, 1], [0.9, -0.4, 0, -0.4, -0.2, -0.8], 0.5, [0.2, 0.1, 0.2, 0.1]),
    (1, [0.5, 1, 2, 2, 1, 1], [0.7, 0.4, 0.8, -0.3, 0.3, -0.2], [0.3, 0.3, 1, 0.5, 0.3],
     [0.2, 0.2, 0.2, 0.1]),
    (3, [1, 1, 1, 1, 2, 1], [0.7, 0.4, 0.9, -0.4, 0.1, -0.7], [1, 0.3, 0.7, 0.3, 0.7],
     [0, 0.1, 0, 0]),
    (1, [2, 0.5, 2, 0.5, 1, 1], [1, 0.3, 0.8, -0.4, 0.5, 0.3], [0.5, 0.5, 0.7, 0.7, 1],
     [0, 0.2, 0.2, 0.1]),
]  # fmt: skip


@pytest.mark.parametrize(("first", *"mvef"), TIED)
def test_generic_ties_of_the_key_are_broken_by_the_smaller_fraction(first, m, v, e, f):
    """A sweep wholly inside the overlap uses one half, give or take an ulp: not the ulp decides."""
    trace = solved(m, v, e, f)
    assert closings(trace)[0] == first
    agrees(trace)


@pytest.mark.parametrize("meeting", [0.0, 0.25, 0.5, 1.0])
def test_meeting_at_a_part_of_the_overlap(meeting):
    trace = solved([1, 2, 1.5, 1], [1, 0.2, 0.4, -0.7], [0.6, 0.8, 0.7], 0.2, meeting=meeting)
    agrees(trace)
    assert 1 in closings(trace)
    row = 1 + [tuple(event) for event in trace.events].index(("close", 1))
    assert trace.path[row, 1] == pytest.approx(trace.path[row, 2], abs=1e-15)


@pytest.mark.parametrize(("right", "first"), [(0.05, 2), (0.1, 1), (0.2, 1)])
def test_double_closing_on_one_free_ball(right, first):
    """R8.6: the contact with the smaller |u| closes, at a tie the left one; then the other."""
    trace = solved([1] * 5, [1, -0.1, 0, right, right - 1.1], 1, 0.1)
    assert [tuple(event) for event in trace.events[:2]] == [("close", first), ("close", 3 - first)]
    agrees(trace)


def test_simultaneous_events_of_one_run():
    """Ends and closings that fall together happen together, ends first, left to right."""
    trace = solved(
        [1] * 6,
        [0.3368969063278493, 0.2984461343315177, -0.1368896946451319, -0.4885487538060256,
         -0.7535367500934445, -0.8269642864891671],
        [0, 0.2097089174928406, 0.6868527351583686, 1, 0.17931666669551816],
        [0.25, 0, 0, 0], [0.25, 4 / 7, 0.35, 0],
    )  # fmt: skip
    exact = agrees(trace)
    assert trace.collisions.tolist() == exact.collisions


def test_simultaneous_closings_of_two_runs_on_one_ball():
    """Contacts 0, 2 and 3 close at once; 2 and 3 share a ball: the left one, then 3 as a gap."""
    trace = solved(
        [1] * 6,
        [0.5, 1, 0, 0.5, 1, -1],
        [0.0625, 0.75, 0.5, 0.125, 0.25],
        [0.5, 1, 0.75, 1],
        [1, 1, 0, 0],
    )
    assert closings(trace)[:3] == [0, 2, 3]
    agrees(trace)


def test_stale_event():
    """An event planned in one round must not survive into the next one."""
    trace = solved(
        [2, 1, 2, 2, 0.5, 2],
        [1, 0, 0, 0, 0, 0],
        [0.72368002062462, 0.39290544273442396, 0.972099177841234, 0.9406130296630135,
         0.6705955385404143],
        [0, 0.25, 0, 0.4],
        [1 / 3, 0, 0.05, 0.40404040404040403],
    )  # fmt: skip
    exact = agrees(trace)
    assert trace.collisions.tolist() == exact.collisions


def test_exact_zeros():
    """Closing speeds that are zero by construction are zero in the path, to the last bit."""
    trace = solved([1, 3, 0.7, 1.9], [0.7, 0.1, 0, 0.2], [0, 0.5, 0], [0.3, 1.0], 0.2)
    zeros = 0
    for row, (kind, c) in enumerate(trace.events, 1):
        if kind in ("maximum_compression", "close", "collapse") or trace.chain.restitution[c] == 0:
            assert abs(trace.path[row, c] - trace.path[row, c + 1]) <= 2**-52
            zeros += 1
    assert zeros > 3
    agrees(trace)


# --- R9: infinite sequences ----------------------------------------------------------------

#: What a case of R9 may cost: far from `MAX_EVENTS`, and about what it costs today.
BOUNDED = {"plastic": 400, "chatter": 1500, "nested": 20_000}


def test_three_equal_plastic_balls_at_ratio_zero():
    trace = solved([1, 1, 1], [1, 0, 0], 0, 0, max_events=BOUNDED["plastic"])
    np.testing.assert_allclose(trace.velocities, [1 / 3] * 3, rtol=0, atol=1e-15)
    assert trace.collapsed
    assert trace.events[-1].kind == "collapse"
    assert len(trace.events) < BOUNDED["plastic"]
    assert trace.energy_loss == pytest.approx(0.5 - 1 / 6, rel=1e-12)


def test_collapse_of_a_part_of_the_chain():
    """Three balls collapse; a fourth flies off, and the collapsed ones keep their momentum."""
    trace = solved([1, 1, 1, 0.5], [1, 0, 0, -0.3], [0, 0, 1], 0)
    agrees(trace, atol=1e-12)
    assert trace.collapsed
    assert np.ptp(trace.velocities[:3]) < 1e-12
    assert trace.velocities[3] > trace.velocities[2] + 0.01


def test_chatter_beside_a_finite_closing_speed():
    """Contacts 0 and 1 collapse while contact 2 is still closing at a finite speed."""
    trace = solved(
        [2, 0.1, 0.2, 5], [1, 0.5, 0, 0], [0, 0.5, 0], [0.8, 0.1], [0.8, 1],
        max_events=BOUNDED["chatter"],
    )  # fmt: skip
    assert trace.collapsed
    first = next(row for row, event in enumerate(trace.events, 1) if event.kind == "collapse")
    assert {trace.events[first - 1].contact, trace.events[first].contact} == {0, 1}
    assert np.ptp(trace.path[first + 1, :3]) < 1e-12
    assert trace.path[first, 2] - trace.path[first, 3] > 0.1
    np.testing.assert_allclose(trace.velocities, common_velocity(trace), rtol=0, atol=1e-13)
    assert len(trace.events) < BOUNDED["chatter"]


def test_nested_infinite_sequences():
    """Inside every cycle of the outer sequence the first three contacts collapse on their own."""
    trace = solved(
        [1] * 6,
        [1, 0, 0, 0, 0, 0],
        0,
        [0.967963550258582, 0.04515107491767867, 0.23414204067392064, 0.40810942738654143],
        [0.20344454463172412, 0.5687905977876264, 0.927494733732026, 0.17420000215542086],
        max_events=BOUNDED["nested"],
    )
    assert trace.collapsed
    np.testing.assert_allclose(trace.velocities, [1 / 6] * 6, rtol=0, atol=1e-12)


def test_energy_stored_at_zero_speeds_is_no_collapse():
    trace = solved([1, 1, 1], [1, 0, 0.5], 1, 0.1)
    assert not trace.collapsed
    np.testing.assert_allclose(trace.velocities, [-0.012989, 0.527079, 0.985910], atol=5e-7)
    agrees(trace)


@pytest.mark.parametrize("part", [0.99, 0.9999])
@pytest.mark.parametrize("n", [8, 14])
def test_long_elastic_chains_near_the_bound_are_no_collapse(n, part):
    ratios = [0.0] * (n - 2)
    ahead = 0.0
    for i in reversed(range(n - 2)):
        ahead = ratios[i] = part / (2 - ahead)
    trace = solved([1] * n, [1] + [0] * (n - 1), 1, ratios, ratios[::-1], excess="raise")
    assert not trace.collapsed
    assert trace.velocities @ trace.velocities == pytest.approx(1, rel=1e-12)


def test_elastic_contacts_collapse_that_hand_all_on():
    """The energy of contacts 0 and 1 goes to the other balls, in ever smaller impacts."""
    trace = solved(
        [2.5021848346921316, 1.3574673914357485, 1.1197551592532815, 0.35804618973182,
         1.0198307769596067],
        [0.889667280467545, 0.7944637154730001, 0.07766588435969313, -0.4510122456259009,
         -0.9600277803776842],
        1,
        [0.6229343161288279, 0.5271759874715203, 0.7253435434226518],
        [0.6353269658334868, 0.7533747175642618, 0.9083667265782066],
    )  # fmt: skip
    assert trace.collapsed
    agrees(trace)
    energy = 0.5 * trace.chain.masses @ trace.velocities**2
    assert energy == pytest.approx(trace.chain.kinetic_energy, rel=1e-12)


def test_default_limit_is_far_above_what_these_cases_need():
    assert max(BOUNDED.values()) < MAX_EVENTS / 100


# --- one chain for one line ---------------------------------------------------------------


@pytest.mark.parametrize(("name", "problem"), seen(chains_of("one line of the solver")))
def test_delicate_chains(name, problem):
    """Collapsed ones against the sum of a great many impacts: the reference knows no cycles."""
    trace = problem.collide()
    agrees(trace, atol=CHAINS[name.removesuffix(", mirrored")].velocities)
    # Bounded work.  The order of simultaneous events has no mirror image, and with it the cycles.
    assert len(trace.events) < 5000


def test_small_ratios_are_not_zero():
    """Products of ratios down to 1e-12 act, each in its digit."""
    chain = [1, 2, 0.7, 1.3, 1.1], [1, 0.4, 0.3, 0.1, 0], [0.5, 0.8, 0.9, 0.7]
    small = solved(*chain, 1e-4)
    agrees(small, atol=1e-15)
    none = solved(*chain, [1e-4, 1e-4, 0], 1e-4)
    assert 1e-14 < np.abs(small.velocities - none.velocities).max() < 1e-3


def test_light_striker_gives_all_its_momentum():
    """Velocities are counted from the heaviest ball: its own, small one keeps its digits."""
    after = solved([1e-12, 1, 1e-12], [1, 0, 0], [1, 1], 0).velocities
    assert after[1] == pytest.approx(2e-12 / (1 + 1e-12), rel=1e-14)
    after = solved([1e-12, 1], [1, 0], 0, []).velocities
    assert after[1] == pytest.approx(1e-12 / (1 + 1e-12), rel=1e-14)
