"""The live explorer's script in V8, as a wheel brings it: no browser is needed."""

import atexit
import json

import numpy as np
import pytest

# JSON has no -0, and 1.0 is 1 there.
TO_JSON = 'value => JSON.stringify(value, (_, x) => Object.is(x, -0) ? "-0" : x)'
CAUGHT = "(ask => given => { try { return ask(given); } catch (error) { return error.message; } })"


class Script:
    """A page's view of the engine."""

    def __init__(self, source):
        # The import of the context is late: without a wheel for a platform its tests are skipped.
        engine = pytest.importorskip("py_mini_racer", reason="mini-racer is not installed")
        self.context = engine.MiniRacer()
        # Left open, its thread may keep the process alive.
        atexit.register(self.context.close)
        self.context.eval(source)

    def __call__(self, function, *given):
        """What a JavaScript function of some values returns."""
        arguments = ", ".join(json.dumps(value) for value in given)
        answer = self.context.eval(f"({TO_JSON})(({function})({arguments}))", timeout_sec=60)
        return json.loads(answer)

    def each(self, function, rows):
        """What it returns for each row, or the sentence that it throws."""
        return self(f"rows => rows.map({CAUGHT}({function}))", rows)


def bits(values):
    """Numbers as they are stored; -0.0 is not 0.0."""
    return np.asarray(values, float).tobytes()
