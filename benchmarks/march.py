"""A brute-force march of the impact rules by small fixed steps of impulse.

It shares no code with the solver and knows no event root: it only steps, looks, and applies
the rule that has come due. Overshoot at an event is left as it is, so every result carries an error
of first order in the step, and converges to the outcome of the exact rules as ``steps`` grows.
The loop over the steps is compiled where numba is installed; rules and events are plain Python.

Contact c joins balls c and c + 1; u = v[c] - v[c + 1] is its closing speed.
Collapse (infinite sequences of impacts) is not treated: such a march raises at its limits.
"""

import math
from copy import copy

import numpy as np

try:
    from numba import njit
except ImportError:  # the same in plain Python

    def njit(**_options):
        return lambda function: function


FORWARD, BACKWARD = 1, -1


@njit(cache=True)
def stride(v, u, absorbed, released, e, h, balls, inside, outside, limit):
    """Take steps until one brings an event; return how many, and whether it did.

    Rows of `balls` are (ball, change of v a step), of the active contacts `inside` (contact, change
    of u, rate), of those beside them `outside` (contact, change of u, whether it may close).
    """
    done = 0
    event = False
    while done < limit and not event:
        done += 1
        for i, change in balls:
            v[int(i)] += change
        for k, change, rate in inside:
            c = int(k)
            before = u[c]
            u[c] = after = before + change
            work = 0.5 * (before + after) * rate * h
            if work > 0:
                absorbed[c] += work
            else:
                released[c] -= work
            # R3, seen after a step.
            event = event or (after < 0 and e[c] ** 2 * absorbed[c] - released[c] <= 0)
        for k, change, closing in outside:
            c = int(k)
            u[c] += change
            event = event or (closing > 0 and u[c] >= 0)
    return done, event


class March:
    """State of a march and its rules; the last state is the result.

    ``u`` is kept beside ``v`` so that a closing speed which is zero by construction is an exact
    zero; the two differ by what the steps overshoot. ``absorbed`` and ``released`` count since the
    contact became active.
    """

    def __init__(self, m, v, e, forward, backward, meeting, hold):
        n = len(e)
        self.m, self.v, self.e, self.u = m, v, e, v[:-1] - v[1:]
        self.ratio = {FORWARD: [0.0, *forward, 0.0], BACKWARD: [0.0, *backward, 0.0]}
        self.meeting, self.hold = meeting, hold
        self.absorbed, self.released = np.zeros(n), np.zeros(n)
        self.active, self.direction = [False] * n, [0] * (n + 1)
        self.collisions = [0] * n
        self.events = self.steps = 0

    @property
    def velocities(self):
        return self.v.copy()

    def copy(self):
        other = copy(self)
        vars(other).update({name: copy(value) for name, value in vars(self).items()})
        return other

    def is_active(self, c):
        return 0 <= c < len(self.active) and self.active[c]

    def is_gap(self, c):
        """An idle contact with a run on either side."""
        return not self.is_active(c) and self.is_active(c - 1) and self.is_active(c + 1)

    def is_untouched(self, c):
        """Active at zero closing speed, with nothing absorbed since it closed."""
        return self.active[c] and self.u[c] == 0 and self.absorbed[c] == 0

    def runs(self):
        """First and last contact of every stretch of active contacts (R1)."""
        contacts = [c for c, active in enumerate(self.active) if active]
        first = [c for c in contacts if not self.is_active(c - 1)]
        last = [c for c in contacts if not self.is_active(c + 1)]
        return list(zip(first, last, strict=True))

    def start(self):
        """R2: the leftmost approaching contact of every touching stretch drives all the others."""
        n, u = len(self.u), self.u
        for source in range(n):
            if u[source] > 0 and not self.active[source]:
                left, right = source, source
                while left > 0 and u[left - 1] == 0:
                    left -= 1
                while right < n - 1 and u[right + 1] >= 0:
                    right += 1
                for c in range(left, right + 1):
                    self.active[c], self.collisions[c] = True, 1
                for ball in range(left + 1, right + 1):
                    self.direction[ball] = BACKWARD if ball <= source else FORWARD

    def close(self, c, exact_zero):
        """R4, R5, R8.5: what was active drives what becomes active, a gap from both sides."""
        self.active[c], self.absorbed[c], self.released[c] = True, 0.0, 0.0
        self.u[c] = 0.0 if exact_zero else self.v[c] - self.v[c + 1]
        self.direction[c] = FORWARD if self.is_active(c - 1) else 0
        self.direction[c + 1] = BACKWARD if self.is_active(c + 1) else 0
        self.collisions[c] += 1
        self.events += 1

    def end(self, c):
        """R4: the relations of the contact go."""
        self.active[c] = False
        self.direction[c] = self.direction[c + 1] = 0
        if self.hold and self.e[c] == 0:
            self.u[c] = 0.0
        self.events += 1

    def ratio_in_force(self, i):
        """Ratio at ball i (R7) and whether it holds the driven contact at u = 0."""
        side = self.direction[i]
        contact, beyond = (i, i + 1) if side == FORWARD else (i - 1, i - 1)
        nominal, next_side = self.ratio[side][i], self.direction[beyond]
        if not self.hold or not self.is_untouched(contact) or next_side == -side:
            return nominal, False
        # Zero closing acceleration: (1 - x) / m[i] = x (1 - next) / m[beyond].
        next_ratio = self.ratio_in_force(beyond)[0] if next_side else 0.0
        bound = self.m[beyond] / (self.m[beyond] + self.m[i] * (1 - next_ratio))
        return (bound, True) if nominal * (1 + 1e-12) >= bound else (nominal, False)

    def rates(self, run):
        """Impulse rates of a run, largest 1, and its held contacts (R1, R6, R7).

        Every rate is (size, order): size times the order-th power of one vanishing number that
        stands for each ratio zero; in the limit only the lowest order has a rate at all.
        """
        size, order, held = [1.0], [0], set()
        for i in range(run[0] + 1, run[1] + 1):
            x, holds = self.ratio_in_force(i)
            side, factor = self.direction[i], x or 1.0
            size.append(size[-1] * factor if side == FORWARD else size[-1] / factor)
            order.append(order[-1] + side * (x == 0))
            if holds:
                held.add(i if side == FORWARD else i - 1)
        size = [x if k == min(order) else 0.0 for x, k in zip(size, order, strict=True)]
        return {run[0] + k: x / max(size) for k, x in enumerate(size)}, held

    def advance(self, run, h, limit, up_to=math.inf):
        """March one run to its next rate-changing event, at most some steps; count the steps."""
        rate, held = self.rates(run)
        balls = range(run[0], run[1] + 2)
        dv = {i: (rate.get(i - 1, 0.0) - rate.get(i, 0.0)) / self.m[i] * h for i in balls}
        contacts = [c for c in range(run[0] - 1, run[1] + 2) if 0 <= c < len(self.u)]
        du = {c: 0.0 if c in held else dv.get(c, 0.0) - dv.get(c + 1, 0.0) for c in contacts}
        inside = [(c, du[c], rate[c]) for c in rate]
        outside = [
            (c, change, change > 0 and not self.is_gap(c))
            for c, change in du.items()
            if c not in rate
        ]
        rows = (np.array(part, float).reshape(-1, 3) for part in (inside, outside))
        most = min(up_to, limit - self.steps)
        done, event = stride(
            self.v, self.u, self.absorbed, self.released, self.e, h,
            np.array(list(dv.items())), *rows, most,
        )  # fmt: skip
        if not event and done < up_to:
            raise RuntimeError(f"not finished in max_steps = {limit}; reached {self.v.tolist()}")
        self.steps += done
        return done

    def event_without_progress(self, u_before):
        """Apply the first event that needs no progress (R8.1), ends before closings."""
        rate = {c: x for run in self.runs() for c, x in self.rates(run)[0].items()}
        contacts = range(len(self.u))
        for c in [c for c in contacts if self.active[c]]:
            driven = self.direction[c] == FORWARD or self.direction[c + 1] == BACKWARD
            ended = self.u[c] < 0 and self.e[c] ** 2 * self.absorbed[c] <= self.released[c]
            # An untouched contact without a driver would open by its own impulse: it ends at once.
            if ended or (self.is_untouched(c) and not driven and rate[c] > 0):
                self.end(c)
                return True
        pushed = [rate.get(c - 1, 0.0) > 0 or rate.get(c + 1, 0.0) > 0 for c in contacts]
        idle = [c for c in contacts if not self.active[c] and not self.is_gap(c)]
        due = [c for c in idle if pushed[c] and self.u[c] >= 0]
        if not due:
            return False
        # R8.6: of two runs that close on one free ball, the one that was nearer.
        other = due[0] + 1 in due and abs(u_before[due[0] + 1]) < abs(u_before[due[0]])
        self.close(due[0] + other, exact_zero=self.hold)
        return True

    def first_meeting(self, trial):
        """R8.3-4: the gap that closes first as (gap, [(run, fraction of its segment), ...])."""

        def fraction(ball, target):
            travel = trial.v[ball] - self.v[ball]
            return min(max((target - self.v[ball]) / travel, 0.0), 1.0) if travel else 0.0

        ending = {run[1]: run for run in self.runs()}
        starting = {run[0]: run for run in self.runs()}
        found = []
        for gap in filter(self.is_gap, range(len(self.u))):
            if trial.v[gap] > trial.v[gap + 1]:
                p, q = (sorted((self.v[i], trial.v[i])) for i in (gap, gap + 1))
                low, high = max(p[0], q[0]), min(p[1], q[1])
                target = low + self.meeting * (high - low)
                left, right = fraction(gap, target), fraction(gap + 1, target)
                key = (round(max(left, right), 9), round(min(left, right), 9), gap)
                found.append((*key, ending[gap - 1], left, starting[gap + 1], right))
        if not found:
            return None
        _, _, gap, left_run, left, right_run, right = min(found)  # ties to nine digits: the left
        # Would one of the two be carried past its neighbour across the gap at its other end?
        passed = []
        i, j = left_run[0], right_run[1] + 1
        if self.is_gap(i - 1) and self.v[i - 1] > self.v[i] + left * (trial.v[i] - self.v[i]):
            passed.append((fraction(i, self.v[i - 1]), i - 1, left_run))
        if self.is_gap(j) and self.v[j] + right * (trial.v[j] - self.v[j]) > self.v[j + 1]:
            passed.append((fraction(j, self.v[j + 1]), j, right_run))
        if passed:
            part, gap, run = min(passed)
            return gap, [(run, part)]
        return gap, [(left_run, left), (right_run, right)]


def march(
    masses, velocities, restitution, forward=0.0, backward=None, *,
    meeting=0.5, steps=2000, hold=True, max_steps=20_000_000, max_events=200_000,
):  # fmt: skip
    """March a chain of balls through its impact by small steps of impulse.

    One step is the impulse that changes the closing speed of the lightest pair by 1/``steps`` of
    the largest initial closing speed; the contact of a run with the largest rate takes whole steps.
    With ``hold=False`` a contact at its largest admissible ratio is not held (R7) but left
    to end and close again and again at the level of the steps.

    Returns the final `March`; raises RuntimeError when ``max_steps`` or ``max_events`` do not
    suffice.

    >>> march([1, 1], [1, 0], 0.5).velocities.round(2).tolist()
    [0.25, 0.75]
    """
    m = [float(x) for x in masses]
    n = len(m) - 1
    e = np.array(np.broadcast_to(np.float64(restitution), n))
    ways = forward, forward if backward is None else backward
    ratios = (np.broadcast_to(np.float64(x), n - 1).tolist() for x in ways)
    s = March(m, np.array(velocities, float), e, *ratios, meeting, hold)
    s.start()
    h = min(m[c] * m[c + 1] / (m[c] + m[c + 1]) for c in range(n)) * max(s.u) / steps
    u_before = list(s.u)
    while s.runs():
        while s.event_without_progress(u_before):
            if s.events > max_events:
                reached = s.v.tolist()
                raise RuntimeError(f"not finished in max_events = {max_events}; reached {reached}")
        u_before = list(s.u)
        trial = s.copy() if any(map(s.is_gap, range(n))) else s
        taken = {run: trial.advance(run, h, max_steps) for run in s.runs()}
        meet = s.first_meeting(trial)
        if meet is None:  # R8.6: every run completes its segment
            s = trial
            continue
        gap, moves = meet
        for run, part in moves:
            s.advance(run, h, max_steps, round(part * taken[run]))
        s.close(gap, exact_zero=True)
    return s
