"""The event loop in rooms: the rules of `cradle.textbook`, fast and at the extremes.

The rooms are plain: numbers, loops, sequences, tuples of arrays and `math`.  They run as they
stand, and compiled as one unit (`cradle.runtime`), with the same bits::

    state     groups of arrays, the notation; the limits of rounding
    numbers   sums of two floats, 32 digits
    rules     one run: rates, ratios in force, its way to its next event      R1, R3, R6, R7
    record    what is written down
    events    start, hand-over, closing                                       R2, R4, R5
    collapse  contacts that are exhausted, and how they end                   R9
    cycles    impacts that repeat themselves on another scale                 R9
    progress  segments, two runs that meet                                    R8.2 to R8.6
    loop      the rounds; the certificate of every answer; the door           R8.1

and contact forces in time, with a door of their own::

    kinks     the records, the law of force; what a contact that closes or opens owes
    forces    steps, one run
    accuracy  units, the length of steps, runs that are compared; the certificate; the door
"""

from cradle.kernel.accuracy import follow
from cradle.kernel.loop import Inputs, Options, Outputs, batch

#: The rooms of the event loop, and all, in an order in which each uses only those before it.
EVENT_LOOP = (
    "state", "numbers", "rules", "record", "events", "collapse", "cycles", "progress", "loop",
)  # fmt: skip
CONTACT_FORCES = ("kinks", "forces", "accuracy")
ROOMS = (*EVENT_LOOP, *CONTACT_FORCES)

__all__ = [
    "CONTACT_FORCES", "EVENT_LOOP", "ROOMS", "Inputs", "Options", "Outputs", "batch", "follow"
]  # fmt: skip
