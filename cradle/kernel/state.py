"""What the event loop knows: groups of arrays, each field explained; and the limits of rounding.

The comments of the fields are the notation of this package.  There are n balls; ball i lies between
contacts i - 1 and i, contact c between balls c and c + 1.  Masses and velocities are counted in the
chain's own units, powers of two, in which the largest are near 1 (`scales`): that changes no digit.
"""

from typing import Any, NamedTuple

if "jit" not in globals():

    def jit(function: Any) -> Any:
        """Mark a function that is compiled into its callers; `cradle.runtime` replaces this."""
        return function

    def apart(function: Any) -> Any:
        """Mark a function that is called seldom: compiled once, not into each caller."""
        return function

    def once(function: Any) -> Any:
        """Mark a function that is called from one place: a part of its caller."""
        return function

    def bare(things: Any) -> Any:
        """Hand on a sequence; compiled code then passes its address alone (`cradle.addresses`)."""
        return things

    def door(function: Any) -> Any:
        """Mark the function that is called from outside, whose compiled code is kept on disk."""
        return function


# Status codes.
FINISHED, UNFINISHED, REFUSED, PAUSED, UNSOUND = 0, 1, 2, 3, 4
# Kinds of event.
MAXIMUM_COMPRESSION, END, CLOSE, COLLAPSE, REPETITION = 0, 1, 2, 3, 4
# R8.1: ends that are known without the slopes, and those that need them.
CERTAIN, SLOPED = 0, 1
# R9: the two levels on which cycles are looked for.
LOWER, UPPER = 0, 1
# What an answer can break; 0 is none.
NO_EVENT, PASSED, MOMENTUM, PULL, ORDER, ENERGY, LEDGER = 1, 2, 3, 4, 5, 6, 7


class Limits(NamedTuple):
    """What rounding and infinity are measured by.

    Where a chain is known that goes wrong without a limit, `tests/test_safeguards.py` switches it
    off: `exhausted`, `dust`, `faint`, `repeats`, `self_similar`, `bend`, `doubt`, `one_digit`,
    `tie`, `simultaneous`, `roundings`, `same`, `rounded`, `vanishing`.  `many` and `cut` only save
    work (`tests/test_speed.py`).  No such chain is known for a larger `faint` or `doubt`, or a
    smaller `same`: these stay as what rounding says.  The others bound the input, the closed form
    and the certificate.
    """

    #: R9: an exhausted contact's speed, relative to the largest initial closing speed.
    exhausted: float
    #: Closing speed below the last digit of velocities kept as sums of two numbers.
    dust: float
    #: R9: kinetic energy that a collapse may cost, relative to that of the initial closing.
    faint: float
    #: R9: exhausted collisions in a row that are a collapse.
    repeats: int
    #: R9: how many cycles are worth taking at once.
    many: int
    #: R9: how closely a cycle must repeat itself, relative to its own scale.
    self_similar: float
    #: R9: how far a cycle may turn before it is exhausted, relative to its own scale.
    bend: float
    #: R9: what a jump beside a steady neighbour may leave in doubt, in exhausted speeds.
    doubt: float
    #: R9: doubt of a cycle's sum, relative to itself, from which not one digit of it is known.
    one_digit: float
    #: Relative accuracy of an impulse.
    digits: float
    #: R8: parts of segments, and distances, closer than this are equal; part of a run's largest
    #: closing speed that a correction of rounding may change a velocity by.
    tie: float
    #: R8: a part of a segment that this factor brings to 1 is whole.
    simultaneous: float
    #: R8: closing speeds closer than this many of their roundings are equal.
    roundings: float
    #: R3: an end speed this close to -e times the speed at the start of compression is meant so.
    same: float
    #: R7: a ratio that this factor brings to its bound is meant to be the bound.
    rounded: float
    #: R1: a rate below this part of its run's largest, times the lightest ball's part of the
    #: heaviest, is zero: no ball could notice it.
    cut: float
    #: R6: one vanishing ratio, as a binary exponent far below that of any number.
    vanishing: int
    #: The closed form is used for numbers between these, where no square over- or underflows ...
    tiny: float
    huge: float
    #: ... and for conditions that are met by this part of their largest term.
    clear: float
    #: Mass of the lightest ball allowed, as a part of the heaviest: below 2**-53 the last digit of
    #: a progress moves it by as much as its next event takes.
    lightest: float
    #: Least coefficient of restitution allowed, but zero: a slower end is below the last digit.
    least_restitution: float
    #: The certificate: what each sum may be off, relative to its terms; and the speed at which two
    #: balls that should touch have passed.
    sound: float


LIMITS = Limits(
    exhausted=1e-18,
    dust=2.0**-100,
    faint=1e-20,
    repeats=8,
    many=64,
    self_similar=1e-13,
    bend=1e-2,
    doubt=1e5,
    one_digit=0.1,
    digits=4 * 2.0**-52,
    tie=1e-9,
    simultaneous=1.0 + 64 * 2.0**-52,
    roundings=16.0,
    same=16 * 2.0**-52,
    rounded=1.0 + 4 * 2.0**-52,
    cut=2.0**-120,
    vanishing=1 << 40,
    tiny=1e-60,
    huge=1e60,
    clear=1e-12,
    lightest=1e-15,
    least_restitution=1e-30,
    sound=64 * 2.0**-52,
)


class Ball:
    """One ball."""

    v: float  # velocity before the impact, in the caller's units
    m: float  # mass
    hi: float  # velocity as a sum of two numbers, hi + lo, with twice the digits
    lo: float
    pull: float  # velocity per unit of progress of the ball's run, dv/ds
    ratio: float  # ratio in force at the ball
    rest: float  # 1 - ratio, to all its digits
    turn: int  # direction: 1 forward, -1 backward, 0 none
    x: float  # room for what a function works out in passing
    y: float


class Contact:
    """One contact; it joins the ball of its own number and the next.

    `u` is zero exactly if the two balls have the same velocity to the last bit of both its parts.
    """

    e: float  # restitution
    forward: float  # ratios at its right ball
    backward: float
    u: float  # closing speed, > 0 in compression
    u0: float  # closing speed before its run moved last
    q: float  # work that it can still release, e^2 W+ - W-, since it became active,
    q_lo: float  # as a sum of two numbers
    w: float  # work absorbed since it became active, W+
    top: float  # closing speed at which its compression began, as a sum of two numbers
    tip: float
    rate: float  # impulse per unit of progress; the largest of a run is about 1
    slope: float  # closing speed per unit of progress, du/ds
    until: float  # progress to its own next event, and
    final: float  # its closing speed there, if it ends
    due: int  # 1 if that comes at the end of the run's segment, but for rounding
    blur: float  # how much of u may be rounding: it grows with every change of u
    before: float  # -u of an idle contact before its run moved last, or when it ended
    p: float  # impulse since the start, as a sum of two numbers
    p_lo: float
    a: float  # work absorbed since the start, as a sum of two numbers
    a_lo: float
    active: int  # 1 while it is active
    fixed: int  # > 0 while it is held at u = 0; 2 if its ratio is just the bound
    held: int  # 1 if it had an impulse while held by a ratio above the bound
    hits: int  # how often it became active
    tiny: int  # how many exhausted collisions in a row
    power: int  # binary exponent of the rate
    passes: int  # 1 while its maximum of compression is still to be recorded
    x: float  # room for what a function works out in passing
    y: float


class Run:
    """One run, under the number of its first contact; linked from left to right."""

    last: int  # last contact
    first: int  # under the number of a run's last contact: its first
    source: int  # the contact that drives all others, -1 if there are several
    low: int  # contacts low..high have impulses or moving balls; the others wait
    high: int
    onward: int  # first contact of the next run, or n
    back: int  # first contact of the run before, or -1
    stirred: int  # 1 if it has changed since its rates and its segment were worked out
    reach: float  # progress to the run's own next event
    part: float  # how much of its segment the run goes in this round; negative if it stays
    left: float  # of the gap after the run: parts of the two segments at which it is reached,
    right: float  # left run's and right run's; `left` is negative if it must not meet


class Level:
    """R9: one of two levels on which cycles are looked for, ends of contacts and collapses."""

    mark: int  # contact at whose end, or collapse, the snapshot was taken; -1 for none
    seen: int  # how many ends, or collapses, had been counted then; the next one is taken at twice
    count: int  # how many have been counted so far


class Memory:
    """R9: what is remembered of one contact on one level."""

    u: float  # the snapshot: closing speed, work, collisions, and who drives whom
    q: float
    q_lo: float
    hits: int
    code: int
    p: float  # impulse and work absorbed since then, without corrections of rounding; on the upper
    # level without the lower one's
    a: float


class Tally:
    """The impact as a whole."""

    events: int  # how many events, and rounds, so far
    rounds: int
    collapsed: int  # 1 if contacts have collapsed
    effort: int  # contacts that may still be touched, and events written, before a pause
    room: int
    capacity: int  # how many events the record holds
    first: int  # first contact of the first run, or n
    shift: int  # binary exponents of the largest velocity and the largest mass
    mass_shift: int
    unit: float  # what velocities are multiplied by, 2**-shift
    defect: int  # what the answer breaks
    cut_off: float  # rates below this are zero
    threshold: float  # R9: closing speed below which a contact is exhausted
    energy: float  # R9: the largest m u^2 of a contact at the start, m its reduced mass
    meeting: float  # R8: where two runs meet, as a part of the overlap
    margin: float  # least distance of two events of a run, relative to their progress


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
