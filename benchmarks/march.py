"""A brute-force march of the impact rules by small fixed steps of impulse.

It shares no code with the solver and knows no event root: it only steps, looks, and applies
the rule that has come due. Overshoot at an event is left as it is, so every result carries an error
of first order in the step, and converges to the outcome of the exact rules as ``steps`` grows.
The loop over the steps is compiled where numba is installed; rules and events are plain Python.

Contact c joins balls c and c + 1; u = v[c] - v[c + 1] is its closing speed.
Collapse (infinite sequences of impacts) is not treated: such a march raises at its limits.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, field

import numpy as np

try:
    from numba import njit
except ImportError:  # the same in plain Python

    def njit(**_options):
        return lambda function: function


FORWARD, BACKWARD = "forward", "backward"


@dataclass
class March:
    """State of a march; its last state is the result.

    ``u`` is kept beside ``v`` so that a closing speed which is zero by construction is an exact
    zero; the two differ by what the steps overshoot. ``absorbed`` and ``released`` count since the
    contact became active, ``ledger`` sums the work absorbed in all its ended collisions.
    """

    v: np.ndarray
    u: np.ndarray
    impulses: np.ndarray
    absorbed: np.ndarray
    released: np.ndarray
    active: list[bool]
    direction: list[str | None]
    collisions: list[int]
    ledger: list[float]
    events: list[tuple[str, int]] = field(default_factory=list)
    held: set[int] = field(default_factory=set)
    steps: int = 0

    @property
    def velocities(self) -> np.ndarray:
        return self.v.copy()

    def copy(self) -> March:
        return March(**{name: copy(value) for name, value in vars(self).items()})

    def is_active(self, c: int) -> bool:
        return 0 <= c < len(self.active) and self.active[c]

    def is_gap(self, c: int) -> bool:
        """An idle contact with a run on either side."""
        return not self.is_active(c) and self.is_active(c - 1) and self.is_active(c + 1)

    def runs(self) -> list[tuple[int, int]]:
        """First and last contact of every stretch of active contacts (R1)."""
        contacts = range(len(self.active))
        first = [c for c in contacts if self.active[c] and not self.is_active(c - 1)]
        last = [c for c in contacts if self.active[c] and not self.is_active(c + 1)]
        return list(zip(first, last, strict=True))

    def is_untouched(self, c: int) -> bool:
        """Active at zero closing speed, with nothing absorbed since it closed."""
        return self.active[c] and self.u[c] == 0 and self.absorbed[c] == 0

    def is_driven(self, c: int) -> bool:
        return self.direction[c] == FORWARD or self.direction[c + 1] == BACKWARD

    def close(self, c: int, exact_zero: bool) -> None:
        """R4, R5, R8.5: what was active drives what becomes active, a gap from both sides."""
        self.active[c], self.absorbed[c], self.released[c] = True, 0.0, 0.0
        self.u[c] = 0.0 if exact_zero else self.v[c] - self.v[c + 1]
        self.direction[c] = FORWARD if self.is_active(c - 1) else None
        self.direction[c + 1] = BACKWARD if self.is_active(c + 1) else None
        self.collisions[c] += 1
        self.events.append(("close", c))

    def end(self, c: int, exact_zero: bool) -> None:
        """R4: the relations of the contact go."""
        self.active[c], self.direction[c], self.direction[c + 1] = False, None, None
        self.ledger[c] += self.absorbed[c]
        self.u[c] = 0.0 if exact_zero else self.u[c]
        self.events.append(("end", c))


@njit(cache=True)
def stride(v, u, impulses, absorbed, released, e, h, balls, inside, outside, limit, compressed):
    """Take steps until one brings an event: return (steps, whether it did, maximum compressions).

    Rows of `balls` are (ball, change of v a step), of the active contacts `inside` (contact, change
    of u, rate), of those beside them `outside` (contact, change of u, whether it may close).  The
    contacts that came to maximum compression are left in `compressed`.
    """
    done = count = 0
    event = False
    while done < limit and not event:
        done += 1
        for i, change in balls:
            v[int(i)] += change
        for k, change, rate in inside:
            c = int(k)
            before = u[c]
            u[c] = after = before + change
            impulses[c] += rate * h
            work = 0.5 * (before + after) * rate * h
            if work > 0:
                absorbed[c] += work
            else:
                released[c] -= work
            if after <= 0:
                if before > 0:
                    compressed[count] = c
                    count += 1
                # R3, seen after a step.
                event = event or (after < 0 and e[c] ** 2 * absorbed[c] - released[c] <= 0)
        for k, change, closing in outside:
            c = int(k)
            u[c] += change
            event = event or (closing > 0 and u[c] >= 0)
    return done, event, count


def start(v: np.ndarray) -> March:
    """R2: the leftmost approaching contact of every touching stretch drives all the others."""
    n = len(v) - 1
    zeros = [np.zeros(n) for _ in range(3)]
    s = March(v, v[:-1] - v[1:], *zeros, [False] * n, [None] * (n + 1), [0] * n, [0.0] * n)
    u = s.u
    for source in range(n):
        if u[source] > 0 and not s.active[source]:
            left, right = source, source
            while left > 0 and u[left - 1] == 0:
                left -= 1
            while right < n - 1 and u[right + 1] >= 0:
                right += 1
            for c in range(left, right + 1):
                s.active[c], s.collisions[c] = True, 1
            for ball in range(left + 1, right + 1):
                s.direction[ball] = BACKWARD if ball <= source else FORWARD
    return s


def march(
    masses,
    velocities,
    restitution,
    forward=0.0,
    backward=None,
    *,
    meeting=0.5,
    steps=2000,
    excess="saturate",
    hold=True,
    max_steps=20_000_000,
    max_events=200_000,
):
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
    e = np.array(np.broadcast_to(np.asarray(restitution, float), n))
    a = [0.0, *np.broadcast_to(np.asarray(forward, float), n - 1).tolist(), 0.0]
    b = forward if backward is None else backward
    b = [0.0, *np.broadcast_to(np.asarray(b, float), n - 1).tolist(), 0.0]
    for i in range(1, n):
        above_forward = a[i] > m[i + 1] / (m[i + 1] + m[i] * (1 - a[i + 1]))
        above_backward = b[i] > m[i - 1] / (m[i - 1] + m[i] * (1 - b[i - 1]))
        if excess == "raise" and (above_forward or above_backward):
            raise ValueError(f"forward, backward at ball {i} = {a[i]}, {b[i]}; above the bound")
    s = start(np.array(velocities, float))
    if not any(s.active):
        return s
    h = min(m[c] * m[c + 1] / (m[c] + m[c + 1]) for c in range(n)) * max(s.u) / steps
    left_over = max_steps

    def ratio_in_force(s, i):
        """Ratio at ball i (R7) and whether it holds the driven contact at u = 0."""
        side = 1 if s.direction[i] == FORWARD else -1
        nominal = a[i] if side == 1 else b[i]
        contact, beyond = (i, i + 1) if side == 1 else (i - 1, i - 1)
        driven_from_beyond = s.direction[beyond] not in (None, s.direction[i])
        if not hold or not s.is_untouched(contact) or driven_from_beyond:
            return nominal, False
        # Zero closing acceleration: (1 - x) / m[i] = x (1 - next) / m[beyond].
        next_ratio = ratio_in_force(s, beyond)[0] if s.direction[beyond] else 0.0
        bound = m[beyond] / (m[beyond] + m[i] * (1 - next_ratio))
        return (bound, True) if nominal * (1 + 1e-12) >= bound else (nominal, False)

    def rates(s, run):
        """Impulse rates of a run, largest 1, and its held contacts (R1, R6, R7).

        Every rate is (size, order): size times the order-th power of one vanishing number that
        stands for each ratio zero; in the limit only the lowest order has a rate at all.
        """
        size, order, held = [1.0], [0], set()
        for i in range(run[0] + 1, run[1] + 1):
            x, holds = ratio_in_force(s, i)
            if s.direction[i] == FORWARD:
                size.append(size[-1] * (x or 1.0))
                order.append(order[-1] + (x == 0))
            else:
                size.append(size[-1] / (x or 1.0))
                order.append(order[-1] - (x == 0))
            if holds:
                held.add(i if s.direction[i] == FORWARD else i - 1)
        size = [x if k == min(order) else 0.0 for x, k in zip(size, order, strict=True)]
        return {run[0] + k: x / max(size) for k, x in enumerate(size)}, held

    def has_ended(s, c):
        """R3, seen after a step."""
        return s.u[c] < 0 and e[c] ** 2 * s.absorbed[c] - s.released[c] <= 0

    def advance(s, run, limit=math.inf):
        """March one run to its next rate-changing event, at most `limit` steps; count the steps."""
        nonlocal left_over
        rate, held = rates(s, run)
        dv = {
            i: (rate.get(i - 1, 0.0) - rate.get(i, 0.0)) / m[i] * h
            for i in range(run[0], run[1] + 2)
        }
        du = {
            c: 0.0 if c in held else dv.get(c, 0.0) - dv.get(c + 1, 0.0)
            for c in range(max(run[0] - 1, 0), min(run[1] + 2, n))
        }
        closing = [c for c in (run[0] - 1, run[1] + 1) if du.get(c, 0.0) > 0 and not s.is_gap(c)]
        inside = [(c, du[c], rate[c]) for c in rate]
        outside = [(c, change, c in closing) for c, change in du.items() if c not in rate]
        rows = (np.array(list(part), float).reshape(-1, 3) for part in (inside, outside))
        compressed = np.zeros(len(rate), dtype=np.int64)
        done, event, count = stride(
            s.v, s.u, s.impulses, s.absorbed, s.released, e, h,
            np.array(list(dv.items())), *rows, min(limit, left_over), compressed,
        )  # fmt: skip
        s.events += [("maximum_compression", c) for c in compressed[:count].tolist()]
        if not event and done < limit:
            raise RuntimeError(f"not finished in max_steps = {max_steps}; reached {s.v.tolist()}")
        left_over -= done
        s.steps += done
        s.held |= {c for c in held if done and rate[c] > 0}
        return done

    def event_without_progress(s, u_before):
        """Apply the first event that needs no progress (R8.1), ends before closings."""
        rate = {c: x for run in s.runs() for c, x in rates(s, run)[0].items()}
        for c in range(n):
            # An untouched contact without a driver would open by its own impulse: it ends at once.
            opens = s.is_untouched(c) and not s.is_driven(c) and rate[c] > 0
            if s.active[c] and (has_ended(s, c) or opens):
                s.end(c, exact_zero=hold and e[c] == 0)
                return True
        pushed = [rate.get(c - 1, 0.0) > 0 or rate.get(c + 1, 0.0) > 0 for c in range(n)]
        due = [
            c for c in range(n) if pushed[c] and not s.active[c] and not s.is_gap(c) and s.u[c] >= 0
        ]
        if not due:
            return False
        # R8.6: of two runs that close on one free ball, the one that was nearer.
        other = due[0] + 1 in due and abs(u_before[due[0] + 1]) < abs(u_before[due[0]])
        s.close(due[0] + other, exact_zero=hold)
        return True

    def first_meeting(s, trial):
        """R8.3-4: the gap that closes first as (gap, [(run, fraction of its segment), ...])."""

        def fraction(ball, target):
            travel = trial.v[ball] - s.v[ball]
            return min(max((target - s.v[ball]) / travel, 0.0), 1.0) if travel else 0.0

        ending = {last: (first, last) for first, last in s.runs()}
        starting = {first: (first, last) for first, last in s.runs()}
        found = []
        for gap in range(n):
            if s.is_gap(gap) and trial.v[gap] > trial.v[gap + 1]:
                p, q = (s.v[gap], trial.v[gap]), (s.v[gap + 1], trial.v[gap + 1])
                low, high = max(min(p), min(q)), min(max(p), max(q))
                target = low + meeting * (high - low)
                left, right = fraction(gap, target), fraction(gap + 1, target)
                key = (round(max(left, right), 9), round(min(left, right), 9), gap)
                found.append((*key, ending[gap - 1], left, starting[gap + 1], right))
        if not found:
            return None
        _, _, gap, left_run, left, right_run, right = min(found)  # ties to nine digits: the left
        # Would one of the two be carried past its neighbour across the gap at its other end?
        passed = []
        i, j = left_run[0], right_run[1] + 1
        if s.is_gap(i - 1) and s.v[i - 1] > s.v[i] + left * (trial.v[i] - s.v[i]):
            passed.append((fraction(i, s.v[i - 1]), i - 1, left_run))
        if s.is_gap(j) and s.v[j] + right * (trial.v[j] - s.v[j]) > s.v[j + 1]:
            passed.append((fraction(j, s.v[j + 1]), j, right_run))
        if passed:
            f, gap, run = min(passed)
            return gap, [(run, f)]
        return gap, [(left_run, left), (right_run, right)]

    u_before = list(s.u)
    while True:
        while event_without_progress(s, u_before):
            if len(s.events) > max_events:
                raise RuntimeError(
                    f"not finished in max_events = {max_events}; reached {s.v.tolist()}"
                )
        if not s.runs():
            return s
        u_before = list(s.u)
        trial = s.copy() if any(map(s.is_gap, range(n))) else s
        taken = {run: advance(trial, run) for run in s.runs()}
        meet = first_meeting(s, trial)
        if meet is None:  # R8.6: every run completes its segment
            s = trial
            continue
        gap, moves = meet
        for run, f in moves:
            advance(s, run, round(f * taken[run]))
        s.close(gap, exact_zero=True)
