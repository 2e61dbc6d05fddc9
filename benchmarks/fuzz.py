"""Strings of bytes that become calls of a public entry point, and what must hold of each call.

The bytes give numbers from the ends of their ranges, their neighbours, and any pattern of 64 bits:
made for a search guided by coverage (atheris, AFL) as for hypothesis.  Allowed are the documented
errors alone; every outcome must keep `extreme_chains.faults` empty.  What a search of some hours
found became named cases in `test_extremes.py`.
"""

import math
import struct

from extreme_chains import faults

from cradle import (
    Chain,
    ImpactNotFinished,
    ImpulseCorrelation,
    collide,
    post_impact_velocities,
)

ENDS = {
    "unit": [0.0, 1.0, 1.0 - 2.0**-53, 0.5, 1e-16, 1e-300, 5e-324, 1 / 3, 0.15],
    "mass": [1.0, 2.0, 1e-12, 1e12, 1e-150, 1e150, 5e-324, 1e-308, 1.7e308, 0.25, 3.0],
    "speed": [0.0, 0.0, 1.0, -1.0, 1.0 + 2.0**-52, 1e-150, 1e150, 5e-324, -0.0, 0.5, 1e-16],
}


class Bytes:
    """Numbers out of a string of bytes."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def byte(self):
        self.at += 1
        return self.data[self.at - 1] if self.at <= len(self.data) else 0

    def number(self, kind):
        """A number: of the list of ends, near one, a simple fraction, one of any size, or any."""
        how = self.byte()
        ends = ENDS[kind]
        if how < 96:
            return ends[how % len(ends)]
        if how < 128:
            value = ends[how % len(ends)]
            for _ in range(1 + self.byte() % 3):
                value = math.nextafter(value, math.inf if how % 2 else 0.0)
            return min(value, 1.0) if kind == "unit" else value
        if how < 176:
            value = self.byte() / 255
            return value if kind != "mass" else value or 1.0
        if how < 224:
            if kind == "unit":
                part, power = self.byte() % 2, self.byte() // 2
                return math.ldexp(0.5 + part / 4, -power)
            power = self.byte() - 128
            return math.ldexp(0.8, power) if how % 2 else math.ldexp(1 + power % 8 / 8, power // 8)
        any_value = struct.unpack("<d", bytes(self.byte() for _ in range(8)))[0]
        if how < 240 and math.isfinite(any_value):
            if kind == "unit":
                return abs(any_value) % 1.0
            return abs(any_value) or 1.0 if kind == "mass" else any_value
        return any_value

    def numbers(self, kind, size):
        """Often all alike, for ties."""
        if self.byte() % 4 == 0:
            return [self.number(kind)] * size
        return [self.number(kind) for _ in range(size)]


def problem(data):
    """The call that a string of bytes stands for: masses, velocities, e, ratios, options."""
    source = Bytes(data)
    n = 2 + source.byte() % 7
    options = {
        "meeting": [0.5, 0.5, 0.0, 1.0][source.byte() % 4],
        "excess": ["saturate", "saturate", "raise"][source.byte() % 3],
    }
    m = source.numbers("mass", n)
    v = source.numbers("speed", n)
    if source.byte() % 3 == 0:
        v = [v[0] or 1.0] + [0.0] * (n - 1)
    e = source.numbers("unit", n - 1)
    f = source.numbers("unit", n - 2)
    b = source.numbers("unit", n - 2) if source.byte() % 2 else None
    at_bound = source.byte()
    if at_bound % 4 == 0:
        # Ratios at their bound (Eq. 34), or an ulp beside it.
        side = [None, 0.0, 1.0][at_bound // 4 % 3]
        f, b = ([quotient(x, x + y) for x, y in zip(far, m[1:-1])] for far in (m[2:], m[:-2]))
        if side is not None:
            f, b = ([math.nextafter(x, side) for x in part] for part in (f, b))
    return m, v, e, f, b, options


def quotient(x, y):
    """A ratio, or 1/2 where it is none."""
    return x / y if 0.0 < y < math.inf and 0.0 < x < math.inf else 0.5


def attempt(data, max_events=400):
    """Run one call; raises what must not happen. Returns the trace, or None if refused."""
    m, v, e, f, b, options = problem(data)
    refused = None
    try:
        model = ImpulseCorrelation(f, b, max_events=max_events, **options)
        trace = collide(Chain(m, v, e), model)
        finished = True
    except ValueError as error:
        refused = str(error)
        if " must " not in f" {refused}" and ";" not in refused:
            raise
    except ImpactNotFinished as stopped:
        trace, finished = stopped.trace, False
    try:
        batch = post_impact_velocities(m, v, e, f, b, max_events=max_events, **options)
        assert refused is None, f"refused by collide alone: {refused}"
        assert finished, "the batch finished, collide did not"
        # Short cuts of the batch may round the last digit another way.
        off = max(abs(batch - trace.velocities))
        assert off <= 1e-13 * max(map(abs, v)), f"the batch differs by {off}"
    except ValueError:
        assert refused is not None, "refused by the batch alone"
        return None
    except ImpactNotFinished:
        assert not finished, "collide finished, the batch did not"
    wrong = faults(trace, finished)
    assert not wrong, f"{wrong}: {trace.chain!r}, {trace.model!r}"
    return trace
