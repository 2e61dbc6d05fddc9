"""A brute-force march of the impact rules by small fixed steps of impulse.

The rules are those of `cradle.textbook`; but no event is the root of a formula: the march steps,
looks, and applies the rule that has come due.  Overshoot is left as it is: an error of first order
in the step.  R9 is left out.
"""

import math
from functools import partial

import numpy as np

from cradle import textbook
from cradle.textbook import BACKWARD, FORWARD, EventLimit

try:
    from numba import njit
except ImportError:  # the same in plain Python

    def njit(**_options):
        return lambda function: function


@njit(cache=True)
def stride(u, gained, given, e, inside, change, push, most):
    """Take steps until one brings an event; return how many, and whether it did.

    An element is a contact, active (`inside`) or beside those that are; `change` of u and `push`,
    its impulse, are those of a step.
    """
    done = 0
    event = False
    while done < most and not event:
        done += 1
        for c in range(len(u)):
            before = u[c]
            u[c] += change[c]
            work = 0.5 * (before + u[c]) * push[c]
            if work > 0:
                gained[c] += work
            else:
                given[c] -= work
            if inside[c]:  # R3, seen after a step
                event = event or (u[c] < 0 and e[c] ** 2 * gained[c] <= given[c])
            else:
                event = event or (change[c] > 0 and u[c] >= 0)
    return done, event


class March(textbook.Impact):
    """State of a march."""

    def __init__(self, *given, steps, hold, max_steps):
        super().__init__(*given)
        lightest = min(a * b / (a + b) for a, b in zip(self.m, self.m[1:]))
        self.step = lightest * max(self.u) / steps
        self.hold, self.max_steps, self.steps = hold, max_steps, 0

    def is_gap(self, c):
        return self.active[c - 1] and self.active[c + 1]

    def ratios_in_force(self, inner):
        if self.hold:
            return super().ratios_in_force(inner)
        return {i: self.ratio[self.direction[i]][i] for i in inner}, {}

    def way_to_end(self, c, rate, _slope):
        """R3 as it is seen after a step: at its end, or nobody knows how far from it."""
        driven = self.direction[c] == FORWARD or self.direction[c + 1] == BACKWARD
        over = self.u[c] < 0 and self.e[c] ** 2 * self.gained[c] <= self.given[c]
        opens = self.u[c] == self.gained[c] == 0 and not driven and rate > 0
        return 0.0 if over or opens else math.inf, self.u[c]

    def end(self, c):
        super().end(c)
        if self.hold and self.e[c] == 0:
            self.u[c] = 0.0

    def close(self, c):
        gap = self.is_gap(c)
        super().close(c)
        if not self.hold and not gap:
            self.u[c] = self.velocities[c] - self.velocities[c + 1]

    def strides(self, run, most):
        """Contacts that may change, their u, W+ and W- after at most so many steps; how many."""
        contacts = [c for c in run.slope if c in run.rate or not self.is_gap(c)]
        state = [np.array(part, float)[contacts] for part in (self.u, self.gained, self.given)]
        e, inside = np.array(self.e)[contacts], np.array(self.active)[contacts]
        change = np.array([run.slope[c] * self.step for c in contacts])
        push = np.array([run.rate.get(c, 0.0) * self.step for c in contacts])
        done, event = stride(*state, e, inside, change, push, most)
        return contacts, state, done, event

    def progress(self, runs):
        """R8: every run steps to its own next event, unless a gap closes before that."""
        self.trial = {run.first: self.strides(run, self.max_steps - self.steps) for run in runs}
        if not all(event for *_, event in self.trial.values()):
            raise EventLimit(f"not finished within max_steps = {self.max_steps}", self)
        lengths = [self.step * self.trial[run.first][2] for run in runs]
        super().progress([run._replace(length=s) for run, s in zip(runs, lengths)])

    def advance(self, run, part):
        """Take a run through a part of its segment, in whole steps."""
        contacts, state, done, _ = self.trial[run.first]
        if part != 1:
            contacts, state, done, _ = self.strides(run, round(part * done))
        for c, *now in zip(contacts, *(values.tolist() for values in state)):
            self.u[c], self.gained[c], self.given[c] = now
        for c in run.slope.keys() - set(contacts):  # gaps, which move with another run as well
            self.u[c] += run.slope[c] * self.step * done
        for i, pull in run.pull.items():
            self.velocities[i] += pull * self.step * done
        self.steps += done


def march(*chain, meeting=0.5, steps=2000, hold=True, max_steps=20_000_000, max_events=200_000):
    """March a chain through its impact, as `textbook.solve`; return its last state.

    One step is the impulse that changes the closing speed of the lightest pair by 1/`steps` of the
    largest initial one; the contact of a run with the largest rate takes whole steps.  With
    `hold=False` a contact at its largest admissible ratio is not held (R7): it ends and closes
    again and again.
    """
    impact = partial(March, steps=steps, hold=hold, max_steps=max_steps)
    state = textbook.solve(*chain, meeting=meeting, max_events=max_events, impact=impact)
    state.velocities = np.array(state.velocities)
    return state
