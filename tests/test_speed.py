"""Speed, without a stopwatch: how much work an impact is, how much memory a batch takes.

Times differ between machines and moments; the work does not.  The event loop counts the contacts
whose rates it works out (`effort`), its rounds and its events.
"""

import math
import os
import threading
import tracemalloc

import families
import numpy as np
import pytest
from chains import magnitudes, uniform
from delicate import CHAINS, chains_of
from extreme_chains import sequence
from kernels import needs_numba
from plain import solve as solved

from cradle import ImpactNotFinished, outcomes, post_impact_velocities
from cradle.kernel.state import FINISHED, LIMITS
from cradle.models import batch
from cradle.runtime import compile as runtime


@pytest.fixture(autouse=True)
def compiled(monkeypatch):
    """Batches here are large enough to be compiled for."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")


def solve(m, v, e, forward, backward=None, **limits):
    """Solve one impact by the plain kernel, with other limits."""
    found = solved(m, v, e, forward, backward, **limits)
    assert found.status == FINISHED
    return found


def struck(n):
    """Equal balls, of which the first strikes the others."""
    return [1.0] * n, families.struck(n)


# Chain -> events, rounds and effort when last measured.  Events are facts of the chain.  Rounds and
# effort may only become less; a change that needs more of them for a reason writes its own numbers
# here, and the reason into the commit.
MEASURED = {
    "three equal": ((*struck(3), 1.0, 0.167), (2, 2, 5)),
    "five equal": ((*struck(5), 1.0, 0.167), (4, 4, 14)),
    "light middle": (([1.0, 0.01, 1.0], [1.0, 0.0, 0.0], 1.0, 0.167), (38, 56, 131)),
    "ABCCA": (sequence("ABCCA")[:5], (6, 7, 25)),
    "BCACBA": (sequence("BCACBA")[:5], (27, 32, 146)),
    "two strike two": (([1.0] * 4, [1.0, 0.5, 0.0, 0.0], 1.0, 0.1), (7, 8, 27)),
    "from both sides": (([1.0] * 9, [1.0, *[0.0] * 7, -0.7], 0.8, 0.2), (62, 66, 440)),
    "twenty, losses": ((*struck(20), 0.9, 0.1), (285, 210, 2270)),
    "a collapse": (([1.0] * 3, [1.0, 0.0, 0.0], 0.05, 0.1), (37, 52, 124)),
    "a hundred": ((*struck(100), 1.0, 0.3), (99, 99, 4643)),
}


@pytest.mark.parametrize("name", MEASURED)
def test_no_more_work_than_measured(name):
    chain, (events, rounds, effort) = MEASURED[name]
    found = solve(*chain)
    assert found.events == events
    assert 0 < found.rounds <= rounds
    assert 0 < found.effort <= effort
    # It is the package's own loop that was counted.
    m, v, e, forward, *backward = chain
    after = outcomes(m, v, e, forward, *backward, excess="saturate")
    assert after.collisions.tolist() == found.collisions
    np.testing.assert_allclose(after.velocities, found.velocities, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", chains_of("cycles taken at once"))
def test_cycles_taken_at_once_are_those_made_one_by_one(name):
    """Light balls between heavy ones that meet a third, or are driven by one meanwhile."""
    chain = CHAINS[name].problem[:5]
    fast, slow = solve(*chain), solve(*chain, many=math.inf)
    assert fast.rounds < 0.5 * slow.rounds
    # All that were taken at once are counted; how many come after, before the limit, is chance:
    # it is looked for at every sixteenth end.
    assert 0.6 * sum(slow.collisions) < sum(fast.collisions) <= sum(slow.collisions) + 16
    np.testing.assert_allclose(fast.velocities, slow.velocities, rtol=0, atol=1e-15)
    np.testing.assert_allclose(fast.impulses, slow.impulses, rtol=1e-13)
    # How works are shared out is known only if no limit is taken while its cycle still turns.
    fast, slow = solve(*chain, bend=0.0), solve(*chain, bend=0.0, many=math.inf)
    np.testing.assert_allclose(fast.absorbed, slow.absorbed, rtol=1e-11)


def window(ratio):
    """How far ahead impulses reach: the smallest k with ratio^k <= the cut."""
    return math.ceil(math.log(LIMITS.cut) / math.log(ratio) - 1e-9)


@pytest.mark.parametrize("ratio", [0.1, 0.5])
def test_work_grows_in_proportion_to_a_long_chain(ratio):
    """One collision a contact, a bounded number of contacts a collision, one and the same end."""
    few, some, many = (solve(*struck(n), 1.0, ratio) for n in (200, 300, 400))
    # Both ends of the window, and one more as masses are counted in half of their largest.
    assert some.effort - few.effort == many.effort - some.effort <= 100 * (window(ratio) + 3)
    assert many.collisions == [1] * 399
    assert many.velocities[-5:] == few.velocities[-5:]


def test_an_event_of_a_long_lossy_row_costs_no_more_than_of_a_short_one():
    """Events far apart cost each other no work: with e = 0.99 runs stay as short in any row."""
    short, long = (solve(*struck(n), 0.99, 0.1) for n in (30, 90))
    assert long.events > 5 * short.events
    assert long.effort / long.events < 1.5 * short.effort / short.events


def test_what_is_cut_is_below_rounding():
    """The same bits for other cuts, and for none; a coarse one is seen."""
    rng = np.random.default_rng(7)
    lossy = magnitudes(rng, 1, 20).tolist(), struck(20)[1], uniform(rng, 0.9, 1.0, 19), 0.15
    for chain in ((*struck(100), 1.0, 0.1), (*struck(100), 1.0, 0.45), lossy):
        stored = solve(*chain).velocities
        for cut in (2.0**-100, 0.0):
            assert solve(*chain, cut=cut).velocities == stored, cut
        assert solve(*chain, cut=2.0**-30).velocities != stored


def batch_of_three(first, second):
    """Masses over one axis, restitutions over another, all else once."""
    rng = np.random.default_rng(0)
    masses = uniform(rng, 0.5, 2.0, (first, 1, 3))
    return masses, np.array([1.0, 0.0, 0.0]), uniform(rng, 0.2, 1.0, (second, 2)), 0.1


@needs_numba
def test_a_batch_needs_inputs_outputs_and_a_small_work_area():
    shape = 1000, 400
    chains = batch_of_three(*shape)
    outcomes(*batch_of_three(100, 100))  # compiled, and threads' areas made
    tracemalloc.start()
    try:
        found = outcomes(*chains)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    count = math.prod(shape)
    # Velocities 3, collisions 2, collapses 1 (and their truth), margins 1, 8 bytes each.
    results = 8 * 7 * count + count
    assert found.velocities.nbytes + found.collisions.nbytes < peak
    # A chunk's inputs (3 + 3 + 2 + 1 + 1 numbers a chain), with indices and as much again in spare.
    chunk = 8 * 2 * 16 * batch.CHUNK
    assert peak <= results + chunk * (os.cpu_count() or 1) + 2**20


def mixed_batch(count, n=4):
    rng = np.random.default_rng(11)
    return (
        uniform(rng, 0.5, 2.0, (count, n)),
        -np.sort(uniform(rng, -1.0, 1.0, (count, n))),
        uniform(rng, 0.3, 1.0, (count, n - 1)),
        uniform(rng, 0.0, 0.2, (count, n - 2)),
        uniform(rng, 0.0, 0.2, (count, n - 2)),
    )


def within(seconds, function):
    """Run in a thread that may be left behind, so that a batch that hangs is a failure."""
    result = []

    def run():
        try:
            result.append(function())
        except Exception as error:
            result.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    assert result, "it hangs"
    return result[0]


@needs_numba
def test_threads_do_not_change_a_bit(monkeypatch):
    rows = batch.CHUNK
    chains = mixed_batch(5 * rows + 77)
    whole = outcomes(*chains)
    for begin in range(0, len(whole.velocities), rows):
        part = slice(begin, begin + rows)
        alone = outcomes(*(x[part] for x in chains))
        for one, other in zip(whole, alone, strict=True):
            assert one[part].tobytes() == other.tobytes()
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    shown = outcomes(*chains, progress=True)
    assert shown.velocities.tobytes() == whole.velocities.tobytes()


@needs_numba
def test_an_error_in_the_middle_names_its_element():
    rows = batch.CHUNK
    m, v, e, f, b = mixed_batch(6 * rows)
    at, later = 2 * rows + 1234, 5 * rows + 1
    for array, value, message in (
        (m, -1.0, rf"masses[{at}, 0] = -1.0"),
        (v, np.nan, rf"velocities[{at}, 0] = nan"),
        (e, 1.5, rf"restitution[{at}, 0] = 1.5"),
        (f, 2.0, rf"forward[{at}, 0] = 2.0"),
        (b, -0.5, rf"backward[{at}, 0] = -0.5"),
    ):
        kept = array[[at, later], 0]
        array[[at, later], 0] = value  # of two errors the first is named
        error = within(600, lambda: post_impact_velocities(m, v, e, f, b))
        assert isinstance(error, ValueError)
        assert str(error).startswith(message + ";")
        array[[at, later], 0] = kept
    assert within(600, lambda: post_impact_velocities(m, v, e, f, b)).shape == v.shape


@needs_numba
def test_an_impact_that_does_not_finish_in_the_middle_is_handed_back():
    rows = batch.CHUNK
    m, v, e = np.ones((4 * rows, 3)), np.array([1.0, 0.0, 0.0]), 1.0
    m[[rows + 17, 3 * rows], 1] = 1e-6, 2e-6
    error = within(600, lambda: post_impact_velocities(m, v, e, 0.0, max_events=50))
    assert isinstance(error, ImpactNotFinished)
    assert error.trace.chain.masses.tolist() == m[rows + 17].tolist()
