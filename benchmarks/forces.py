"""Contact forces against plain velocity Verlet: microseconds a chain at a measured error, one run.

    python benchmarks/forces.py              # a minute; writes data/forces.csv

Both are compiled and run on one thread, in turns; each time is the least of many. Ours is asked for
an accuracy; what it takes to check and scale its chains, to find its steps and to check its answers
is in its time. Verlet has the largest of many steps from which on all smaller ones keep the error,
found beforehand. Errors are total: the largest distance of a velocity from converged elastic (or
lossy) spheres, over the striker's speed. The last rows are the paper's rule, which has an error and
no step: one ratio, fitted to three spheres.
"""

import os
import time

import numpy as np
from chains import magnitudes
from stored import options, write
from verlet import verlet

os.environ["CRADLE_KERNEL"] = "compiled"
from cradle import post_impact_velocities
from cradle.kernel.kinks import Law, Springs
from cradle.kernel.state import FINISHED
from cradle.runtime.springs import room, solve

#: Compressions and speeds, relative to the first, at which Verlet stops.
FAINT = 1e-6
#: Steps of Verlet that are tried.
STEPS = np.geomspace(0.8, 2e-3, 90)
#: Gives three equal balls what elastic spheres give them.
RATIO = 0.132503287
COLUMNS = ("chain", "method", "asked", "error", "microseconds", "ratio")


def struck(n):
    """Velocities of a row that the first ball strikes."""
    return np.array([1.0] + [0.0] * (n - 1))


def cases():
    """Yield names, masses (a row each), A of the losses, and accuracies asked for."""
    rng = np.random.default_rng(1)
    yield "5 equal", np.ones((1, 5)), 0.0, (1e-2, 1e-3, 1e-4, 1e-6)
    yield "1 1 .1 1 1", np.array([[1, 1, 0.1, 1, 1]]), 0.0, (1e-2, 1e-3)
    yield "20 equal", np.ones((1, 20)), 0.0, (1e-2, 1e-3)
    yield "100 equal", np.ones((1, 100)), 0.0, (1e-2, 1e-3)
    yield "5 random, two decades", magnitudes(rng, 2, (300, 5)), 0.0, (1e-2, 1e-3)
    yield "5 equal, A = .03", np.ones((1, 5)), 0.03, (1e-2, 1e-3)


class Ours:
    """The batch, as one thread calls it: checks, units, runs, certificate."""

    def __init__(self, masses, loss, accuracy):
        rows, n = masses.shape
        ones = np.ones((rows, n - 1))
        v = np.tile(struck(n), (rows, 1))
        self.given = Springs(masses, v, ones, loss * ones, 0.0 * ones), Law(1.5, accuracy, 1e7)
        self.out = room(rows, n)

    def run(self):
        assert solve(*self.given, self.out, True)[:2] == (len(self.out.v), FINISHED)
        return self.out.v


class Verlet:
    """The rival at the step that keeps an error."""

    def __init__(self, masses, loss, exact, error):
        rows, n = masses.shape
        self.fixed = masses, np.tile(struck(n), (rows, 1)), np.ones(n - 1), loss
        self.out = np.empty((rows, n))
        kept = STEPS[-1]
        few = slice(0, 300)  # of which all the others are copies
        self.fixed, whole = (masses[few], self.fixed[1][few], *self.fixed[2:]), self.fixed
        self.out = self.out[few]
        for step in STEPS[::-1]:
            if not abs(self.run(step) - exact[few]).max() <= error:
                break
            kept = step
        self.fixed, self.out = whole, np.empty((rows, n))
        self.step, self.error = kept, abs(self.run(kept) - exact).max()

    def run(self, step=None):
        verlet(*self.fixed, np.full(len(self.out), step or self.step), FAINT, self.out)
        return self.out


def least(runs, seconds=0.6):
    """Least time of each, in turns."""
    for one in runs:
        one()
    times = [np.inf] * len(runs)
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        for k, one in enumerate(runs):
            begun = time.perf_counter()
            one()
            times[k] = min(times[k], time.perf_counter() - begun)
    return times


def rows():
    """Yield the table."""
    for name, masses, loss, accuracies in cases():
        # Enough rows for one call from Python not to count.
        count = max(len(masses), 10_000 // masses.shape[1] ** 2 + 20)
        many = np.ascontiguousarray(np.resize(masses, (count, masses.shape[1])), float)
        exact = Ours(many, loss, 1e-9).run().copy()
        for accuracy in accuracies:
            ours = Ours(many, loss, accuracy)
            error = abs(ours.run() - exact).max()
            # Both within the error asked for, or as near as Verlet's smallest step comes.
            rival = Verlet(many, loss, exact, accuracy)
            mine, its = (1e6 * t / count for t in least([ours.run, rival.run]))
            asked = f"{accuracy:.0e}"
            yield name, "this package", asked, f"{error:.2e}", f"{mine:.3g}", f"{its / mine:.2g}"
            yield name, "velocity Verlet", asked, f"{rival.error:.2e}", f"{its:.3g}", 1
        if not loss:
            e, v = np.ones(many.shape[1] - 1), np.tile(struck(many.shape[1]), (count, 1))

            def rule(many=many, v=v, e=e):
                return post_impact_velocities(many, v, e, RATIO, excess="saturate")

            (its,) = least([rule])
            error = abs(rule() - exact).max()
            yield name, "the paper's rule", "", f"{error:.2e}", f"{1e6 * its / count:.3g}", ""


def main(arguments=None):
    """Measure, print and store."""
    given = options(__doc__).parse_args(arguments)
    found = []
    for row in rows():
        print(("{:24}" + "{:>18}" * 5).format(*map(str, row)), flush=True)
        found.append(row)
    write("forces.csv", COLUMNS, found, given.output)


if __name__ == "__main__":
    main()
