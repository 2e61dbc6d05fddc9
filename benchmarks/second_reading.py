"""Rules R1 to R8, read a second time: from the words of chapter 6 alone, over `decimal` numbers.

It shares no line and no idea of storage with `cradle.textbook`: nothing is kept between two rounds
but velocities, works, active contacts and who drives whom; all else is worked out anew.  Balls and
contacts count from 1: ball i has contact i - 1 on its left and contact i on its right.

What ratios of zero make vanish (R6) is a pair (power, number), and means number * eps**power.
"""

from decimal import Decimal, getcontext

ZERO, ONE = Decimal(0), Decimal(1)


def second_reading(
    masses, velocities, restitution, forward, backward, meeting=Decimal("0.5"), rounds=2000
):
    """Velocities after the impact, and its ends and closings with contacts counted from 0.

    All numbers are `Decimal`; to six tenths of the digits of the context, equal is equal.
    Raises `RuntimeError` when the impact is not over after `rounds` (R9 is not among the rules).
    """
    impact = Impact(masses, velocities, restitution, forward, backward, meeting)
    for _ in range(rounds):
        if not impact.active:
            return list(impact.v.values()), [(kind, c - 1) for kind, c in impact.events]
        impact.round()
    raise RuntimeError(f"not over after {rounds} rounds")


def stretches(contacts):
    """Runs of neighbouring contacts, as tuples."""
    found = []
    for c in sorted(contacts):
        beside = found.pop() if found and found[-1][-1] == c - 1 else ()
        found.append((*beside, c))
    return found


class Impact:
    """What is known between two rounds."""

    def __init__(self, masses, velocities, restitution, forward, backward, meeting):
        self.m, self.v = dict(enumerate(masses, 1)), dict(enumerate(velocities, 1))
        self.e, self.meeting = dict(enumerate(restitution, 1)), meeting
        self.ratio = {"f": dict(enumerate(forward, 2)), "b": dict(enumerate(backward, 2))}
        self.contacts = range(1, len(masses))
        self.nought = Decimal(10) ** (-getcontext().prec * 6 // 10)
        self.still = self.nought * max(abs(self.v[c] - self.v[c + 1]) for c in self.contacts)
        self.active, self.way, self.events = set(), {}, []  # way: inner ball -> "f" or "b"
        self.absorbed = dict.fromkeys(self.contacts, ZERO)
        self.released = dict.fromkeys(self.contacts, ZERO)
        self.start()

    def closing(self, c):
        """The closing speed; zero is zero."""
        u = self.v[c] - self.v[c + 1]
        return u if abs(u) > self.still else ZERO

    def rest(self, c):
        """Q: the work that a contact can still release."""
        gain = self.e[c] ** 2 * self.absorbed[c]
        return gain - self.released[c] if gain - self.released[c] > self.nought * gain else ZERO

    def neighbours(self, c):
        return [n for n in (c - 1, c + 1) if n in self.active]

    def start(self):
        """R2: in a touching stretch the leftmost approaching contact drives to both sides."""
        self.before = {c: self.closing(c) for c in self.contacts}  # the last progress
        for stretch in stretches(c for c in self.contacts if self.closing(c) >= 0):
            approaching = [c for c in stretch if self.closing(c) > 0]
            if approaching:
                self.active.update(stretch)
                for ball in stretch[1:]:
                    self.way[ball] = "f" if ball > approaching[0] else "b"

    def end(self, c):
        """R3 and R4: its relations go with it."""
        self.active.remove(c)
        self.way.pop(c, None)
        self.way.pop(c + 1, None)
        self.events.append(("end", c))

    def close(self, c):
        """R4 and R5: driven by all that was there."""
        for contact, ball, way in ((c - 1, c, "f"), (c + 1, c + 1, "b")):
            if contact in self.active:
                self.way[ball] = way
        self.active.add(c)
        self.absorbed[c] = self.released[c] = ZERO
        self.events.append(("close", c))

    # --- inside a run ---------------------------------------------------------------------------

    def in_force(self, ball):
        """The ratio in force at an inner ball: nominal, vanishing (R6), or the bound of R7."""
        way = self.way[ball]
        c, far = (ball, ball + 1) if way == "f" else (ball - 1, ball - 1)  # driven, ball beyond
        nominal = self.ratio[way][ball]
        if nominal == 0:
            return 1, ONE
        two_drivers = self.way.get(far, way) != way
        if two_drivers or self.closing(c) != 0 or self.absorbed[c] != 0:
            return 0, nominal
        power, onward = self.in_force(far) if far in self.way else (1, ONE)
        onward = onward if power == 0 else ZERO
        return 0, min(nominal, self.m[far] / (self.m[far] + self.m[ball] * (1 - onward)))

    def rates(self, run):
        """Impulse rates of a run by Eq. 49, the first one being 1."""
        rates = {run[0]: (0, ONE)}
        for ball in run[1:]:
            (p, r), (q, a) = rates[ball - 1], self.in_force(ball)
            rates[ball] = (p + q, r * a) if self.way[ball] == "f" else (p - q, r / a)
        return rates

    def slope(self, c, rates):
        """The rate of a closing speed: the leading power whose terms do not cancel."""
        terms = []
        for contact, sign, ball in ((c - 1, 1, c), (c, -1, c), (c, -1, c + 1), (c + 1, 1, c + 1)):
            if contact in rates:
                power, rate = rates[contact]
                terms.append((power, sign * rate / self.m[ball]))
        for power in sorted({power for power, _ in terms}):
            parts = [number for other, number in terms if other == power]
            if abs(sum(parts)) > self.nought * max(map(abs, parts)):
                return power, sum(parts)
        return 0, ZERO

    def way_to_end(self, c, rates):
        """R3: the progress to the end of a contact, or None."""
        (p, r), (q, k), u, rest = rates[c], self.slope(c, rates), self.closing(c), self.rest(c)
        if q > p:
            k = ZERO  # too slow to matter while this contact changes
        if u == self.e[c] == 0 and self.absorbed[c] > 0:
            return -p, ZERO  # e = 0: at maximum compression, whoever drives it
        if u >= 0 and k >= 0:
            return None
        if u >= 0:
            rest += self.e[c] ** 2 * r * u * u / (-2 * k)
            return -p, -u / k + (2 * rest / (-k * r)).sqrt()
        if rest == 0:
            return -p, ZERO
        radicand = u * u - 2 * k * rest / r
        if (k > 0 and q < p) or radicand <= self.nought * u * u:
            return None  # compressed again before that
        return -p, 2 * rest / (r * (radicand.sqrt() - u))

    def segment(self, run, rates, gaps):
        """R8.2: impulses on the way to the next event; first is the highest power of eps."""
        found = [way for c in run if (way := self.way_to_end(c, rates)) is not None]
        for c in (run[0] - 1, run[-1] + 1):
            if c in self.contacts and c not in gaps:
                power, slope = self.slope(c, rates)
                found.append((-power, -self.closing(c) / slope))
        power, length = min(found, key=lambda way: (-way[0], way[1]))
        if any(p + power < 0 for p, _ in rates.values()):
            raise ArithmeticError("an infinite impulse")
        return {c: r * length if p + power == 0 else ZERO for c, (p, r) in rates.items()}

    # --- one round ------------------------------------------------------------------------------

    def round(self):
        """R8: what is due, or else progress."""
        rates = {run: self.rates(run) for run in stretches(self.active)}
        ways = {c: self.way_to_end(c, rates[run]) for run in rates for c in run}
        ending = [c for c, way in ways.items() if way and way[1] == 0]
        beside = [c for c in self.contacts if c not in self.active and self.neighbours(c)]
        closing = [] if ending else self.first_of_two([c for c in beside if self.closing(c) >= 0])
        for c in ending:
            self.end(c)
        for c in closing:
            self.close(c)
        if not ending and not closing:
            gaps = [c for c in beside if len(self.neighbours(c)) == 2]
            self.progress({run: self.segment(run, rates[run], gaps) for run in rates}, gaps)

    def first_of_two(self, closing):
        """R8.6: of two contacts of one free ball the one that was nearer, then the left one."""
        for c in closing:
            if c + 1 in closing:
                left, right = (max(-self.before[x], ZERO) for x in (c, c + 1))
                later = c if left - right > self.still else c + 1
                return self.first_of_two([x for x in closing if x != later])
        return closing

    def moved(self, ball, impulses, part=ONE):
        """The velocity of a ball after a part of a segment."""
        push = impulses.get(ball - 1, ZERO) - impulses.get(ball, ZERO)
        return self.v[ball] + part * push / self.m[ball]

    def progress(self, segments, gaps):
        """R8.3 to R8.6: the first gap that must close, or every run to its own event."""
        run_of = {c: run for run in segments for c in run}
        best = None
        for g in gaps:
            runs = run_of[g - 1], run_of[g + 1]
            here = self.v[g], self.v[g + 1]
            there = tuple(self.moved(g + i, segments[runs[i]]) for i in (0, 1))
            if there[0] - there[1] > self.still:
                low, high = max(here[0], there[1]), min(there[0], here[1])
                at = low + self.meeting * (high - low)
                ways = [(at - a, b - a) for a, b in zip(here, there)]
                parts = [part / whole if whole else ZERO for part, whole in ways]
                choice = [max(parts), min(parts), g, dict(zip(runs, parts))]
                if best is None or self.earlier(choice, best):
                    best = choice
        if best is None:
            return self.move(segments, dict.fromkeys(segments, ONE))
        *_, g, parts = best
        past = [self.carried_past(run, g, segments[run], part, gaps) for run, part in parts.items()]
        if any(past):
            part, g, run = min(filter(None, past))
            parts = {run: part}
        self.move(segments, parts)
        self.close(g)

    def earlier(self, one, other):
        """R8.4: the larger part is less, at a tie the smaller one."""
        larger, smaller = one[0] - other[0], one[1] - other[1]
        return larger < -self.nought or (larger <= self.nought and smaller < -self.nought)

    def carried_past(self, run, g, segment, part, gaps):
        """R8.4: whether a run on its way to gap g would pass the ball beyond its other gap."""
        other, ball, beyond = run[0] - 1, run[0], run[0] - 1
        if other == g:
            other, ball, beyond = run[-1] + 1, run[-1] + 1, run[-1] + 2
        here, wall = self.v[ball], self.v.get(beyond)
        there = self.moved(ball, segment, part)
        if other not in gaps or (there - wall) * (beyond - ball) <= self.still:
            return None
        return (wall - here) / (self.moved(ball, segment) - here), other, run

    def move(self, segments, parts):
        """All balls by their parts, and the works that contacts absorb and release on the way."""
        self.before = {c: self.closing(c) for c in self.contacts}
        for run, part in parts.items():
            for ball in (*run, run[-1] + 1):
                self.v[ball] = self.moved(ball, segments[run], part)
        for run, part in parts.items():
            for c in run:
                ends, push = (self.before[c], self.closing(c)), part * segments[run][c]
                for u, other in (ends, ends[::-1]):  # the triangles above and below zero
                    share = u / 2 if u * other >= 0 else u * abs(u) / abs(u - other) / 2
                    self.absorbed[c] += max(push * share, ZERO)
                    self.released[c] += max(-push * share, ZERO)
