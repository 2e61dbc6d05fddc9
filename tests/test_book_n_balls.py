"""The chapter on N balls: Eqs. 47-53, Fig. 8 and the demonstrations, each by a second route."""

import io
import math
from copy import deepcopy
from itertools import groupby, pairwise

import numpy as np
import pandas as pd
import pytest
import truth
from chains import magnitudes, uniform
from chapters import Chapter, floats, number

from cradle import Chain, ImpulseCorrelation, collide, paper_chain, paper_sequences
from cradle.closed_form import largest_ratios

FIG_8 = Chain([1] * 4, [1, 0.5, 0, 0], 1)
CHAPTER, RULES, SOLVER = (Chapter(name) for name in ("n_balls", "reading_rules", "reading_solver"))


def random_chain(seed, n):
    """Masses and admissible ratios of a chain at random, worked out by Eq. 53 from the far end."""
    rng = np.random.default_rng(seed)
    masses = magnitudes(rng, 2, n)
    ratios, onward = np.zeros(n - 2), 0.0
    for i in range(n - 2, 0, -1):
        bound = masses[i + 1] / (masses[i + 1] + masses[i] * (1 - onward))
        onward = ratios[i - 1] = uniform(rng, 0.05, 0.99) * bound
    return masses, ratios


@pytest.mark.parametrize("n", range(2, 8))
def test_eqs_47_48_momentum_of_every_ball(n):
    masses, ratios = random_chain(n, n)
    path = truth.solve(masses, np.arange(n)[::-1], 0.7, list(ratios), [0] * (n - 2), number=float)
    trace = collide(Chain(masses, np.arange(n)[::-1], 0.7), ImpulseCorrelation(ratios, 0))
    for velocities, impulses in (
        (path.path, path.path_impulses),
        (trace.path, trace.path_impulses),
    ):
        ends = np.pad(np.array(impulses, float), ((0, 0), (1, 1)))  # Eq. 48
        change = np.array(velocities, float) - velocities[0]
        np.testing.assert_allclose(masses * change, -np.diff(ends, axis=1), atol=1e-12)


@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("n", range(3, 8))
def test_eqs_49_to_52_rates_of_a_run(n, direction):
    masses, ratios = random_chain(100 + n, n)
    if direction == "forward":
        model, velocities = ImpulseCorrelation(ratios, 0), np.eye(n)[0]
    else:
        masses, ratios = masses[::-1], ratios[::-1]
        model, velocities = ImpulseCorrelation(0, ratios), -np.eye(n)[-1]
    trace = collide(Chain(masses, velocities, 1), model)
    dv, dtau = trace.path[1] - trace.path[0], trace.path_impulses[1]
    tolerance = {"rtol": 1e-12, "atol": 1e-15}
    if direction == "forward":
        np.testing.assert_allclose(dtau[1:], ratios * dtau[:-1], **tolerance)  # Eq. 49
        kept = (1 - ratios) * dtau[:-1]
    else:
        np.testing.assert_allclose(dtau[:-1], ratios * dtau[1:], **tolerance)
        kept = (ratios - 1) * dtau[1:]
    np.testing.assert_allclose(dv[0], -dtau[0] / masses[0], **tolerance)  # Eq. 50
    np.testing.assert_allclose(dv[1:-1], kept / masses[1:-1], **tolerance)  # Eq. 51
    np.testing.assert_allclose(dv[-1], dtau[-1] / masses[-1], **tolerance)  # Eq. 52


def opening(masses, ratios, ball, excess):
    """Change of closing speed right of `ball` (from 1) per impulse on its left: Eqs. 47, 49."""
    ratio = np.append(ratios, 0.0)
    ratio[ball - 1] *= 1 + excess
    impulse = np.cumprod(np.concatenate([[1.0], ratio[ball - 1 : ball + 1]]))
    return (impulse[0] - impulse[1]) / masses[ball] - (impulse[1] - impulse[2]) / masses[ball + 1]


@pytest.mark.parametrize("n", range(3, 8))
def test_eq_53_bound_is_where_a_driven_contact_opens(n):
    masses, ratios = random_chain(200 + n, n)
    for ball in range(1, n - 1):
        at_bound = ratios.copy()
        at_bound[ball - 1] = largest_ratios(masses, ratios, ratios)[0][ball - 1]
        assert opening(masses, at_bound, ball, -1e-9) > 0 > opening(masses, at_bound, ball, 1e-9)
        mirror = largest_ratios(masses[::-1], ratios, ratios[::-1])[1][::-1]
        assert mirror[ball - 1] == pytest.approx(at_bound[ball - 1], rel=1e-15)
    far = masses[-1] / (masses[-2] + masses[-1])  # the last interior ball: Eq. 34
    assert largest_ratios(masses, ratios, ratios)[0][-1] == pytest.approx(far, rel=1e-15)


@pytest.mark.parametrize("n", range(3, 8))
def test_eq_53_at_the_bound_the_rest_is_one_body(n):
    masses, _ = random_chain(300 + n, n)
    beyond = np.cumsum(masses[::-1])[::-1]
    ratios = beyond[2:] / beyond[1:-1]
    trace = collide(Chain(masses, [1] + [0] * (n - 1), 1), ImpulseCorrelation(ratios, 0))
    total, rest = masses.sum(), beyond[1]
    together = [(masses[0] - rest) / total] + [2 * masses[0] / total] * (n - 1)
    # The outcome has a square root at the bound (Eq. 30): one rounding costs half of the digits.
    np.testing.assert_allclose(
        trace.velocities, together, rtol=0, atol=4 * math.sqrt(np.finfo(float).eps)
    )


def test_end_progress_is_as_exact_as_its_arguments():
    rows = SOLVER.printed("root-errors").splitlines()[2:]
    errors = {number(row.split()[0]): [number(x) for x in row.split()[1:]] for row in rows}
    assert all(ours < 3e-16 for _, ours in errors.values())
    # The school formula loses as many digits as Q is small.
    assert all(school > 1e-19 / q for q, (school, _) in errors.items() if q < 1e-3)


def test_r7_a_bound_that_moves():
    """Eq. 53 holds when the impact begins, and a contact of ABCCAB is held later."""
    chain, model = paper_chain("ABCCAB")  # not refused
    bounds = largest_ratios(chain.masses, model.forward, model.backward)
    assert (np.array(model.forward) <= bounds[0]).all()
    exact = truth.solve(
        chain.masses, chain.velocities, list(chain.restitution), model.forward, model.backward
    )
    assert exact.held == {3} == set(collide(chain, model).saturated)


class Reading(truth.Impact):
    """The reference rules with another direction of drive where two runs meet."""

    turns: tuple[str, str]

    def close(self, c):
        super().close(c)
        if self.active[c - 1] and self.active[c + 1]:
            ways = {"forward": 1, "backward": -1}
            self.direction[c], self.direction[c + 1] = (ways[way] for way in self.turns)


#: Directions of drive at the two balls of the gap, by the chapter's names.
READINGS = {
    "both": ("forward", "backward"),
    "left": ("forward", "forward"),
    "right": ("backward", "backward"),
}


def chosen(turns):
    """The rules of one reading."""
    return type("Chosen", (Reading,), {"turns": turns})


def outcome(turns, ratio="0.1", chain=([1] * 4, [1, "0.5", 0, 0], 1)):
    """Outcome of a chain when the gap closes with these directions at its two balls."""
    return truth.solve(*chain, ratio, number=float, impact=chosen(turns))


def test_fig_8_path():
    exact = truth.solve([1] * 4, [1, "0.5", 0, 0], 1, "0.1")
    trace = collide(FIG_8, ImpulseCorrelation(0.1))
    assert exact.meetings == 1
    assert [tuple(event) for event in trace.events] == exact.events
    np.testing.assert_allclose(trace.path, np.array(exact.path, float), atol=1e-14)
    np.testing.assert_allclose(
        trace.path_impulses, np.array(exact.path_impulses, float), atol=1e-14
    )


def test_rounds_of_fig_8():
    """They lead through the ends and closings of the path, one or two rounds for each."""
    lines = [line.split() for line in RULES.printed("r8-rounds").splitlines()[1:]]
    exact = truth.solve([1] * 4, [1, "0.5", 0, 0], 1, "0.1")
    told = {"end": "ends", "close": "closes"}
    turns = [(f"{c + 1}-{c + 2}", told[kind]) for kind, c in exact.events if kind in told]
    assert [tuple(line[-2:]) for line in lines] == turns
    rounds = [int(word.strip(",")) for line in lines for word in line[: 1 + line[0].endswith(",")]]
    assert rounds == [*range(1, 2 * len(turns))]
    (met,) = [line for line in lines if "5" in line[1:-2]]
    assert met[-2:] == ["2-3", "closes"]


def contact_work(trace, c, row):
    """Work done on contact c up to a row of the path, by the trapezoidal rule (exact here)."""
    u = trace.path[: row + 1, c] - trace.path[: row + 1, c + 1]
    return float(np.sum((u[1:] + u[:-1]) / 2 * np.diff(trace.path_impulses[: row + 1, c])))


def test_three_readings():
    """Who drives after a meeting: in the example, and in the ten chains."""
    table = pd.read_csv(io.StringIO(RULES.printed("readings-table")), sep=r"\s+")
    for ratio, spread, turned_about in (
        ("0.1", "n-balls-spread-fig8", "n-balls-mirror-fig8"),
        ("0.15", "n-balls-spread", "n-balls-mirror-off"),
    ):
        ends = {name: floats(outcome(way, ratio).velocities) for name, way in READINGS.items()}
        if ratio == "0.1":
            for name, expected in ends.items():
                np.testing.assert_allclose(table.loc[name], expected, atol=6e-5)
        most = np.ptp([*ends.values()], axis=0).max()
        assert RULES.glued[spread] == f"{most:.2f}"
        start = [1] * 4, [0, 0, "-0.5", -1], 1
        seen = floats(outcome(READINGS["both"], ratio, start).velocities)
        mirror = abs(seen[::-1] + ends["both"]).max()
        assert RULES.glued[turned_about] == f"{mirror:.3f}"
        assert 0.15 < max(mirror, most) < 0.2
    assert CHAPTER.glued["n-balls-spread"] == f"{most:.2f}"
    # Ratios that vanish: of the three, one alone leads to pairs, by hand (0, 0, 1/2, 1).
    ends = {name: floats(outcome(way, "1e-9").velocities) for name, way in READINGS.items()}
    off = {name: abs(np.array(end) - [0, 0, 0.5, 1]).max() for name, end in ends.items()}
    assert off["both"] < 1e-8
    assert RULES.glued["n-balls-not-pairs"] == f"{min(off['left'], off['right']):.2f}"
    ends = {
        name: floats(outcome(way, "0.15", ([1] * 5, [1, 1, 0, 0, 0], 1)).velocities)
        for name, way in READINGS.items()
    }
    RULES.tells({f"n-balls-toy-four-{name}": end[3] for name, end in ends.items()})
    most = np.ptp([*ends.values()], axis=0).max()
    assert RULES.glued["n-balls-toy-spread"] == f"{most:.2f}"
    assert Chapter("errata").glued["readings-toy"] == f"{most:.2f}"

    turned = {}
    for name in paper_sequences():
        chain, model = paper_chain(name, excess="saturate")
        numbers = chain.masses, chain.velocities, list(chain.restitution)
        numbers += model.forward, model.backward
        ends = [
            truth.solve(*numbers, number=float, impact=chosen(way)) for way in READINGS.values()
        ]
        turned[name] = np.ptp([floats(end.velocities) for end in ends], axis=0).max()
    assert {name for name, size in turned.items() if size > 0} == {"ABCCAB", "BCACBA"}
    for chapter, name in (RULES, "n-balls-ten-spread"), (Chapter("experiments"), "turned"):
        chapter.tells({name: max(turned.values())})
    assert max(turned.values()) < 0.005  # "less than half a hundredth"


def test_the_jump_of_a_start():
    """It is that of R2 on the other side: of one source for all, or one at each end."""
    both = READINGS["both"]
    ends = [floats(outcome(both, "0.15", ([1] * 4, [1, moved, 0, -1], 1)).velocities)
            for moved in ("-1e-9", "1e-9")]  # fmt: skip
    assert RULES.glued["n-balls-start-jump"] == f"{np.ptp(ends, axis=0).max():.3f}"


def test_events_of_two_runs_that_meet():
    """The table has the ends and closings of the picture, in the chapter's numbering."""
    lines = [line.split() for line in CHAPTER.printed("events-table").splitlines()[2:]]
    exact = truth.solve([1] * 4, [1, "0.5", 0, 0], 1, "0.15")
    rows = [k for k, (kind, _) in enumerate(exact.events, 1) if kind != "maximum_compression"]
    told = {"end": "ends", "close": "closes"}
    for place, (line, row) in enumerate(zip(lines, rows, strict=True), start=1):
        kind, c = exact.events[row - 1]
        assert line[:3] == [f"{place}", f"{c + 1}-{c + 2}", told[kind]]
        assert [*map(float, line[3:])] == pytest.approx([*map(float, exact.path[row])], abs=6e-4)


class SmallSteps:
    """Equal elastic balls by small steps of impulse; `far`: runs that meet are followed to rest."""

    def __init__(self, v, ratio, far, step=2e-4):
        self.v, self.ratio, self.far, self.step = list(v), ratio, far, step
        self.store, self.on = [0.0] * (len(v) - 1), [True] * (len(v) - 1)
        source = next(c for c in range(len(self.on)) if self.u(c) > 0)
        self.way = [1 if ball > source else -1 for ball in range(len(v))]

    def u(self, c):
        return self.v[c] - self.v[c + 1]

    def runs(self, contacts):
        groups = groupby(contacts, lambda c: self.on[c])
        return [list(group) for acting, group in groups if acting]

    def stride(self, run, contacts):
        """Take a step; tell whether it brings an event."""
        rates = [1.0]
        for c in run[1:]:
            rates.append(rates[-1] * self.ratio ** self.way[c])
        for c, rate in zip(run, rates):
            push = self.step * rate / max(rates)
            self.store[c] += (self.u(c) - push) * push
            self.v[c] -= push
            self.v[c + 1] += push
        for c in run:
            if self.u(c) < 0 and self.store[c] <= 0:
                self.on[c] = False
                return True
        for c in (run[0] - 1, run[-1] + 1):
            beside = [d for d in (c - 1, c + 1) if d in contacts and self.on[d]]
            if c in contacts and self.u(c) >= 0 and len(beside) == 1:
                self.close(c)
                return True
        return False

    def close(self, c):
        beside = [0 <= d < len(self.on) and self.on[d] for d in (c - 1, c + 1)]
        self.on[c], self.store[c] = True, 0.0
        self.way[c : c + 2] = beside[0], -beside[1]

    def follow(self, contacts, stop=None, once=False):
        """Step until all is idle, a ball has reached a velocity, or (`once`) to an event."""
        while runs := self.runs(contacts):
            links = [b[0] - 1 for a, b in pairwise(runs) if b[0] == a[-1] + 2]
            if links and self.meet(links[0], contacts):
                continue
            for run in runs[: 1 if stop or self.far else None]:
                event = False
                while not event:
                    event = self.stride(run, contacts)
                    if stop and stop(self.v):
                        return
            if once:
                return

    def meet(self, link, contacts):
        """Close a link if its balls must meet; tell whether."""
        sides = range(contacts.start, link), range(link + 1, contacts.stop)
        alone = [deepcopy(self) for _ in sides]
        for one, side in zip(alone, sides):
            one.follow(side, once=not self.far)
        p, q = alone[0].v[link], alone[1].v[link + 1]
        if p <= q:
            return False
        middle = (max(self.v[link], q) + min(self.v[link + 1], p)) / 2
        self.follow(sides[0], lambda v: v[link] >= middle)
        self.follow(sides[1], lambda v: v[link + 1] <= middle)
        self.close(link)
        return True


def test_how_far_runs_are_followed():
    """Both readings where two of five strike, by small steps; in the ten chains they are near."""
    lines = [line.split() for line in RULES.printed("far-cell").replace("−", "-").splitlines()[1:3]]
    ends = []
    for far, line in zip((False, True), lines, strict=True):
        impact = SmallSteps([1, 1, 0, 0, 0], 0.15, far)
        impact.follow(range(4))
        ends.append(impact.v)
        assert [float(x) for x in line[-5:]] == pytest.approx(impact.v, abs=2e-3)
    RULES.tells({"n-balls-toy-far": abs(np.subtract(*ends)).max()}, off=2e-3)
    impact = SmallSteps([1, 0.5, 0, 0], 0.1, True)
    impact.follow(range(3))
    assert impact.v == pytest.approx(collide(FIG_8, ImpulseCorrelation(0.1)).velocities, abs=2e-3)
    assert 0 < number(RULES.glued["n-balls-ten-far"]) < number(RULES.glued["n-balls-ten-move"])


def test_meeting_chooses_a_velocity_of_the_overlap():
    """What its page prints and the chapter says of it, by the reference rules."""
    chain = [1] * 4, [1, "0.5", 0, 0], 1
    ends, met = [], []
    for place in (0, 0.5, 1):
        exact = truth.solve(*chain, "0.15", meeting=place, number=float)
        ends.append(exact.velocities)
        met.append(float(exact.path[exact.events.index(("close", 1)) + 1][1]))
    told = {f"n-balls-{name}": v for name, v in zip(("low", "mid", "high"), met, strict=True)}
    CHAPTER.tells(told)
    assert CHAPTER.glued["n-balls-move-fig8"] == RULES.glued["n-balls-move-fig8"]
    assert np.ptp(ends, axis=0).max() <= float(CHAPTER.glued["n-balls-move-fig8"]) + 5e-4
    ends = [truth.solve(*chain, "0.1", meeting=k / 40, number=float).velocities for k in range(41)]
    RULES.tells({"n-balls-move-paper": np.ptp(floats(np.ravel(ends)).reshape(41, 4), 0).max()})


def test_answers_of_the_live_cradle():
    """Ratio 0: equal elastic balls exchange velocities; the ratio at which ball 2 is fastest."""
    v, seen = [1, 0.5, 0, 0], []
    for contacts in ((0,), (1,), (0, 2), (1,)):
        for c in contacts:
            assert v[c] > v[c + 1]
            v[c : c + 2] = v[c + 1], v[c]
        seen.append(", ".join(f"{x:g}" for x in v))
    text = CHAPTER.cells["live-cradle"].source
    places = [text.index(velocities) for velocities in seen]
    assert places == sorted(places)
    assert v == sorted(v)

    def run(ratio):
        return truth.solve([1] * 4, [1, "0.5", 0, 0], 1, ratio, number=float)

    low, high = 0.3, 0.35  # the last ratio at which the runs meet, by bisection
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (middle, high) if run(middle).meetings else (low, middle)
    most = float(run(low).velocities[1])
    CHAPTER.tells({"n-balls-fastest-ratio": low, "n-balls-fastest": most})
    for k in range(51):
        assert (run(k / 100).meetings > 0) == (k / 100 < low)
        assert run(k / 100).velocities[1] < most
    assert float(run(high).velocities[2]) == pytest.approx(most, abs=1e-6)  # equally fast


def test_where_the_second_of_two_strikers_turns():
    """Two strike three, elastic; below this ratio the second striker goes back, too."""
    turns = float(CHAPTER.glued["n-balls-turns"])
    for ratio in (turns - 0.01, turns + 0.01, *np.arange(1, 50) / 100):
        run = truth.solve([1] * 5, [1, 1, 0, 0, 0], 1, ratio, number=float)
        first, second, middle, *_ = run.velocities
        assert first < 0 < middle
        assert abs(ratio - turns) < 0.009 or (second < 0) == (ratio < turns)


def test_fig_8_meeting_moves_two_of_ten_sequences():
    moved = {}
    for name in paper_sequences():
        chain, model = paper_chain(name, excess="saturate")
        ratios, balls = (model.forward, model.backward), (chain.masses, chain.velocities)
        ends = []
        for meeting in np.linspace(0, 1, 5).tolist():
            model = ImpulseCorrelation(*ratios, meeting=meeting, excess="saturate")
            ends.append(collide(chain, model).velocities)
            exact = truth.solve(
                *balls, list(chain.restitution), *ratios, meeting=meeting, number=float
            )
            np.testing.assert_allclose(ends[-1], exact.velocities, atol=1e-12)
        moved[name] = np.ptp(ends, axis=0).max()
    assert {name for name, size in moved.items() if size > 0} == {"ABCCAB", "BCACBA"}
    for chapter, name in (RULES, "n-balls-ten-move"), (Chapter("experiments"), "moved"):
        chapter.tells({name: max(moved.values())})
    ends = [
        truth.solve([1] * 5, [1, 1, 0, 0, 0], 1, "0.15", meeting=k / 40, number=float).velocities
        for k in range(41)
    ]
    RULES.tells({"n-balls-toy-move": np.ptp(floats(np.ravel(ends)).reshape(41, 5), 0).max()})
    assert Chapter("errata").glued["meeting-toy"] == RULES.glued["n-balls-toy-move"]
    lines = [row.split() for row in RULES.printed("meeting-cell").splitlines()[4:]]
    stored = {row[0]: number(row[-1]) for row in lines}
    assert stored == pytest.approx({k: v for k, v in moved.items() if v > 0}, rel=0.02)
    assert RULES.glued["n-balls-unmoved"] == "eight"
