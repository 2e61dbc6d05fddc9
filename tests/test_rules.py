"""The named cases of the rules: R2 to R9, exact zeros, ties, and infinite sequences."""

from decimal import localcontext

import numpy as np
import pytest
from chains import local_orders
from delicate import CHAINS, chains_of, seen
from problem import Problem
from truth import meaning

from cradle import Chain, ImpulseCorrelation, collide, textbook


def solved(masses, velocities, restitution, forward, backward=None, **options):
    options.setdefault("excess", "saturate")
    model = ImpulseCorrelation(forward, backward, **options)
    return collide(Chain(masses, velocities, restitution), model)


def agrees(trace, atol=1e-13):
    """Compare with fifty digits (and in every event, if none collapsed); return that outcome."""
    with localcontext(prec=50):
        exact = Problem.of(trace.chain, trace.model).exact(1_000_000, number=meaning)
        after = [float(v) for v in exact.velocities]
        impulses = [float(p) for p in exact.impulses]
    np.testing.assert_allclose(trace.velocities, after, rtol=0, atol=atol)
    np.testing.assert_allclose(trace.impulses, impulses, rtol=0, atol=10 * atol)
    assert trace.collapsed == exact.collapsed
    if not exact.collapsed:
        contacts = len(after) - 1
        assert local_orders(trace.events, contacts) == local_orders(exact.events, contacts)
        assert trace.saturated == tuple(sorted(exact.held))
    return exact


def closings(trace):
    return [contact for kind, contact in trace.events if kind == "close"]


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


# --- R6: ratio zero ------------------------------------------------------------------------


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
        small = ([ratio or tiny for ratio in way] for way in (forward, backward))
        near = solved(*chain, *small).velocities
        assert np.abs(near - exact).max() < 30 * tiny
    agrees(solved(*chain, forward, backward))


# --- R7: the largest admissible ratio ------------------------------------------------------


def test_held_contact_moves_as_at_its_bound():
    at_bound = solved([1, 1, 1], [1, 0, 0], 0.7, 0.5)
    for ratio in (0.5000001, 0.6, 1.0):
        held = solved([1, 1, 1], [1, 0, 0], 0.7, ratio)
        assert held.saturated == (1,)
        assert held.velocities[1] == held.velocities[2]
        np.testing.assert_allclose(held.velocities, at_bound.velocities, rtol=0, atol=1e-15)
    assert at_bound.saturated == ()


# --- R8: runs that meet --------------------------------------------------------------------


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

# What a case may cost: far from `MAX_EVENTS`, and about what it costs today.


def test_chatter_beside_a_finite_closing_speed():
    """Contacts 0 and 1 collapse while contact 2 is still closing at a finite speed."""
    masses, velocities = [2, 0.1, 0.2, 5], [1, 0.5, 0, 0]
    trace = solved(masses, velocities, [0, 0.5, 0], [0.8, 0.1], [0.8, 1], max_events=1500)
    assert trace.collapsed
    first = next(row for row, event in enumerate(trace.events, 1) if event.kind == "collapse")
    assert {trace.events[first - 1].contact, trace.events[first].contact} == {0, 1}
    assert np.ptp(trace.path[first + 1, :3]) < 1e-12
    assert trace.path[first, 2] - trace.path[first, 3] > 0.1
    common = trace.chain.momentum / trace.chain.masses.sum()
    np.testing.assert_allclose(trace.velocities, common, rtol=0, atol=1e-13)


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


# --- one chain for one line, and for each case of a rule ----------------------------------


def test_simultaneous_events_of_one_run():
    """Ends and closings that fall together happen together, ends first, left to right."""
    trace = CHAINS["simultaneous events of one run"].problem.collide()
    assert trace.collisions.tolist() == agrees(trace).collisions


@pytest.mark.parametrize(("name", "problem"), seen(chains_of("one line of the solver")))
def test_delicate_chains(name, problem):
    """Collapsed ones against the sum of a great many impacts: the reference knows no cycles."""
    row = CHAINS[name.removesuffix(", mirrored")]
    trace = problem.collide(max_events=row.events)
    agrees(trace, atol=row.velocities)
    # Bounded work.  The order of simultaneous events has no mirror image, and with it the cycles.
    assert len(trace.events) < 5000


@pytest.mark.parametrize(
    ("before", "gap", "after"),
    [
        # Parts of the segments: (.05, .5) at contact 1, (.3, .3) at 3.  The larger one decides.
        ([10, 0, 1, 0, 0.6, -0.4], 3, [10, 0, 0.7, 0.3, 0.3, -0.1]),
        # (.4, .5) and (.5, .2): at a tie of the larger the smaller one.
        ([1.25, 0, 1, 0, 1, -1.5], 3, [1.25, 0, 0.5, 0.5, 0.5, -1]),
        # (.4, .5) and (.5, .4): at a tie of both the left gap.
        ([1.25, 0, 1, 0, 1, -0.25], 1, [0.75, 0.5, 0.5, 0.5, 1, -0.25]),
        # (.5, .05) and (.3, .3): the run between would pass ball 1 on its way; it goes alone.
        ([1, 0.9, 1, 0, 0.6, -0.4], 1, [1, 0.9, 0.9, 0.1, 0.6, -0.4]),
    ],
)
@pytest.mark.parametrize("by", ["the kernel", "the textbook"])
def test_of_several_gaps_the_first_one_reached_closes(by, before, gap, after):
    """R8.4: three pairs of equal elastic balls exchange velocities; the meetings by hand."""
    if by == "the textbook":
        found = textbook.solve([1] * 6, before, 1, 0.3)
        events, path = found.events, found.path
    else:
        found = solved([1] * 6, before, 1, 0.3)
        events, path = found.events, found.path
    at = [kind for kind, _ in events].index("close")
    assert events[at][1] == gap
    np.testing.assert_allclose(path[at + 1], after, rtol=0, atol=1e-14)


def test_light_striker_gives_all_its_momentum():
    """Velocities are counted from the heaviest ball: its own, small one keeps its digits."""
    after = solved([1e-12, 1, 1e-12], [1, 0, 0], [1, 1], 0).velocities
    assert after[1] == pytest.approx(2e-12 / (1 + 1e-12), rel=1e-14)
    after = solved([1e-12, 1], [1, 0], 0, []).velocities
    assert after[1] == pytest.approx(1e-12 / (1 + 1e-12), rel=1e-14)
