"""R9, the first sign of an infinite sequence of impacts: exhausted contacts that only chatter.

What they have left is far below rounding, and they end plastically.
"""

from cradle.kernel.events import deactivate, exhausted, stir
from cradle.kernel.motion import closing, join_velocities, relative_energy
from cradle.kernel.state import LIMITS, LOWER, apart, jit


@apart
def end_plastically(first, last, n, state):
    """End those contacts of first..last that are active."""
    contact, run = state.contact, state.run
    for c in range(first, last + 1):
        contact[c].tiny = 0
        if contact[c].active == 1:
            k = c
            while k > 0 and contact[k - 1].active == 1:
                k -= 1
            deactivate(c, k, n, state.ball, contact, run, state.tally[0])
    for c in (first - 1, last + 1):
        if 0 <= c < n - 1:
            stir(c, n, run, contact)
            if contact[c].active == 1:
                k = c
                while k > 0 and contact[k - 1].active == 1:
                    k -= 1
                run[k].stirred = 1


@jit
def chatters(c, n, state):
    """Tell whether contact c exists and is in an exhausted collision, or has just been.

    Or if it has collided lately at a speed below the last digit: there sequences go on for ever.
    """
    if not 0 <= c < n - 1:
        return False
    ball, contact, threshold = state.ball, state.contact, state.tally[0].threshold
    if (
        contact[c].active == 1
        and contact[c].w > 0.0
        and exhausted(c, contact[c].w, threshold, ball, contact)
    ):
        return True
    if not exhausted(c, contact[c].q, threshold, ball, contact):
        return False
    lately = contact[c].hits != state.memory[LOWER][c].hits
    return contact[c].tiny > 0 or (lately and abs(contact[c].u) < LIMITS.dust)


@apart
def exhausted_stretch(c, n, state):
    """Return the stretch (first, last) around c of contacts that only chatter.

    Empty if nothing in it can lose energy, unless it is slower than the last digit: elastic
    sequences are finite, or hand all their energy on; or if its balls move with more than a faint
    energy: heavy ones, slower than a light ball that struck them.
    """
    first = c
    last = c
    while True:
        if chatters(first - 1, n, state):
            first -= 1
        elif chatters(last + 1, n, state):
            last += 1
        else:
            break
    loses = False
    fastest = 0.0
    for k in range(first, last + 1):
        loses = loses or state.contact[k].e < 1.0
        fastest = max(fastest, abs(state.contact[k].u))
    if (loses or fastest < LIMITS.dust) and relative_energy(
        first, last + 1, state.ball
    ) <= LIMITS.faint * state.tally[0].energy:
        return first, last
    return c, c - 1


@apart
def merge(first, last, n, state):
    """End the contacts first..last plastically: their balls take the common velocity.

    Balls that zeros beside them join to theirs go with them, and an idle neighbour that this makes
    approach, at a speed below the threshold, joins.
    """
    ball, contact = state.ball, state.contact
    while True:
        low, high = first, last
        while low > 0 and contact[low - 1].u == 0.0:
            low -= 1
        while high < n - 2 and contact[high + 1].u == 0.0:
            high += 1
        join_velocities(low, high + 1, ball, contact)
        for c in (low - 1, high + 1):
            if 0 <= c < n - 1:
                contact[c].u = closing(c, ball)
        if low > 0 and contact[low - 1].active == 0 and contact[low - 1].u > 0.0:
            first = low - 1
        elif high < n - 2 and contact[high + 1].active == 0 and contact[high + 1].u > 0.0:
            last = high + 1
        else:
            break
    end_plastically(first, last, n, state)
    return first, last
