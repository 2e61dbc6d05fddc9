"""Chapter "Three balls solved" and its program: Eqs. 17-34, Figs. 3 and 4, by a second route."""

import contextlib
import io
import math
import re

import mpmath
import numpy as np
import pytest
from chains import uniform
from chapters import Chapter, code, floats, number, numbers, panel, shown
from chapters import run as run_cells
from truth import solve

from cradle import Chain, ImpulseCorrelation, collide, post_impact_velocities
from cradle.closed_form import final_impulses, one_collision_each, three_balls

CHAPTER, READING = Chapter("three_balls"), Chapter("reading_three_balls")
PROGRAM = Chapter("own_solver")
# The chapter's example.
EXAMPLE = ([1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.9, 0.8], 0.15)
CLOSE = {"rtol": 1e-12, "atol": 1e-13}


def run(masses, velocities, restitution, ratio):
    return collide(
        Chain(masses, velocities, restitution), ImpulseCorrelation(ratio, excess="saturate")
    )


def at(trace, kind, contact):
    """Row of the path at the first event of this kind."""
    return trace.events.index((kind, contact)) + 1


def random_chains(count, seed, e3=None):
    """Three balls with v1 > v2 > v3 and any ratio."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        e = uniform(rng, 0.1, 1, 2)
        if e3 is not None:
            e[1] = e3
        yield uniform(rng, 0.3, 4, 3), np.array([1, uniform(rng, 0, 0.8), 0]), e, uniform(rng, 0, 1)


def single(count, seed):
    """Those of them with one collision per contact, away from the edges of that range."""
    found = []
    for m, v, e, ratio in random_chains(100 * count, seed):
        if one_collision_each(m, v, e, ratio):
            found.append((m, v, e, ratio))
        if len(found) == count:
            return found
    raise AssertionError("too few chains")


def traced(count=200):
    """The single chains, each with what the package's solver records of it."""
    return [((m, np.array(v), e, a), run(m, v, e, a)) for m, v, e, a in SINGLE[:count]]


SINGLE = single(200, seed=17)


def bend_numbers(m, v, e, ratio):
    """g, X and rho of the chapter, written out on their own."""
    g = (1 + e[0]) * m[0] * (v[0] - v[1]) / ((1 - ratio) * m[0] + m[1])
    return g, (v[1] - v[2]) / g, m[2] / (m[1] + m[2])


def work(trace, contact, stop):
    """Work taken by a contact up to a row of the path: the trapezoid rule is exact there."""
    u = trace.path[: stop + 1, contact] - trace.path[: stop + 1, contact + 1]
    return np.trapezoid(u, trace.path_impulses[: stop + 1, contact])


def test_the_sample_covers_both_sides_of_eq_34():
    above = sum(ratio > m[2] / (m[1] + m[2]) for m, _, _, ratio in SINGLE)
    assert 10 < above < len(SINGLE) - 10


def test_eqs_17_18_19_rates_along_the_path():
    for (m, v, _, ratio), trace in traced():
        stop = at(trace, "end", 0)
        tau_2, tau_3 = trace.path_impulses[stop]
        d1, d2, d3 = trace.path[stop] - v
        np.testing.assert_allclose(tau_3, ratio * tau_2, **CLOSE)  # Eq. 16
        np.testing.assert_allclose(d1, -tau_2 / m[0], **CLOSE)
        np.testing.assert_allclose(d2, (1 - ratio) / m[1] * tau_2, **CLOSE)
        np.testing.assert_allclose(d2, (1 - ratio) / (ratio * m[1]) * tau_3, **CLOSE)
        np.testing.assert_allclose(d3, tau_3 / m[2], **CLOSE)


def test_eqs_20_21_22_first_maximum_compression():
    for (m, v, _, ratio), trace in traced():
        row = at(trace, "maximum_compression", 0)
        tau = m[0] * m[1] * (v[0] - v[1]) / ((1 - ratio) * m[0] + m[1])
        np.testing.assert_allclose(trace.path_impulses[row, 0], tau, **CLOSE)
        np.testing.assert_allclose(trace.path[row, 0], v[0] - tau / m[0], **CLOSE)
        np.testing.assert_allclose(trace.path[row, 1], v[1] + (1 - ratio) / m[1] * tau, **CLOSE)
        np.testing.assert_allclose(trace.path[row, 0], trace.path[row, 1], **CLOSE)


@pytest.mark.parametrize("contact", [0, 1])
def test_eqs_23_29_work_given_back(contact):
    for (_, _, e, _), trace in traced():
        absorbed = work(trace, contact, at(trace, "maximum_compression", contact))
        returned = absorbed - work(trace, contact, at(trace, "end", contact))
        np.testing.assert_allclose(returned, e[contact] ** 2 * absorbed, **CLOSE)
        np.testing.assert_allclose(trace.absorbed[contact], absorbed, **CLOSE)


def test_eq_24_terminal_impulse():
    for chain, trace in traced():
        compressed = trace.path_impulses[at(trace, "maximum_compression", 0), 0]
        np.testing.assert_allclose(trace.impulses[0], (1 + chain[2][0]) * compressed, **CLOSE)
        np.testing.assert_allclose(trace.impulses[0], final_impulses(*chain)[0], **CLOSE)


def test_eqs_25_26_27_two_pieces():
    for (m, v, e, ratio), trace in traced():
        stop = at(trace, "end", 0)
        star = v[1] + (1 - ratio) * bend_numbers(m, v, e, ratio)[0]
        np.testing.assert_allclose(trace.path[stop, 1], star, **CLOSE)  # Eq. 26
        tau_3 = trace.path_impulses[:, 1]
        first = v[1] + (1 - ratio) / (ratio * m[1]) * tau_3
        second = star - (tau_3 - ratio * trace.impulses[0]) / m[1]
        rows = np.arange(len(tau_3))
        np.testing.assert_allclose(trace.path[:, 1], np.where(rows <= stop, first, second), **CLOSE)
        np.testing.assert_allclose(trace.path[:, 2], v[2] + tau_3 / m[2], **CLOSE)


def test_eq_28_second_maximum_compression():
    for (m, v, e, ratio), trace in traced():
        compressed = trace.path_impulses[at(trace, "maximum_compression", 1), 1]
        pair = m[1] * m[2] / (m[1] + m[2])
        extended = pair * (bend_numbers(m, v, e, ratio)[0] + v[1] - v[2])
        np.testing.assert_allclose(compressed, extended, **CLOSE)


def impulse_of_eq_29(m, v, e, ratio):
    """Solve Eq. 29 with its two-piece integrand by bisection; no formula of Eq. 30 enters."""
    m1, m2, m3, v1, v2, v3, e2, e3, a = map(mpmath.mpf, (*m, *v, *e, ratio))
    bend = a * (1 + e2) * m1 * m2 * (v1 - v2) / ((1 - a) * m1 + m2)

    def u(tau):
        gained = (1 - a) / (a * m2) * min(tau, bend) - max(tau - bend, 0) / m2
        return v2 + gained - v3 - tau / m3

    def area(start, stop):
        points = [start, bend, stop] if start < bend < stop else [start, stop]
        return mpmath.quad(u, points)

    def zero(function, start, stop):
        return mpmath.findroot(function, (start, stop), solver="anderson")

    compressed = zero(u, bend, mpmath.mpf(100))
    absorbed = area(mpmath.mpf(0), compressed)
    # The bracket goes beyond the largest end, that of e3 = 1 and ratio 0.
    return zero(lambda x: e3**2 * absorbed + area(compressed, x), compressed, 2.5 * compressed)


def test_eq_30_from_the_integrals_at_fifty_digits():
    with mpmath.workdps(50):
        for chain in SINGLE[:20]:
            assert abs(impulse_of_eq_29(*chain) / final_impulses(*chain)[1] - 1) < 1e-13


def test_eqs_31_32_33_against_the_independent_solver():
    for (m, v, e, ratio), trace in traced(40):
        outcome = floats(solve(list(m), list(v), list(e), ratio).velocities)
        np.testing.assert_allclose(three_balls(m, v, e, ratio), outcome, **CLOSE)
        np.testing.assert_allclose(trace.velocities, outcome, **CLOSE)


@pytest.mark.parametrize("e3", [0.2, 0.5, 1.0])
def test_eq_34_ranges_of_the_second_contact(e3):
    """Order of events: (1 + X) rho and (1 + (1 + e3) X) rho are the bounds, for random chains."""
    seen = {"closes": 0, "opens": 0, "ends": 0}
    real_but_wrong = 0
    for m, v, e, ratio in random_chains(600, seed=34, e3=e3):
        g, X, rho = bend_numbers(m, v, e, ratio)
        trace = run(m, v, e, ratio)
        before = trace.events[: trace.events.index(("end", 0))]
        state, low, high = "closes", 0.0, 1 + X
        if ("end", 1) in before:
            state, low, high = "ends", 1 + (1 + e3) * X, np.inf
        elif ("maximum_compression", 1) in before:
            state, low, high = "opens", 1 + X, 1 + (1 + e3) * X
        assert low * (1 - 1e-12) <= ratio / rho <= high * (1 + 1e-12)
        seen[state] += 1
        row = at(trace, "maximum_compression", 1)
        if ("close", 0) in trace.events[:row]:
            continue  # a back impact comes before: another chapter
        compressed, extended = trace.path_impulses[row, 1], m[1] * rho * (g + v[1] - v[2])
        if state == "closes":
            np.testing.assert_allclose(compressed, extended, **CLOSE)  # Eq. 28 holds
        elif trace.collisions.tolist() == [1, 1] and ratio / rho < (1 + X) ** 2:
            assert compressed < extended  # it fails, although the radical is real
            wrong = abs(trace.impulses[1] / final_impulses(m, v, e, ratio)[1] - 1)
            if state == "opens" and e3 == 1:
                assert wrong < 1e-11  # Eq. 30 asks for no net work: right all the same
            else:
                real_but_wrong += wrong > 1e-6
    assert min(*seen.values(), real_but_wrong) > 10


def test_fig_3_every_marked_impulse_and_velocity():
    m, v, e, ratio = EXAMPLE
    trace = run(*EXAMPLE)
    assert [tuple(event) for event in trace.events] == [
        (kind, contact) for contact in (0, 1) for kind in ("maximum_compression", "end")
    ]
    tau_2, tau_3 = trace.path_impulses.T
    g, _, rho = bend_numbers(*EXAMPLE)
    np.testing.assert_allclose(tau_2[1], m[1] * g / (1 + e[0]), **CLOSE)  # tau_2^c
    np.testing.assert_allclose(tau_2[2:], m[1] * g, **CLOSE)  # tau_2^f
    np.testing.assert_allclose(tau_3[2], ratio * m[1] * g, **CLOSE)  # alpha tau_2^f
    np.testing.assert_allclose(tau_3[3], rho * m[1] * (g + v[1] - v[2]), **CLOSE)  # tau_3^c
    np.testing.assert_allclose(tau_3[4], final_impulses(*EXAMPLE)[1], **CLOSE)  # tau_3^f
    np.testing.assert_allclose(trace.path[2, 1], v[1] + (1 - ratio) * g, **CLOSE)  # v_2^*
    np.testing.assert_allclose(trace.velocities, floats(solve(*EXAMPLE).velocities), **CLOSE)


def test_energy_that_the_example_loses():
    """By the velocities of the independent solver; the two parts from its path."""
    m, v, *_ = EXAMPLE
    after = floats(solve(*EXAMPLE).velocities)
    lost = 500 * (np.dot(m, np.square(v)) - np.dot(m, np.square(after)))  # mJ
    trace = run(*EXAMPLE)
    parts = [1000 * work(trace, k, at(trace, "end", k)) for k in (0, 1)]
    assert sum(parts) == pytest.approx(lost, rel=1e-12)
    # The numbers that the text puts into the formulas: the right-hand sides.
    cells = [CHAPTER.cells[f"{x}-numbers"] for x in ["first", "second", "area", "outcome", "loss"]]
    *told, loss = (cell.outputs[0].data["text/latex"] for cell in cells)
    told = "".join(told)
    ends = [float(x) for x in re.findall(r"=(-?[.\d]+)(?=\\text|\\\\)", told)]
    tau_2, tau_3 = trace.path_impulses.T  # g is the final tau_2
    right = [*tau_2[1:3], *tau_2[2:4], 0.5, tau_3[3], 0.7, tau_3[4], trace.velocities[0]]
    right += [trace.path[2, 1], *trace.velocities[1:]]
    right += [*trace.path_impulses.sum(axis=1)[[2, 4]]]  # events 1 and 2 in the opening figure
    assert ends == pytest.approx(right, abs=5.1e-4)
    loss = re.findall(r"[.\d]+", loss)
    assert loss == [f"{x / 1000:.5f}" for x in (*parts, lost)]
    assert float(loss[0]) + float(loss[1]) == pytest.approx(float(loss[2]), abs=1e-12)


def test_fig_4_curves():
    ratio = np.linspace(0, 0.5, 501)
    outcome = post_impact_velocities([1, 1, 1], [1, 0, 0], 1, ratio[:, None])
    s = np.sqrt(1 - 2 * ratio)  # the ends are those of Eqs. 6 and 5
    expected = np.stack([s**2 - 1, 2 * (1 - s), 2 * (1 + s)], axis=-1) / (3 + s**2)[:, None]
    np.testing.assert_allclose(outcome, expected, rtol=0, atol=1e-13)
    # v2 rises throughout: its minimum is at ratio 0.
    assert (np.diff(outcome, axis=0) * [-1, 1, -1] > 0).all()
    for k in (0, 150, 300, 450):  # and the independent solver
        other = solve([1, 1, 1], [1, 0, 0], [1, 1], ratio[k])
        np.testing.assert_allclose(outcome[k], floats(other.velocities), atol=1e-13)


def test_a_light_ball_in_the_middle_has_its_kink_where_only_ball_3_leaves():
    """Ball 2 of half a kilogram, no losses: back impacts below the ratio 1/2, none above."""
    found = [solve([1, "0.5", 1], [1, 0, 0], 1, ratio) for ratio in ("0.499", "0.5", "0.501")]
    assert [sum(x.collisions) for x in found] == [3, 2, 2]
    np.testing.assert_allclose(floats(found[1].velocities), [0, 0, 1], atol=1e-14)
    assert found[0].velocities[1] > 0 < found[2].velocities[1]


@pytest.mark.parametrize(("mass", "kinks"), [("0.6", 1), ("0.32", 2), ("0.2", 3), ("0.1", 5)])
def test_each_kink_is_one_collision_more(mass, kinks):
    """From the bound down, by the independent solver: first at 1-2, then at 2-3, in turn."""
    ratios = np.linspace(1 / (1 + float(mass)), 0, 200)[1:]
    found = [solve([1, mass, 1], [1, 0, 0], 1, ratio) for ratio in ratios]
    steps = np.diff([x.collisions for x in found], axis=0)
    more = np.flatnonzero(steps.any(axis=1))
    assert found[0].collisions == [1, 1]
    assert steps[more].tolist() == [[1, 0], [0, 1]] * (kinks // 2) + [[1, 0]] * (kinks % 2)
    # There and nowhere else the slope of a curve changes far more than around it.
    slopes = np.diff([floats(x.velocities) for x in found], axis=0)
    jumps = np.abs(np.diff(slopes, axis=0)).max(axis=1)
    around = [np.median(jumps[max(k - 6, 0) : k + 7]) for k in range(len(jumps))]
    sharp = np.flatnonzero(jumps > 5 * np.array(around))
    assert set(sharp) <= {*more, *(more - 1)}
    assert all({k, k - 1} & set(sharp) for k in more)


def test_one_outcome_belongs_to_many_parameters():
    """Eqs. 24 and 30 solved for e2 and e3, at fifty digits; and a ratio that comes twice."""

    def losses(tau_2, tau_3, a, sqrt):
        return tau_2 * (2 - a) - 1, (2 * tau_3 / tau_2 - 1) / sqrt(1 - 2 * a)

    with mpmath.workdps(50):
        target = solve([1, 1, 1], [1, 0, 0], ["0.9", "0.8"], "0.15").velocities
        for ratio, printed in (("0.1", (0.951351, 0.748331)), ("0.2", (0.848649, 0.864099))):
            a = mpmath.mpf(ratio)
            e = losses(1 - target[0], target[2], a, mpmath.sqrt)
            assert floats(e) == pytest.approx(printed, abs=5.1e-7)
            assert " ".join(f"{x:.3f}" for x in floats(e)) in CHAPTER.printed("ambiguity")
            again = solve([1, 1, 1], [1, 0, 0], list(e), a).velocities
            assert max(abs(x - y) for x, y in zip(again, target)) < mpmath.mpf(10) ** -45
    # At the ends of the range one of the two is 1; beyond them it would have to be larger.
    tau_2, tau_3 = floats((1 - target[0], target[2]))
    for name, one in (("low", 0), ("high", 1)):
        end = float(CHAPTER.glued[f"three-balls-range-{name}"])
        for a, inside in ((end - 1e-3, name == "high"), (end + 1e-3, name == "low")):
            found = losses(tau_2, tau_3, a, math.sqrt)
            assert (max(found) < 1) == inside
            assert np.argmax(found) == one
    twice = [
        solve(["0.045", "0.045", "0.053"], [1, 0, 0], 1, ratio)
        for ratio in ("0.018", READING.glued["three-balls-other-ratio"])
    ]
    assert [sum(x.collisions) for x in twice] == [3, 2]
    outcomes = [floats(x.velocities) for x in twice]
    np.testing.assert_allclose(*outcomes, rtol=0, atol=1e-7)  # seven digits of the ratio


def test_the_readers_solver_against_the_reference_solver():
    """Its path is that of the rules; its functions have some sixty lines in all."""
    with contextlib.redirect_stdout(io.StringIO()):
        names = run_cells(shown("own_solver"), {})
    rng = np.random.default_rng(77)
    repeated = 0
    for _ in range(60):
        m, e = uniform(rng, 0.3, 3, 3), uniform(rng, 0.3, 1, 2)
        v = [1, uniform(rng, 0, 0.8), 0]
        ratio = uniform(rng, 0, 1) * min(m[2] / (m[1] + m[2]), m[0] / (m[0] + m[1]))
        *_, (_, _, found, impulses, owed) = names["three_balls"](m, v, e, ratio)
        np.testing.assert_allclose(owed, 0, atol=1e-14)
        exact = solve(list(m), v, list(e), ratio)
        np.testing.assert_allclose(found, floats(exact.velocities), atol=1e-10)
        np.testing.assert_allclose(impulses, floats(exact.impulses), atol=1e-10)
        repeated += sum(exact.collisions) > 2
    assert repeated > 5
    lines = sum(
        len(cell.source.splitlines())
        for cell in code("own_solver")
        if cell.id in ("rates", "ways", "loop")
    )
    assert lines < 65


def test_an_impact_without_end_by_momentum():
    """All three go on as one; the program, which stops before, is off by as much as it says."""
    with contextlib.redirect_stdout(io.StringIO()):
        names = run_cells(shown("own_solver"), {})
    path = names["three_balls"]([1, 0.02, 1], [1, 0, 0], [0.3, 0.3], 0)
    assert len(path) == 300
    off = np.abs(path[-1][2] - 1 / 2.02).max()
    told = float(f"{off:.0e}")
    assert number(PROGRAM.glued["own-solver-off-fiftieth"]) == pytest.approx(told, rel=1e-9)


def test_what_the_page_says_of_the_program():
    """Both ways of contact 1-2 by Eqs. 22 and 24; the light ball of the figure."""
    m, v, e, a = EXAMPLE
    slope = -((1 - a) / m[1] + 1 / m[0])
    compression = -(v[0] - v[1]) / slope
    owed = e[0] ** 2 * (v[0] - v[1]) * compression / 2
    PROGRAM.tells(
        {
            "own-solver-ways-slope": slope,
            "own-solver-ways-owed": owed,
            "own-solver-ways-root": math.sqrt(-2 * slope * owed),
            "own-solver-ways-step": e[0] * compression,
        }
    )
    rows = [line[8:] for line in PROGRAM.printed("solved").splitlines()[1:]]
    rows = np.array([[float(x) for x in row.replace("-", " -").split()] for row in rows])
    exact = solve(m, v, e, a)
    for columns, values in ((slice(3), exact.path), (slice(3, 5), exact.path_impulses)):
        np.testing.assert_allclose(rows[:, columns], np.array(values, float), atol=5.1e-4)
    # Contact 1-2 owes until its end; 2-3 until its own, e^2 of what it has absorbed.
    done = solve(m, v, [e[0], 0], a)  # what 2-3 absorbs up to its maximum compression
    assert rows[:, 5] == pytest.approx([0, owed, 0, 0, 0], abs=5.1e-4)
    assert rows[3, 6] == pytest.approx(e[1] ** 2 * float(done.absorbed[1]), abs=5.1e-4)
    assert (np.diff(rows[:4, 6]) > 0).all()
    assert rows[4, 6] == 0
    light = solve([1, "0.1", 1], [1, 0, 0], 1, "0.15")
    said = PROGRAM.printed("light")
    assert f"{len(light.path) - 1} stops" in said
    assert numbers(said) == pytest.approx(floats(light.velocities), abs=5.1e-4)
    shown_lines = panel("own_solver", "fig-own-solver-light")
    assert list(shown_lines) == [f"$v_{i}$" for i in (1, 2, 3)]
    for ball, line in enumerate(shown_lines.values()):
        np.testing.assert_allclose(line[:, 1], [float(v[ball]) for v in light.path], atol=1e-12)


def test_exercises_1_and_2():
    for name, v2 in (("ratio", 0.1), ("low", 0.09), ("high", 0.11)):
        after = solve([1, 1, 1], [1, 0, 0], 1, CHAPTER.glued[f"three-balls-ex-{name}"]).velocities
        assert float(after[1]) == pytest.approx(v2, abs=4e-4)
    a, gain = 0.15, 2 / 1.85
    newton = (1 - gain) ** 2 + 2 * (gain / 2) ** 2
    poisson = (4 + a**2) / (2 - a) ** 2
    CHAPTER.tells({"three-balls-ex-newton": newton, "three-balls-ex-poisson": poisson})
