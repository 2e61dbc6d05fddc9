"""Chains that the textbook solves in the event loop's place, in decimals of 400 digits."""

import threading

import numpy as np
import pytest
from delicate import CHAINS, chains_of
from families import family
from judge import batch, exact, off, on_bounds

from cradle import ImpactNotFinished, collide, outcomes
from cradle.kernel import Inputs, Options, loop
from cradle.kernel.state import LIMITS
from cradle.runtime import exact as package
from cradle.runtime.job import Job, outputs

TIE = CHAINS["a tie decided by products of tiny ratios"].problem


@pytest.fixture
def always(monkeypatch):
    """Take all products for tiny."""
    monkeypatch.setenv("CRADLE_KERNEL", "plain")
    monkeypatch.setattr(loop, "LIMITS", LIMITS._replace(product=2.0))


@pytest.mark.parametrize("name", ["generic", "at bounds", "ties"])
def test_the_whole_trace_is_that_of_the_loop(name, request):
    """Events, path, works: where the loop is right both say the same, to rounding."""
    traces = [p.collide() for p in family(name, 15, seed=11)]
    request.getfixturevalue("always")
    for trace in traces:
        again = collide(trace.chain, trace.model)
        if trace.collapsed:
            continue
        assert again.margin == 0.0
        assert not again.collapsed
        assert again.events == trace.events
        assert again.saturated == trace.saturated
        assert again.collisions.tolist() == trace.collisions.tolist()
        for part in ("velocities", "impulses", "absorbed", "path", "path_impulses"):
            values, others = getattr(trace, part), getattr(again, part)
            np.testing.assert_allclose(others, values, rtol=0, atol=1e-12, err_msg=part)


def test_no_path_is_kept_if_none_is_asked_for():
    assert TIE.collide(record=False).velocities.tolist() == TIE.collide().velocities.tolist()
    assert TIE.collide(record=False).events == ()


@pytest.mark.usefixtures("always")
def test_an_endless_one_is_the_loop_s():
    """An infinite sequence has no end in decimals either: the loop takes it to its limit."""
    trace = CHAINS["two balls press a light one"].problem.collide()
    assert trace.collapsed
    assert trace.margin == 0.0


def test_few_steps_are_as_few_for_the_textbook():
    with pytest.raises(ImpactNotFinished, match="max_events = 5 steps"):
        TIE.collide(max_events=5)


def test_one_that_the_loop_gets_wrong_does_not_stop_a_batch():
    """Alone the loop would leave balls that approach: its certificate refuses that."""
    refused = CHAINS["a certificate refuses the loop's answer"].problem
    rows = [np.array([TIE[k], refused[k], TIE[k]]) for k in range(5)]
    found = outcomes(*rows, excess="saturate")
    assert found.velocities.tolist() == [batch(TIE), batch(refused), batch(TIE)]
    assert off(refused, batch(refused), exact(refused).velocities) < 1e-14
    assert (found.margin == 0.0).all()


def test_numbers_of_many_digits_mean_their_bits():
    """So units that are powers of two change nothing."""
    problem = CHAINS["another tie decided by products of tiny ratios"].problem
    scaled = [problem.in_units(2.0**power, 1.0).collide().velocities for power in range(-20, 20, 3)]
    assert {bytes(v) for v in scaled} == {bytes(problem.collide().velocities)}


def test_a_chunk_stops_where_another_has_failed(monkeypatch):
    asked, stop = [], threading.Event()
    monkeypatch.setattr(package, "answer", lambda _, k: (asked.append(k), stop.set()))
    inputs = Inputs(*(np.array([TIE[k]] * 3, float) for k in range(5)))
    Job(inputs, outputs(3, 8), Options(0.5, 1000, bounded=False)).run(stop)
    assert asked == [0]


@pytest.mark.parametrize("name", chains_of("what decimals mean"))
def test_zero_bounds_and_numbers_are_those_of_the_loop(name, request):
    problem = CHAINS[name].problem
    right = problem.collide()
    request.getfixturevalue("always")
    again = problem.collide()
    np.testing.assert_allclose(again.velocities, right.velocities, rtol=0, atol=1e-14)
    assert again.saturated == right.saturated


@pytest.mark.usefixtures("always")
def test_a_bound_is_meant_as_floats_draw_it():
    """A light ball leaves the exact one few digits; see the judge's test of this name."""
    problem = CHAINS["a bound as floats draw it"].problem
    right = exact(on_bounds(problem)).velocities
    assert off(problem, problem.collide().velocities.tolist(), right) < 1e-9


def swapped(it):
    it.velocities.reverse()  # all masses are 1: momentum and energy stay


def slowed(it):
    it.velocities = [sum(v * v / 8 for v in it.velocities).sqrt()] * 8  # the energy stays


def booked_below_zero(it):
    it.absorbed[1] = -it.absorbed[0]  # of a contact that loses nothing: the ledger stays


def booked_twice(it):
    it.absorbed[0] *= 2


@pytest.mark.parametrize("change", [swapped, slowed, booked_below_zero, booked_twice])
def test_a_wrong_outcome_is_not_returned(change, monkeypatch):
    class Wrong(package.Impact):
        def round(self):
            going = super().round()
            if not going:
                change(self)
            return going

    monkeypatch.setattr(package, "Impact", Wrong)
    with pytest.raises(AssertionError, match="breaks momentum, order, energy or ledger"):
        TIE.collide()
