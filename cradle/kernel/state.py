"""What the event loop knows: groups of arrays, each field explained; and its limits.

There are n balls; contact c joins balls c and c + 1.  Masses and velocities are counted in the
chain's own units, powers of two in which the largest are near 1: that changes no digit.  A field
that is `complex` holds a number of 32 digits (`cradle.kernel.numbers`).
"""

import math
from typing import Any, NamedTuple

if "door" not in globals():

    def apart(function: Any) -> Any:
        """Mark a function that is not compiled into its callers; `cradle.runtime` replaces this."""
        return function

    #: Marks the function that is called from outside, whose compiled code is kept on disk.
    door = apart


# Status codes; UNDECIDED: products of tiny ratios may decide, beyond the 32 digits.
FINISHED, UNFINISHED, REFUSED, PAUSED, UNSOUND, UNDECIDED = 0, 1, 2, 3, 4, 5
# Kinds of event.
MAXIMUM_COMPRESSION, END, CLOSE, COLLAPSE, REPEAT = 0, 1, 2, 3, 4
# R9: the two levels on which cycles are looked for, ends of contacts and collapses.
LOWER, UPPER = 0, 1
# What an answer can break; 0 is none.
NO_EVENT, PASSED, MOMENTUM, PULL, ORDER, ENERGY, LEDGER = 1, 2, 3, 4, 5, 6, 7


class Limits(NamedTuple):
    """What rounding and infinity are measured by; speeds relative to the largest closing one."""

    # R8: a closing speed, or a difference of two, below this part of what it was made of is zero;
    # the other seven of the 32 digits are left to the roundings of the way there.
    tie: float = 2.0**-84
    rounded: float = 1.0 + 4 * 2.0**-52  # R7: a ratio that this brings to its bound is meant to be
    # R1: a rate below this part of its run's largest, times the lightest ball's part of the
    # heaviest, is zero: no ball could notice it.
    cut: float = 2.0**-120
    vanishing: int = 1 << 40  # R6: binary exponent of one vanishing ratio, beyond any number's
    exhausted: float = 1e-18  # R9: speed of an exhausted contact
    dust: float = 2.0**-100  # R9: speed so low that sequences of impacts go on for ever
    repeats: int = 8  # R9: exhausted collisions in a row that are a collapse
    many: int = 64  # R9: how many cycles are worth taking at once
    self_similar: float = 1e-13  # R9: how closely a cycle must repeat itself, on its own scale
    bend: float = 1e-2  # R9: how far a cycle may turn before it is exhausted, on its own scale
    doubt: float = 1e-13  # R9: speed that a jump beside a steady neighbour may leave in doubt
    kept: float = 1e-30  # R9: least part of an impulse that a ball beside such a one keeps
    window: int = 64  # R9: how many contacts to each side a snapshot holds
    # Of ratios below the first a product below the second may decide: the textbook's, in decimals.
    faint: float = 1e-4
    product: float = 1e-11
    lightest: float = 1e-15  # mass of the lightest ball allowed, as a part of the heaviest
    least_restitution: float = 1e-30  # least coefficient allowed, but zero
    sound: float = 64 * 2.0**-52  # the certificate: what a sum may be off, relative to its terms


LIMITS = Limits()

# Numbers of 32 digits.
ZERO, ONE, NEVER = complex(0.0, 0.0), complex(1.0, 0.0), complex(math.inf, 0.0)


class Ball:
    """One ball."""

    v: float  # velocity before the impact, in the caller's units,
    start: complex  # and in the chain's own
    m: complex  # mass
    inverse: complex  # 1 / mass
    pull: complex  # velocity per unit of progress of the ball's run, dv/ds
    ratio: complex  # ratio in force at the ball
    turn: int  # direction: 1 forward, -1 backward, 0 none
    x: complex  # room for what a function works out in passing


class Contact:
    """One contact; `u` is zero exactly if it is at zero by construction, or by a tie."""

    e: complex  # restitution
    square: complex  # e^2
    forward: complex  # ratios at its right ball
    backward: complex
    u: complex  # closing speed, > 0 in compression
    q: complex  # work that it can still release, e^2 W+ - W-, since it became active
    w: float  # work absorbed since it became active, W+
    rate: complex  # impulse per unit of progress; the largest of a run is about 1
    slope: complex  # closing speed per unit of progress, du/ds
    until: complex  # progress to its own next event, and
    final: complex  # its closing speed there
    age: float  # progress at the present pulls that would have made all that u was made of
    due: int  # 1 if its event comes at the end of the run's segment
    made: float  # sum of all changes of u's two balls since u was last zero by construction
    before: complex  # -u of an idle contact before progress number `stamp`, or when it ended
    stamp: int
    p: complex  # impulse since the start
    a: complex  # work absorbed since the start
    active: int  # 1 while it is active
    fixed: int  # > 0 while it is held at u = 0; 2 if its ratio is just the bound
    held: int  # 1 if it had an impulse while held by a ratio above the bound
    hits: int  # how often it became active
    tiny: int  # how many exhausted collisions in a row
    power: int  # binary exponent of the rate
    x: complex  # room for what a function works out in passing
    y: complex


class Run:
    """One run, under the number of its first contact."""

    # Runs are linked from left to right in a ring that begins and ends at n - 1, no contact.
    last: int  # last contact
    first: int  # under the number of a run's last contact: its first
    source: int  # the contact that drives all others, -1 if there are several
    low: int  # contacts low..high have impulses or moving balls; the others wait
    high: int
    onward: int  # the next run, and the one before
    back: int
    stirred: int  # 1 if it has changed since its rates and its segment were worked out
    reach: complex  # progress to the run's own next event: its segment
    part: complex  # what part of its segment it goes in this round,
    way: complex  # and how far that is
    left: complex  # part of its segment after which it meets the next run, NEVER if it need not,
    right: complex  # and the part of that run's


class Level:
    """R9: one of two levels on which cycles are looked for."""

    mark: int  # contact at whose end, or collapse, the snapshot was taken; -1 for none
    count: int  # ends, or collapses, so far
    due: int  # at this count the next snapshot is taken
    taken: int  # snapshots so far


class Memory:
    """R9: a snapshot of one contact."""

    u: complex
    q: complex
    p: complex
    a: complex
    hits: int
    code: int  # whether it is active, and who drives whom at its balls


class Tally:
    """The impact as a whole."""

    events: int  # how many events, rounds, and rounds of progress, so far
    rounds: int
    stamp: int
    ends: int  # contacts that have ended in this round, and the last of them
    ended: int
    worn: int  # R9: the last of them that is worn out, or -1
    collapsed: int  # 1 if contacts have collapsed
    effort: int  # contacts that may still be touched, and events written, before a pause
    room: int
    shift: int  # binary exponents of the largest velocity and the largest mass
    mass_shift: int
    unit: float  # what velocities are multiplied by, 2**-shift
    defect: int  # what the answer breaks
    cut_off: float  # rates below this are zero
    fastest: float  # the largest closing speed at the start
    energy: float  # R9: the largest m u^2 of a contact at the start, m its reduced mass
    meeting: complex  # R8: where two runs meet, as a part of the overlap
    margin: float  # how far the nearest decision was from a tie, relative to what it compares


class Cluster(NamedTuple):
    """R9: contacts left..right, of which first..last chatter between steady neighbours."""

    left: int
    first: int
    last: int
    right: int


class Record(NamedTuple):
    """Where events are written, while there is room; lengths 0 for the outcome alone."""

    kinds: Any
    contacts: Any
    velocities: Any
    impulses: Any


class State(NamedTuple):
    """All of it: sequences of the things above, `level` of two, `memory` of two rows."""

    ball: Any
    contact: Any
    run: Any
    level: Any
    memory: Any
    tally: Any  # of one
    record: Record
