"""An independent, slow and plain solver of the impact rules, to compare the package with.

It shares no code with the package. Every round looks at the chain afresh: it finds the runs, their
ratios in force, their rates and their next events, and keeps nothing for later. The number type is
free: ``mpmath.mpf`` for ground truth, ``float`` for many random chains. Rules R1 to R9 are named
where they act.
"""

import math
import sys
from dataclasses import dataclass
from itertools import groupby
from types import SimpleNamespace

import mpmath


@dataclass
class Contact:
    """What a contact remembers: closing speed, impulse, works since it became active."""

    u: object
    e: object
    zero: object
    active: bool = False
    impulse: object = None
    gained: object = None  # W+, work absorbed since it became active
    given: object = None  # W-, work released since it became active
    absorbed: object = None  # W+ of all its collisions
    collisions: int = 0

    def __post_init__(self):
        self.impulse = self.gained = self.given = self.absorbed = self.zero

    @property
    def store(self):
        """Q, the work it can still release."""
        return self.e * self.e * self.gained - self.given

    @property
    def untouched(self):
        """At u = 0 with nothing absorbed since it closed: the state that R7 may hold."""
        return self.u == 0 and self.gained == 0 and self.given == 0


@dataclass
class Run:
    """Active contacts first..last, with their rates on the way to the next event."""

    first: int
    last: int
    rate: dict  # contact -> dP/ds; largest is 1
    acceleration: dict  # ball -> dv/ds
    held: set  # contacts below their nominal ratio
    still: set  # closing speed constant by construction: held, or at the bound
    events: list = None  # (kind, contact, closing speed there), simultaneous
    length: object = None  # progress of its segment

    @property
    def contacts(self):
        return range(self.first, self.last + 1)

    def closing_rate(self, c):
        """du/ds of contact c, whether it belongs to the run or borders on it."""
        if c in self.still:
            return 0
        return self.acceleration.get(c, 0) - self.acceleration.get(c + 1, 0)

    def stretch(self, c):
        """Change of the closing speed of contact c over the whole segment."""
        return self.closing_rate(c) * self.length


class EventLimit(RuntimeError):
    """More events than allowed; `.outcome` holds what was reached."""


def check_ratios(name, masses, ratios, slack):
    """Eq. 53 for a chain driven from left to right; the mirror image goes in reversed."""
    onward = 0
    for i in reversed(range(1, len(masses) - 1)):
        bound = masses[i + 1] / (masses[i + 1] + masses[i] * (1 - onward))
        onward = ratios[i]
        if onward > bound * (1 + slack):
            ball = i if name == "forward" else len(masses) - 1 - i
            raise ValueError(f"{name}[{ball - 1}] = {onward}; bound at ball {ball} is {bound}")


class Impact:
    """One chain on its way from the first contact to the last separation."""

    def __init__(self, masses, velocities, restitution, ratio, meeting, number, collapse_below):
        self.zero, self.one = number(0), number(1)
        self.sqrt = mpmath.sqrt if number is mpmath.mpf else math.sqrt
        eps = mpmath.mp.eps if number is mpmath.mpf else sys.float_info.epsilon
        self.tie = 64 * eps  # simultaneous, for the events of one run
        self.n, self.m, self.v = len(masses), masses, list(velocities)
        self.ratio, self.meeting = ratio, meeting  # ratio["forward"][ball], ratio["backward"][ball]
        closing = [a - b for a, b in zip(velocities, velocities[1:])]
        self.contact = [Contact(u, e, self.zero) for u, e in zip(closing, restitution)]
        self.direction = [None] * self.n  # of an interior ball between two active contacts
        self.reduced = [a * b / (a + b) for a, b in zip(masses, masses[1:])]
        self.events, self.path, self.path_impulses = [], [], []
        self.held, self.collapsed = set(), False
        self.meetings = self.recompressions = 0
        self.distance = [abs(x.u) for x in self.contact]  # |u| at the start of the last round that
        # made progress, or at the contact's own end since then
        # R9: largest squared speed since the last event of a contact; its events in a row with this
        # below `tiny`; the contacts of the latest events as long as all of these were calm.
        self.tiny = (collapse_below * max([*closing, self.zero])) ** 2
        self.peak = [self.speed_squared(c) for c in range(self.n - 1)]
        self.calm, self.streak = [0] * (self.n - 1), []
        self.record()

    # --- bookkeeping -----------------------------------------------------------------------

    def record(self, kind=None, c=None):
        if kind:
            self.events.append((kind, c))
        self.path.append(list(self.v))
        self.path_impulses.append([x.impulse for x in self.contact])

    def speed_squared(self, c):
        """Larger of closing speed and speed equivalent of the store, squared."""
        x = self.contact[c]
        return max(x.u * x.u, 2 * x.store / self.reduced[c])

    def watch(self, c):
        """R9: count the consecutive events of a contact that has become exhausted."""
        self.calm[c] = self.calm[c] + 1 if self.peak[c] < self.tiny else 0
        self.peak[c] = self.speed_squared(c)
        self.streak = [*self.streak, c] if self.calm[c] > 4 else []

    def exhausted(self, c):
        return self.calm[c] > 0 and max(self.peak[c], self.speed_squared(c)) < self.tiny

    def is_gap(self, c):
        """Idle, and both neighbours active (R8)."""
        inside = 0 < c < self.n - 2 and not self.contact[c].active
        return inside and self.contact[c - 1].active and self.contact[c + 1].active

    # --- changes of state ------------------------------------------------------------------

    def start(self):
        """R2."""
        c = 0
        while c < self.n - 1:
            stretch = []
            while c < self.n - 1 and self.contact[c].u >= 0:
                stretch.append(c)
                c += 1
            source = next((k for k in stretch if self.contact[k].u > 0), None)
            if source is not None:
                for k in stretch:
                    self.contact[k].active = True
                    self.contact[k].collisions = 1
                for ball in stretch[1:]:
                    self.direction[ball] = "forward" if ball > source else "backward"
            c += 1

    def end(self, c):
        """R3, R4: its relations go."""
        x = self.contact[c]
        x.active = False
        self.distance[c] = abs(x.u)
        self.direction[c] = self.direction[c + 1] = None
        self.record("end", c)
        self.watch(c)

    def close(self, c):
        """R5 and the directions of R4: from what was active to the new contact."""
        x = self.contact[c]
        x.u = x.gained = x.given = self.zero
        x.active = True
        x.collisions += 1
        if c > 0 and self.contact[c - 1].active:
            self.direction[c] = "forward"
        if c < self.n - 2 and self.contact[c + 1].active:
            self.direction[c + 1] = "backward"
        self.record("close", c)
        self.watch(c)

    # --- runs and rates (R1, R6, R7) -------------------------------------------------------

    def runs(self):
        found, c = [], 0
        while c < self.n - 1:
            first = c
            while c < self.n - 1 and self.contact[c].active:
                c += 1
            if c > first:
                found.append(self.run(first, c - 1))
            c += 1
        return found

    def ratios_in_force(self, first, last):
        """R7: ratio at every interior ball of a run, and the contacts at or above their bound."""
        m, way = self.m, self.direction
        ratio = {i: self.ratio[way[i]][i] for i in range(first + 1, last + 1)}
        held, still = set(), set()

        def limit(ball, driven, far, beyond):
            """Ball between driver and driven contact; far ball; the next ball to relate to."""
            if not self.contact[driven].untouched:
                return
            if beyond in ratio and way[beyond] != way[ball]:
                return  # driven from both sides: nothing can open it
            onward = ratio.get(beyond, self.zero)
            bound = m[far] / (m[far] + m[ball] * (1 - onward))
            if ratio[ball] >= bound:
                still.add(driven)
                if ratio[ball] > bound:
                    held.add(driven)
                ratio[ball] = bound

        for i in range(last, first, -1):
            if way[i] == "forward":
                limit(i, i, i + 1, i + 1)
        for i in range(first + 1, last + 1):
            if way[i] == "backward":
                limit(i, i - 1, i - 1, i - 1)
        return ratio, held, still

    def run(self, first, last):
        ratio, held, still = self.ratios_in_force(first, last)
        # Rates as coefficient times a power (order) of the vanishing ratio: R6.
        rate = {first: (0, self.one)}
        for i in range(first + 1, last + 1):
            order, size = rate[i - 1]
            down = self.direction[i] == "forward"
            if ratio[i] == 0:
                rate[i] = (order + 1 if down else order - 1, size)
            else:
                rate[i] = (order, size * ratio[i] if down else size / ratio[i])
        lead = min(order for order, _ in rate.values())
        top = max(size for order, size in rate.values() if order == lead)
        rate = {c: size / top if order == lead else self.zero for c, (order, size) in rate.items()}
        acceleration = {
            i: (rate.get(i - 1, self.zero) - rate.get(i, self.zero)) / self.m[i]
            for i in range(first, last + 2)
        }
        return Run(first, last, rate, acceleration, held, still)

    # --- next event of a run ---------------------------------------------------------------

    def ends_now(self, run, c):
        """R3 without progress."""
        x = self.contact[c]
        if x.e == 0 and x.u == 0 and x.gained > 0:
            return True
        return x.store <= 0 and (x.u < 0 or (x.u == 0 and run.closing_rate(c) < 0))

    def neighbours(self, run):
        """Idle contacts that border on this run alone."""
        beside = (run.first - 1, run.last + 1)
        return [c for c in beside if 0 <= c < self.n - 1 and not self.is_gap(c)]

    def time_to_end(self, run, c):
        """Progress until R3 ends a contact and its closing speed then; None if it does not end.

        With u = u0 - k s, dP = r ds, the work from speed u0 to speed u is r (u0^2 - u^2) / (2 k).
        """
        x, r, k = self.contact[c], run.rate[c], -run.closing_rate(c)
        if r == 0:
            return None
        if x.u >= 0:
            if k <= 0:
                return None
            store = x.e * x.e * (x.gained + r * x.u * x.u / (2 * k)) - x.given
            final = self.zero if x.e == 0 else -self.sqrt(2 * k * max(store, self.zero) / r)
            return (x.u - final) / k, final
        square = x.u * x.u + 2 * k * x.store / r
        if k < 0 and square <= 0:
            return None  # it turns into compression again
        final = -self.sqrt(square)
        return 2 * x.store / r / -(x.u + final), final

    def plan(self, run):
        """R8.2: the segment of a run and the simultaneous events at its end, ends first."""
        found = []
        for c in run.contacts:
            end = self.time_to_end(run, c)
            if end is not None:
                found.append((end[0], ("end", c, end[1])))
        for c in self.neighbours(run):
            k = run.closing_rate(c)
            if k > 0:
                found.append((-self.contact[c].u / k, ("close", c, self.zero)))
        if not found:
            raise AssertionError(f"run {run} has no event")
        run.length = min(s for s, _ in found)
        run.events = [event for s, event in found if s <= run.length * (1 + self.tie)]

    # --- progress --------------------------------------------------------------------------

    def move(self, run, s):
        """Straight progress by s, during which no closing speed of the run changes its sign."""
        for i, a in run.acceleration.items():
            self.v[i] += a * s
        for c in range(max(run.first - 1, 0), min(run.last + 2, self.n - 1)):
            x = self.contact[c]
            before, x.u = x.u, x.u + run.closing_rate(c) * s
            if x.active:
                work = run.rate[c] * s * (before + x.u) / 2
                x.impulse += run.rate[c] * s
                if work > 0:
                    x.gained += work
                    x.absorbed += work
                    self.recompressions += x.given > 0
                else:
                    x.given -= work
            self.peak[c] = max(self.peak[c], self.speed_squared(c))

    def advance(self, run, s):
        """Straight progress by s, stopping where a closing speed passes zero."""
        stops = []
        for c in run.contacts:
            u, k = self.contact[c].u, run.closing_rate(c)
            if u * k < 0 and -u / k <= s:
                stops.append((-u / k, c, u > 0))
        done = self.zero
        for stop, c, compressed in sorted(stops):
            self.move(run, stop - done)
            self.contact[c].u = self.zero
            if compressed:
                self.record("maximum_compression", c)
            done = stop
        self.move(run, s - done)
        if s > 0:
            self.held |= {c for c in run.held if run.rate[c] > 0}

    def complete(self, run):
        """Go to the end of the segment; what happens there is exact by construction."""
        self.advance(run, run.length)
        for kind, c, u in run.events:
            x = self.contact[c]
            x.u = u
            if kind == "end":
                x.given = x.e * x.e * x.gained

    # --- rounds (R8, R9) -------------------------------------------------------------------

    def gap_meeting(self, g, left, right):
        """R8.3: fractions of the two segments at which the balls of a gap meet, or None."""
        # Velocities are counted from that of the left ball, so that a stored zero stays one.
        p0, q0 = self.zero, -self.contact[g].u
        p1, q1 = left.acceleration[g] * left.length, q0 + right.acceleration[g + 1] * right.length
        if not p1 > q1:
            return None
        lo, hi = max(min(p0, p1), min(q0, q1)), min(max(p0, p1), max(q0, q1))
        meet = hi if self.meeting == 1 else lo + self.meeting * (hi - lo)

        def fraction(a, b):
            part = (meet - a) / (b - a) if b != a else self.zero
            return self.one if part >= 1 - self.tie else part

        return fraction(p0, p1), fraction(q0, q1)

    def passed_on_the_way(self, g, parts, left, right):
        """R8.4: (part, gap, run) if one of the two runs would be carried past the gap beyond."""
        found = []
        sides = (left, parts[0], left.first - 1), (right, parts[1], right.last + 1)
        for run, part, beyond in sides:
            if self.is_gap(beyond) and self.contact[beyond].u + part * run.stretch(beyond) > 0:
                found.append((-self.contact[beyond].u / run.stretch(beyond), beyond, run))
        return min(found, key=lambda item: item[:2], default=None)

    def meet(self, meetings, runs):
        """R8.4 and R8.5."""
        least = min(max(f) for f in meetings.values())
        first = {g: f for g, f in meetings.items() if max(f) <= least + self.one / 10**9}
        least = min(min(f) for f in first.values())
        g = min(g for g, f in first.items() if min(f) <= least + self.one / 10**9)
        left = next(r for r in runs if r.last == g - 1)
        right = next(r for r in runs if r.first == g + 1)
        outer = self.passed_on_the_way(g, meetings[g], left, right)
        if outer:
            g, moves = outer[1], [(outer[2], outer[0])]
        else:
            moves = [(left, meetings[g][0]), (right, meetings[g][1])]
        for run, part in moves:
            if part == 1:
                self.complete(run)
            else:
                self.advance(run, part * run.length)
        self.meetings += 1
        self.close(g)

    def complete_all(self, runs):
        """R8.6.  What happens at the ends of the segments is the next round's work."""
        self.distance = [abs(x.u) for x in self.contact]
        for run in runs:
            self.complete(run)

    def collapse(self):
        """R9 by a plain threshold: exhausted contacts that alone make events end plastically."""
        if len(self.streak) < 8 * self.n:
            return False
        spent = set(self.streak)
        for step in (1, -1):  # exhausted contacts that adjoin them go with them
            for c in range(self.n - 1)[::step]:
                if c - step in spent and self.exhausted(c):
                    spent.add(c)
        for _, group in groupby(enumerate(sorted(spent)), key=lambda item: item[1] - item[0]):
            self.fuse([c for _, c in group])
        for x in self.contact:
            x.u = x.u if x.active else min(x.u, self.zero)
        self.streak, self.collapsed = [], True
        return True

    def fuse(self, contacts):
        """Plastic end of neighbouring contacts: their balls take the common velocity."""
        balls, last = range(contacts[0], contacts[-1] + 2), contacts[-1]
        common = sum(self.m[i] * self.v[i] for i in balls) / sum(self.m[i] for i in balls)
        passed = self.zero
        for i in balls:
            change, self.v[i] = common - self.v[i], common
            passed -= self.m[i] * change
            if i > 0:
                self.contact[i - 1].u -= change
            if i < self.n - 1:
                self.contact[i].u += change
            if i <= last:
                self.contact[i].impulse += passed
        for c in contacts:
            self.contact[c].u, self.contact[c].active = self.zero, False
            self.distance[c] = self.zero
            self.direction[c] = self.direction[c + 1] = None
            self.calm[c], self.peak[c] = 0, self.zero
            self.record("collapse", c)

    def round(self):
        """One round of R8; False when no contact is active."""
        runs = self.runs()
        due = [c for run in runs for c in run.contacts if self.ends_now(run, c)]
        for c in due:
            self.contact[c].given = self.contact[c].e ** 2 * self.contact[c].gained
            self.end(c)
        if due:
            return True
        # R5 without progress.  R8.6, of two on one free ball: the nearer, at a tie the left one;
        # the other is then a gap.
        due = {
            c
            for run in runs
            for c in self.neighbours(run)
            if self.contact[c].u >= 0 and run.closing_rate(c) > 0
        }
        for c in sorted(due):
            if c + 1 in due:
                due.discard(c if self.distance[c + 1] < self.distance[c] else c + 1)
        for c in sorted(due):
            self.close(c)
        if due:
            return True
        if not runs or self.collapse():
            return bool(runs)
        for run in runs:
            self.plan(run)
        pairs = [(a.last + 1, a, b) for a, b in zip(runs, runs[1:]) if b.first == a.last + 2]
        met = {g: self.gap_meeting(g, left, right) for g, left, right in pairs}
        meetings = {g: parts for g, parts in met.items() if parts}
        if meetings:
            self.meet(meetings, runs)
        else:
            self.complete_all(runs)
        return True

    def outcome(self):
        return SimpleNamespace(
            velocities=list(self.v),
            impulses=[x.impulse for x in self.contact],
            events=self.events,
            collisions=[x.collisions for x in self.contact],
            absorbed=[x.absorbed for x in self.contact],
            held=self.held,
            collapsed=self.collapsed,
            path=self.path,
            path_impulses=self.path_impulses,
            meetings=self.meetings,
            recompressions=self.recompressions,
        )


def solve(
    masses,
    velocities,
    restitution,
    forward,
    backward=None,
    *,
    meeting=0.5,
    excess="raise",
    number=mpmath.mpf,
    max_events=1_000_000,
    collapse_below=None,
):
    """Post-impact state of a chain by rules R1 to R9.

    `restitution`, `forward` and `backward` may be scalars. Everything is converted by `number`;
    a string such as "0.1" is read as that decimal number. `collapse_below` is the threshold of
    R9 relative to the largest initial closing speed.
    """
    n = len(masses)

    def spread(values, size):
        many = values if isinstance(values, list | tuple) else [values] * size
        if len(many) != size:
            raise ValueError(f"expected {size} values, found {len(many)}")
        return [number(x) for x in many]

    def by_ball(values):
        inner = spread(values, n - 2)
        if not all(0 <= a <= 1 for a in inner):
            raise ValueError(f"ratios {inner} must lie in [0, 1]")
        return [None, *inner, None]

    masses, velocities = spread(list(masses), n), spread(list(velocities), n)
    restitution = spread(restitution, n - 1)
    backward = by_ball(forward if backward is None else backward)
    forward = by_ball(forward)
    if excess == "raise":
        slack = 4 * (mpmath.mp.eps if number is mpmath.mpf else sys.float_info.epsilon)
        check_ratios("forward", masses, forward, slack)
        check_ratios("backward", masses[::-1], backward[::-1], slack)
    if collapse_below is None:
        collapse_below = number(10) ** (-13 if number is float else -int(0.6 * mpmath.mp.dps))
    ratio = {"forward": forward, "backward": backward}
    impact = Impact(masses, velocities, restitution, ratio, number(meeting), number, collapse_below)
    impact.start()
    while impact.round():
        if len(impact.events) > max_events:
            error = EventLimit(f"more than {max_events} events")
            error.outcome = impact.outcome()
            raise error
    return impact.outcome()
