"""The rules of an impact, to be read first: how a chain of touching balls parts.

Rules R1 to R8 of the book's chapter on N balls, one short function each, for numbers of any type.
R9 is left out: an infinite sequence of impacts ends in an `EventLimit`.  `cradle.kernel` runs the
same rules fast, and goes to the limit of such a sequence.

Contact c joins balls c and c + 1.  Its closing speed is u = v[c] - v[c + 1]: above 0 in compression,
below 0 in restitution.  Inside a run of active contacts there is no time, only progress s.  Between
two events velocities are linear and works quadratic in s: every event is the root of a formula.
Nothing guards against rounding but this: a closing speed that is zero by construction is stored as
zero, and events of one run that coincide but for the last digits coincide.
"""

import math
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from typing import Any, NamedTuple

Number = Any  # float, Fraction, mpf: whatever adds, multiplies, divides and compares
FORWARD, BACKWARD = 1, -1
TIE = 1e-9  # R8: meetings, or distances, this close are a tie, and the left one wins


class Outcome(NamedTuple):
    """What an impact leaves; see `cradle.Trace`."""

    velocities: list[Number]
    impulses: list[Number]
    absorbed: list[Number]
    collisions: list[int]
    events: list[tuple[str, int]]
    path: list[list[Number]]
    path_impulses: list[list[Number]]
    held: list[int]


class EventLimit(RuntimeError):
    """The impact went on beyond `max_events`; `args` are a message and the outcome so far."""


@dataclass
class Contact:
    """What a contact remembers."""

    u: Number  # closing speed
    e: Number  # coefficient of restitution
    active: bool = False
    gained: Number = 0  # W+, work absorbed since it became active
    given: Number = 0  # W-, work released since it became active
    distance: Number = 0  # |u| at the start of the last segments, or at its own end since then
    impulse: Number = 0  # P, of the whole impact, as are the next two
    absorbed: Number = 0
    collisions: int = 0

    def store(self) -> Number:
        return self.e * self.e * self.gained - self.given  # Q, what it can still release


@dataclass
class Run:
    """R1: a maximal stretch of active contacts, on its way to its own next event."""

    first: int
    last: int
    rate: dict[int, Number] = field(default_factory=dict)  # by contact: dP/ds
    pull: dict[int, Number] = field(default_factory=dict)  # by ball: dv/ds
    bound: dict[int, bool] = field(default_factory=dict)  # contacts at their bound: held by it?
    length: Number = None  # progress up to its next event
    events: list[tuple[str, int, Number]] = field(default_factory=list)  # there: kind, contact, u

    def slope(self, c: int) -> Number:
        return 0 if c in self.bound else self.pull.get(c, 0) - self.pull.get(c + 1, 0)  # du/ds


class Impact:
    """A chain on its way from the first touch to the last separation."""

    def __init__(self, m: list[Number], v: list[Number], e: list[Number]) -> None:
        self.m, self.v = m, list(v)
        self.zero, self.one = 0 * m[0], m[0] / m[0]
        self.last_digits = 64 * abs(3 * (4 * self.one / 3 - 1) - 1)  # 0 if numbers are exact
        self.contact = [Contact(a - b, e) for (a, b), e in zip(pairwise(v), e, strict=True)]
        self.direction = [0] * len(m)  # by ball: of the drive between its two contacts
        self.held: set[int] = set()
        self.events: list[tuple[str, int]] = []
        self.path, self.path_impulses = [list(v)], [[self.zero] * len(e)]

    def active(self, c: int) -> bool:
        return 0 <= c < len(self.contact) and self.contact[c].active

    def is_gap(self, c: int) -> bool:
        return not self.active(c) and self.active(c - 1) and self.active(c + 1)

    def beside(self, run: Run) -> list[int]:
        """Idle contacts that border on this run alone."""
        ends = run.first - 1, run.last + 1
        return [c for c in ends if 0 <= c < len(self.contact) and not self.is_gap(c)]

    def record(self, kind: str, c: int) -> None:
        self.events.append((kind, c))
        self.path.append(list(self.v))
        self.path_impulses.append([x.impulse for x in self.contact])

    def start(self) -> None:
        """R2: where balls touch, the leftmost approaching contact drives all others."""
        for _, group in groupby(range(len(self.contact)), lambda c: self.contact[c].u >= 0):
            touching = list(group)
            source = next((c for c in touching if self.contact[c].u > 0), None)
            for c in touching if source is not None else []:
                self.contact[c].active, self.contact[c].collisions = True, 1
                if c > touching[0]:
                    self.direction[c] = FORWARD if c > source else BACKWARD

    def ratios_in_force(self, run: Run) -> dict[int, Number]:
        """R7: a driven contact at u = 0 that has absorbed nothing cannot open: Eqs. 34, 53.

        Each drive is worked out from its far end.  A contact driven from both sides is not bound.
        """
        ratio: dict[int, Number] = {}
        inner = range(run.first + 1, run.last + 1)
        for way, balls in ((FORWARD, inner[::-1]), (BACKWARD, inner)):
            for i in (i for i in balls if self.direction[i] == way):
                ratio[i] = self.ratio[way][i]
                far, driven = i + way, i if way == FORWARD else i - 1
                x = self.contact[driven]
                if x.u == x.gained == x.given == 0 and self.direction[far] != -way:
                    bound = self.m[far] / (self.m[far] + self.m[i] * (1 - ratio.get(far, 0)))
                    if ratio[i] >= bound:
                        run.bound[driven] = ratio[i] > bound
                        ratio[i] = bound
        return ratio

    def run(self, first: int, last: int) -> Run:
        """R1: one ratio at each inner ball fixes all impulse rates but for a common factor.

        R6: all ratios of zero are one vanishing number, and a rate is a size times a power of it.
        Only the lowest power has a rate in the limit; the largest of these rates is 1.
        """
        run = Run(first, last)
        ratio = self.ratios_in_force(run)
        size, power = {first: self.one}, {first: 0}
        for i in range(first + 1, last + 1):
            way, factor = self.direction[i], ratio[i] or self.one
            size[i] = size[i - 1] * factor if way == FORWARD else size[i - 1] / factor
            power[i] = power[i - 1] + (0 if ratio[i] else way)
        leading = [c for c in size if power[c] == min(power.values())]
        largest = max(size[c] for c in leading)
        run.rate = {c: size[c] / largest if c in leading else self.zero for c in size}
        for i in range(first, last + 2):  # Eqs. 47-48
            run.pull[i] = (run.rate.get(i - 1, 0) - run.rate.get(i, 0)) / self.m[i]
        return run

    def is_over(self, x: Contact, slope: Number) -> bool:
        """R3: nothing is left to release, and u is, or would become, negative; or e = 0 at u = 0."""
        opens = x.u < 0 or (x.u == 0 and slope < 0)
        return (opens and x.store() <= 0) or bool(x.e == 0 and x.u == 0 and x.gained > 0)

    def way_to_end(self, x: Contact, rate: Number, slope: Number) -> list[Number]:
        """R3: progress until all is released, and u there; none if nothing leads there.

        While u < 0, the store changes by the integral of u dP = rate (u s + slope s^2 / 2).
        """
        if rate == 0 or (x.u >= 0 and slope >= 0):
            return []
        store, u, way = x.store(), x.u, self.zero
        if u > 0:  # first it goes to u = 0
            way = -u / slope
            store, u = store + x.e * x.e * rate * u * way / 2, self.zero
        square = u * u - 2 * slope * max(store, self.zero) / rate
        if u < 0 and square <= 0:
            return []  # it is compressed again before that
        last = -(square.sqrt() if hasattr(square, "sqrt") else math.sqrt(square))
        return [way - 2 * store / rate / (u + last) if last else way, last]

    def end(self, c: int) -> None:
        """R4: the relations of a contact go with it; what it drove goes on by itself."""
        self.contact[c].active, self.contact[c].distance = False, abs(self.contact[c].u)
        self.direction[c] = self.direction[c + 1] = 0
        self.record("end", c)

    def closings(self, runs: list[Run]) -> list[int]:
        """R5: the idle contacts at u = 0 that are about to rise.

        R8.6: of two on one free ball the nearer closes, at a tie the left; the other is a gap then.
        """
        beside = [(c, run) for run in runs for c in self.beside(run)]
        due = [c for c, run in beside if self.contact[c].u >= 0 and run.slope(c) > 0]
        for c in [c for c in due if c + 1 in due]:
            one, other = self.contact[c].distance, self.contact[c + 1].distance
            due.remove(c if other < one * (1 - TIE) else c + 1)
        return due

    def close(self, c: int) -> None:
        """R4, R8.5: a contact that closes is driven by those that are active beside it."""
        x = self.contact[c]
        x.u = x.gained = x.given = self.zero
        x.active, x.collisions = True, x.collisions + 1
        self.direction[c] = FORWARD if self.active(c - 1) else 0
        self.direction[c + 1] = BACKWARD if self.active(c + 1) else 0
        self.record("close", c)

    def plan(self, run: Run) -> None:
        """R8.2: a run goes straight on to its own next event, an end or a closing beside it."""
        found = []
        for c in range(run.first, run.last + 1):
            if end := self.way_to_end(self.contact[c], run.rate[c], run.slope(c)):
                found.append((end[0], ("end", c, end[1])))
        for c in self.beside(run):
            if run.slope(c) > 0:
                found.append((-self.contact[c].u / run.slope(c), ("close", c, self.zero)))
        run.length = min(s for s, _ in found)
        run.events = [event for s, event in found if s <= run.length * (1 + self.last_digits)]

    def parts_to_meeting(self, g: int, left: Run, right: Run) -> list[Number]:
        """R8.3: the parts of their segments after which two runs meet; none if they need not.

        Seen from the left ball of their gap, it goes from velocity 0 to p, the right one from q to r.
        """
        p, q = left.pull[g] * left.length, -self.contact[g].u
        r = q + right.pull[g + 1] * right.length
        if p <= r:
            return []
        low, high = max(self.zero, r), min(p, q)
        at = high if self.meeting == 1 else low + self.meeting * (high - low)
        parts = [at / p if p else self.zero, (at - q) / (r - q) if r != q else self.zero]
        return [self.one if part >= 1 - self.last_digits else part for part in parts]

    def first_meeting(self, runs: list[Run]) -> tuple[int, list[tuple[Run, Number]]]:
        """R8.4: the gap that is reached first, and which runs go how far to it; -1 if none must.

        Its larger part is the least, at a tie its smaller part; at a tie of these it is the left.
        But a gap that one of its runs would be carried past closes first, with that run alone.
        """
        met = [
            (a.last + 1, [*zip((a, b), parts)])
            for a, b in pairwise(runs)
            if b.first == a.last + 2 and (parts := self.parts_to_meeting(a.last + 1, a, b))
        ]
        if not met:
            return -1, [(run, self.one) for run in runs]
        for key in (max, min):
            least = min(key(part for _, part in moves) for _, moves in met)
            met = [(g, moves) for g, moves in met if key(part for _, part in moves) <= least + TIE]
        gap, moves = met[0]
        passed = []
        for run, part in moves:
            c = run.first - 1 if run.first < gap else run.last + 1
            u, change = self.contact[c].u if self.is_gap(c) else 0, run.slope(c) * run.length
            if u + part * change > 0 and self.is_gap(c):
                passed.append((-u / change, c, run))
        if not passed:
            return gap, moves
        part, gap, run = min(passed, key=lambda found: found[:2])
        return gap, [(run, part)]

    def advance(self, run: Run, part: Number) -> None:
        """Take a run through a part of its segment; what is zero there is stored as zero."""
        goal, done = run.length * part, self.zero
        speeds = [(c, self.contact[c].u, run.slope(c)) for c in run.rate]
        stops = sorted((-u / slope, c) for c, u, slope in speeds if u * slope < 0)
        stops = [(min(s, goal), c) for s, c in stops if s <= goal * (1 + self.last_digits)]
        for s, c in stops:
            self.move(run, s - done)
            done, self.contact[c].u = s, self.zero
            if run.slope(c) < 0:
                self.record("maximum_compression", c)
        self.move(run, goal - done)
        for kind, c, u in run.events if part == 1 else []:
            x = self.contact[c]
            x.u, x.given = u, x.e * x.e * x.gained if kind == "end" else x.given
        self.held |= {c for c in run.bound if run.bound[c] and goal * run.rate[c] > 0}

    def move(self, run: Run, s: Number) -> None:
        """Straight progress: velocities are linear, works quadratic; no u changes its sign."""
        for i in run.pull:
            self.v[i] += run.pull[i] * s
        for c in range(max(run.first - 1, 0), min(run.last + 2, len(self.contact))):
            x = self.contact[c]
            before, x.u = x.u, x.u + run.slope(c) * s
            if c in run.rate:
                work = run.rate[c] * s * (before + x.u) / 2
                x.impulse += run.rate[c] * s
                x.gained += max(work, 0)
                x.absorbed += max(work, 0)
                x.given -= min(work, 0)

    def collapse(self) -> bool:
        """R9 has its place here: whether contacts ended because only endless chatter is left."""
        return False

    def round(self) -> bool:
        """R8.1: ends that are due, else closings, else a collapse, else progress (R8.2-6)."""
        contacts = range(len(self.contact))
        stretches = [list(group) for _, group in groupby(contacts, self.active)]
        runs = [self.run(c[0], c[-1]) for c in stretches if self.active(c[0])]
        ends = [c for r in runs for c in r.rate if self.is_over(self.contact[c], r.slope(c))]
        if ends:
            for c in ends:
                self.end(c)
        elif closings := self.closings(runs):
            for c in closings:
                self.close(c)
        elif runs and not self.collapse():
            for run in runs:
                self.plan(run)
            gap, moves = self.first_meeting(runs)
            for x in self.contact:
                x.distance = abs(x.u)
            for run, part in moves:
                self.advance(run, part)
            if gap >= 0:
                self.close(gap)
        return bool(runs)

    def outcome(self) -> Outcome:
        one = self.contact
        works = [x.absorbed for x in one]
        return Outcome(
            self.v, self.path_impulses[-1], works, [x.collisions for x in one], self.events,
            self.path, self.path_impulses, sorted(self.held),
        )  # fmt: skip


def solve(
    masses, velocities, restitution, forward, backward=None, *, meeting=0.5, number=float,
    max_events=100_000, kind=Impact,
):  # fmt: skip
    """Solve."""
    n = len(masses)

    def spread(values: Any, size: int) -> list[Number]:
        many = [values] * size if isinstance(values, (int, float, str)) else values
        return [number(x) for x in many]

    impact = kind(spread(masses, n), spread(velocities, n), spread(restitution, n - 1))
    ahead, back = spread(forward, n - 2), spread(forward if backward is None else backward, n - 2)
    impact.ratio = {FORWARD: [0, *ahead, 0], BACKWARD: [0, *back, 0]}
    impact.meeting = number(meeting)
    impact.start()
    while impact.round():
        if len(impact.events) > max_events:
            raise EventLimit(f"more than max_events = {max_events} events", impact.outcome())
    return impact.outcome()
