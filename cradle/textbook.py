"""The rules of an impact, to be read first: how a chain of touching balls parts.

Rules R1 to R8 of the book, in numbers of any type: floats, or what `number` of `solve` makes.  R9
is left out: endless impacts go on to the last digits, or to an `EventLimit`.  Contact c joins balls
c and c + 1.  Its closing speed u = v[c] - v[c + 1] is above 0 in compression.  Inside a run there
is no time, only progress: velocities are linear and works quadratic in it, every event is the root
of a formula.  Of numbers six tenths of the digits tell a `tie` from a difference.
"""

import math
from itertools import groupby, pairwise
from typing import Any, NamedTuple

Number = Any  # float, mpf, or another type that can be calculated with and has a `sqrt`
FORWARD, BACKWARD = 1, -1


class EventLimit(RuntimeError):
    """The impact has more than about `max_events` events; `args`: a message, the state reached."""


class Run(NamedTuple):
    """A maximal stretch of active contacts, and its straight way to its own next event."""

    first: int
    last: int
    rate: dict[int, Number]  # by contact: dP/ds
    pull: dict[int, Number]  # by ball: dv/ds
    slope: dict[int, Number]  # by contact, idle neighbours too: du/ds
    bound: dict[int, bool]  # contacts that R7 keeps closed: whether they are held
    ahead: list[tuple[Number, Number, str, int]]  # progress to an event, u there, kind, contact
    length: Number  # progress to the first of these
    instant: Number  # progress in which closing speeds change by less than their last digits


class Impact:
    """A chain on its way from the first touch to the last separation, with the record of it."""

    def __init__(self, m: list[Any], v: list[Any], e: list[Any], ratio: Any, meeting: Any) -> None:
        self.m, self.e, self.meeting, self.zero = m, e, meeting, 0 * meeting
        rounding = abs(3 * ((self.zero + 4) / 3 - 1) - 1)  # of the number 1; none in exact numbers
        self.tie, self.small = int((float(rounding) or 1e-300) ** -0.6), 8 * rounding
        self.last_digits = self.small * max(abs(a - b) for a, b in pairwise(v))
        self.ratio, self.direction = ratio, [0] * len(m)  # by ball: who drives there, and how much
        self.velocities, self.u = list(v), [a - b for a, b in pairwise(v)]
        self.near = [abs(u) for u in self.u]  # |u| before the last segments, or at its end since
        self.active = [False] * len(m)  # one more than contacts, and active[-1]: nothing beyond
        self.gained, self.given = [self.zero] * len(e), [self.zero] * len(e)  # W+ and W-
        self.impulses, self.absorbed = [self.zero] * len(e), [self.zero] * len(e)  # P, all its W+
        self.collisions, self.events = [0] * len(e), list[tuple[str, int]]()
        self.held, self.path, self.path_impulses = set[int](), [list(v)], [list(self.impulses)]

    def record(self, kind: str, c: int) -> None:
        """Write down an event and the state there."""
        self.events.append((kind, c))
        self.path.append(list(self.velocities))
        self.path_impulses.append(list(self.impulses))

    def start(self) -> None:
        """R2: where balls touch, the leftmost approaching contact drives all others."""
        for _, group in groupby(range(len(self.u)), lambda c: bool(self.u[c] >= 0)):
            touching = list(group)
            if approaching := [c for c in touching if self.u[c] > 0]:
                for c in touching:
                    self.active[c], self.collisions[c] = True, 1
                for i in touching[1:]:
                    self.direction[i] = FORWARD if i > approaching[0] else BACKWARD

    def run(self, first: int, last: int) -> Run:
        """R1, R6: one ratio at each inner ball fixes all impulse rates but for a common factor."""
        balls, near = range(first, last + 2), range(max(first - 1, 0), min(last + 2, len(self.u)))
        ratio, bound = self.ratios_in_force(balls[1:-1])
        rates = {first: (0, self.zero + 1)}  # R6: zeros are one vanishing number, to a power
        for i in balls[1:-1]:
            way, factor, (power, size) = self.direction[i], ratio[i] or self.zero + 1, rates[i - 1]
            rates[i] = power - way * (ratio[i] == 0), size * factor**way
        top = max(rates.values())  # in the limit what has another power has no rate
        rate = {c: x / top[1] if k == top[0] else self.zero for c, (k, x) in rates.items()}
        pull = {i: (rate.get(i - 1, 0) - rate.get(i, 0)) / self.m[i] for i in balls}  # Eqs. 47-48
        slope = {c: 0 if c in bound else pull.get(c, 0) - pull.get(c + 1, 0) for c in near}
        ahead = self.look_ahead(rate, slope)
        instant = self.last_digits / max(map(abs, slope.values()))
        return Run(first, last, rate, pull, slope, bound, ahead, min(ahead)[0], instant)

    def ratios_in_force(self, inner: range) -> tuple[dict[int, Number], dict[int, bool]]:
        """R7: what one driver alone drives and has absorbed nothing cannot open: Eqs. 34, 53."""
        ratio, bound = dict[int, Number](), dict[int, bool]()
        for way, balls in ((FORWARD, inner[::-1]), (BACKWARD, inner)):  # from each drive's far end
            for i in (i for i in balls if self.direction[i] == way):
                far, c, ratio[i] = i + way, i if way == FORWARD else i - 1, self.ratio[way][i]
                if self.direction[far] != -way and self.u[c] == self.gained[c] == 0:
                    limit = self.m[far] / (self.m[far] + self.m[i] * (1 - ratio.get(far, 0)))
                    if ratio[i] >= (1 - self.small) * limit:
                        ratio[i], bound[c] = limit, ratio[i] > (1 + self.small) * limit
        return ratio, bound

    def look_ahead(self, rate: dict[int, Number], slope: dict[int, Number]) -> list[Any]:
        """R8.2: what comes on the straight way of a run: ends, and closings beside it (R5)."""
        found = [(self.way_to_end(c, rate[c], slope[c]), "end", c) for c in rate]
        for c in slope:  # one between two runs is a gap: R8.3
            beside_one = not self.active[c] and self.active[c - 1] != self.active[c + 1]
            if beside_one and (slope[c] > 0 or self.u[c] == 0):  # R6: what vanishes pushes, too
                found.append(((-self.u[c] / (slope[c] or 1), self.zero), "close", c))
        return [(*way, kind, c) for way, kind, c in found if way]

    def way_to_end(self, c: int, rate: Number, slope: Number) -> tuple[Number, ...]:
        """R3: progress until all is released and u < 0, and u there; none if it does not end."""
        u, e, way = self.u[c], self.e[c], self.zero
        store = max(e * e * self.gained[c] - self.given[c], self.zero)
        driven = self.direction[c] == FORWARD or self.direction[c + 1] == BACKWARD
        if store == 0 and (u < 0 or (u == 0 and (not driven or (e == 0 and self.gained[c] > 0)))):
            return way, u
        if rate == 0 or (u >= 0 and slope >= 0):
            return ()
        if u > 0:  # first it goes to u = 0
            way = -u / slope
            store, u = store + e * e * rate * u * way / 2, self.zero
        # While u < 0, the store changes by the integral of u dP = rate (u s + slope s^2 / 2).
        square = u * u - 2 * slope * store / rate
        if u < 0 and square <= self.small * u * u:
            return ()  # it is compressed again before that
        last = -(square.sqrt() if hasattr(square, "sqrt") else math.sqrt(square))
        return way - 2 * store / rate / (u + last) if last else way, last

    def end(self, c: int) -> None:
        """R4: the relations of a contact go with it; what it drove goes on by itself."""
        self.active[c], self.near[c], self.direction[c : c + 2] = False, abs(self.u[c]), (0, 0)
        self.record("end", c)

    def close(self, c: int) -> None:
        """R4, R8.5: a contact that closes is driven by those that are active beside it."""
        self.u[c] = self.gained[c] = self.given[c] = self.zero
        self.active[c], self.collisions[c] = True, self.collisions[c] + 1
        self.direction[c] = FORWARD * self.active[c - 1]
        self.direction[c + 1] = BACKWARD * self.active[c + 1]
        self.record("close", c)

    def goes_first(self, c: int, due: list[int]) -> bool:
        """R8.6: of two closings on one free ball the nearer goes first, at a tie the left one."""
        left = c if c + 1 in due else c - 1
        nearer = self.tie * self.near[left + 1] < (self.tie - 1) * self.near[left]
        return left not in due or nearer == (c > left)

    def parts_to_meeting(self, left: Run, right: Run) -> list[Number]:
        """R8.3: the parts of their segments after which two runs meet; none if they need not."""
        # Seen from the left ball of the gap: it goes from velocity 0 to p, the right from q to r.
        p, q = left.pull[right.first - 1] * left.length, -self.u[right.first - 1]
        r = q + right.pull[right.first] * right.length
        if p - r <= self.last_digits and q:
            return []
        at = (1 - self.meeting) * max(self.zero, r) + self.meeting * min(p, q)
        ways = (left, at, p), (right, min(q - at, q - r), q - r)  # no farther than it goes
        parts = [(run, x / whole if x > self.last_digits else self.zero) for run, x, whole in ways]
        return [1 if (1 - x) * run.length <= run.instant else x for run, x in parts]

    def first_meeting(self, runs: list[Run]) -> tuple[int, list[tuple[Run, Number]]]:
        """R8.4: the gap that is reached first, and who goes how far to it; -1 if none is met."""
        pairs = [(a, b) for a, b in pairwise(runs) if b.first == a.last + 2]
        met = [(pair, parts) for pair in pairs if (parts := self.parts_to_meeting(*pair))]
        if not met:
            return -1, [(run, 1) for run in runs]  # R8.6
        for key in (max, min):  # the larger part is the least, at a tie the smaller; then the left
            least = min(key(parts) for _, parts in met)
            met = [(pair, parts) for pair, parts in met if self.tie * (key(parts) - least) <= 1]
        (left, right), parts = met[0]
        # But a gap that one of the two would be carried past closes first, with that run alone.
        gaps, passed = [b.first - 1 for _, b in pairs], []
        for run, part, c in (left, parts[0], left.first - 1), (right, parts[1], right.last + 1):
            change = run.slope.get(c, 0) * run.length
            if c in gaps and self.u[c] + change * part > self.last_digits:
                passed.append((-self.u[c] / change, c, [(run, -self.u[c] / change)]))
        if not passed:
            return left.last + 1, [(left, parts[0]), (right, parts[1])]
        return passed[-1 if self.tie * (passed[0][0] - passed[-1][0]) > 1 else 0][1:]

    def advance(self, run: Run, part: Number) -> None:
        """Take a run through a part of its segment; what is zero there is stored as zero."""
        goal, here = run.length * part, self.zero
        stops = [(-self.u[c] / run.slope[c], c) for c in run.rate if self.u[c] * run.slope[c] < 0]
        for s, c in sorted(stop for stop in stops if stop[0] <= goal + run.instant):
            self.move(run, min(s, goal) - here)
            here, self.u[c] = min(s, goal), self.zero
            if run.slope[c] < 0:
                self.record("maximum_compression", c)
        self.move(run, goal - here)
        self.u = [u if abs(u) > self.last_digits else self.zero for u in self.u]
        for s, u, _, c in run.ahead if part == 1 else []:
            if s <= goal + run.instant:
                self.u[c], self.given[c] = u, self.e[c] * self.e[c] * self.gained[c]
        self.held |= {c for c, held in run.bound.items() if held and goal * run.rate[c] > 0}

    def move(self, run: Run, s: Number) -> None:
        """Straight progress: velocities are linear, works quadratic; no u changes its sign."""
        for i, pull in run.pull.items():
            self.velocities[i] += pull * s
        for c, slope in run.slope.items():
            before, self.u[c] = self.u[c], self.u[c] + slope * s
            if c in run.rate:
                self.impulses[c] += run.rate[c] * s
                work = run.rate[c] * s * (before + self.u[c]) / 2
                self.gained[c] += max(work, 0)
                self.absorbed[c] += max(work, 0)
                self.given[c] -= min(work, 0)

    def progress(self, runs: list[Run]) -> None:
        """R8: on to the first gap that must close; if there is none, every run to its own event."""
        (gap, moves), self.near = self.first_meeting(runs), [abs(u) for u in self.u]
        for run, part in moves:
            self.advance(run, part)
        if gap >= 0:
            self.close(gap)

    def round(self) -> bool:
        """R8.1: what is due at once, ends before closings; else progress; False if all is idle."""
        groups = [list(group) for _, group in groupby(range(len(self.u)), self.active.__getitem__)]
        runs = [self.run(group[0], group[-1]) for group in groups if self.active[group[0]]]
        due = [(kind, c) for run in runs for s, _, kind, c in run.ahead if s <= 0]
        ends = [c for kind, c in due if kind == "end"]
        closings = [c for kind, c in due if not ends]
        for c in ends:
            self.end(c)
        for c in [c for c in closings if self.goes_first(c, closings)]:
            self.close(c)
        if runs and not due:
            self.progress(runs)  # R9 has its place before this
        return bool(runs)


def solve(
    masses: Any, velocities: Any, restitution: Any, forward: Any, backward: Any = None, *,
    meeting: Any = 0.5, number: Any = float, max_events: int = 100_000, impact: Any = Impact,
) -> Impact:  # fmt: skip
    """Return an impact after R1 to R8; arguments, unchecked, as for `Chain`, `ImpulseCorrelation`.

    Examples
    --------
    >>> from cradle.textbook import solve
    >>> solve([1, 1, 1], [1, 0, 0], 1, 0.5).events
    [('maximum_compression', 0), ('end', 0), ('end', 1)]
    """
    n, back = len(masses), forward if backward is None else backward
    sizes = (masses, n), (velocities, n), (restitution, n - 1), (forward, n - 2), (back, n - 2)
    lists = [[x] * k if isinstance(x, str) or not hasattr(x, "__len__") else x for x, k in sizes]
    m, v, e, f, b = ([number(x) for x in values] for values in lists)
    state: Impact = impact(m, v, e, {FORWARD: [0, *f, 0], BACKWARD: [0, *b, 0]}, number(meeting))
    state.start()
    for _ in range(2 * max_events):  # an event takes a round to get there, and one of its own
        if not state.round():
            return state
    raise EventLimit(f"not finished within max_events = {max_events} events", state)
