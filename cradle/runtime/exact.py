"""Chains whose ratios multiply beyond the event loop's 32 digits: the textbook, over decimals."""

from decimal import Decimal, localcontext
from itertools import pairwise
from typing import Any

import numpy as np

from cradle import textbook
from cradle.kernel.numbers import read
from cradle.kernel.state import LIMITS, Record

_DIGITS, _ZERO, _SOUND = 400, Decimal("1e-240"), Decimal("1e-200")  # of speeds, and of sums
_EVENTS, _EFFORT = 600, 12_000  # most events, and balls times events: the rest is the loop's
_KINDS = "maximum_compression", "end", "close"  # in the order of the event loop's numbers


class Impact(textbook.Impact):
    """The textbook's, where a closing speed is zero if it is so to six tenths of the digits."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.last_digits = _ZERO * max(map(abs, self.u))


def meant(x: float) -> Decimal:
    """Return what a float means to `read`: its bits, or the decimal that it prints as."""
    return Decimal(repr(x)) if read(x).imag else Decimal(x)


def ratios(m: list[Decimal], given: list[Decimal]) -> list[Decimal]:
    """R7: forward ratios, on the bound (Eq. 53) if rounding alone parts them; one above is held."""
    found, onward, seen = list[Decimal](), Decimal(0), 0.0
    for here, driven, ratio in zip(m[-2:0:-1], m[:1:-1], given[::-1], strict=True):
        bound = driven / (driven + here * (1 - onward))
        drawn = 1.0 / (1.0 + float(here) / float(driven) * (1.0 - seen))
        found.append(bound if abs(float(ratio) / drawn - 1.0) < LIMITS.rounded - 1.0 else ratio)
        onward, seen = (bound, float(bound)) if found[-1] > bound else (found[-1], float(ratio))
    return found[::-1]


def certify(it: textbook.Impact, before: list[Decimal]) -> None:
    """Raise if an outcome breaks what the event loop's certificate asks for."""
    after, speed, heavy = it.velocities, max(map(abs, before)), sum(it.m)
    gained = [m * (w - v) for m, v, w in zip(it.m, before, after, strict=True)]
    lost = -sum(p * (v + w) for p, v, w in zip(gained, before, after, strict=True)) / 2
    kept = sum((1 - e * e) * a for e, a in zip(it.e, it.absorbed, strict=True))
    momentum, order = abs(sum(gained)) / heavy, max(v - w for v, w in pairwise(after))
    ledger, energy = abs(lost - kept) / heavy, min(it.absorbed)
    if max(momentum, order) > speed * _SOUND or ledger > speed * speed * _SOUND or energy < 0:
        raise AssertionError("the textbook breaks momentum, order, energy or ledger")


def answer(job: Any, k: int) -> bool:
    """Solve chain k, which is UNDECIDED, in the loop's place; return whether it came to an end."""
    with localcontext(prec=_DIGITS):
        m, v, e, f, b = ([meant(x) for x in part[k].tolist()] for part in job.inputs)
        f, b = ratios(m, f), ratios(m[::-1], b[::-1])[::-1]
        most = min(_EVENTS, _EFFORT // len(m), job.options.max_events // 2)
        options = {"meeting": meant(job.options.meeting), "max_events": most}
        try:
            it = textbook.solve(m, v, e, f, b, number=Decimal, impact=Impact, **options)
        except textbook.EventLimit:
            return False
        certify(it, v)
    out = job.outputs
    out.v[k], out.hits[k], out.collapsed[k], out.margin[k] = it.velocities, it.collisions, 0, 0.0
    if len(out.p):
        out.p[:], out.a[:] = it.impulses, it.absorbed
        out.held[:] = [c in it.held for c in range(len(m) - 1)]
    if job.room:
        kinds = np.array([_KINDS.index(kind) for kind, _ in it.events], np.int64)
        contacts = np.array([c for _, c in it.events], np.int64)
        path = np.array(it.path, float), np.array(it.path_impulses, float)
        job.state = job.state._replace(record=Record(kinds, contacts, *path))
        job.counts["events"] = len(kinds)
    return True
