"""Contact forces against plain velocity Verlet: microseconds a chain at a measured error, one run.

Writes `data/forces.csv` in a minute.
Both are compiled and run on one thread, in turns; each time is the least of many.  Verlet has the
largest step from which on all smaller ones keep the error that ours is asked for.  The last rows of
each chain are the paper's rule, restitution that of two of the spheres: with ratios that fit each
three neighbours as elastic spheres (of random chains equal ones), and with one for all.
"""

import os
import time
from functools import cache, partial
from itertools import takewhile

import numpy as np
from chains import magnitudes
from measure import cpu
from stored import make
from verlet import verlet

os.environ["CRADLE_KERNEL"] = "compiled"
from cradle import Chain, SpringChain, collide, post_impact_velocities, spring_velocities
from cradle.kernel.kinks import Law, Springs
from cradle.kernel.state import FINISHED
from cradle.measures import effective_ratio
from cradle.runtime.job import follow, motions

FAINT = 1e-6  # compressions and speeds, relative to the first, at which Verlet stops
STEPS = np.geomspace(0.8, 2e-3, 90)  # of Verlet
RATIO = 0.132503287  # gives three equal balls what elastic spheres give them
#: One ratio for all balls: measured (Table 2, AAA), and what the textbooks assume.
RATIOS = {"measured ratio": 0.167, "pair after pair": 0.0, "all as one body": 1.0}


def struck(rows, n):
    return np.tile(np.eye(n)[0], (rows, 1))


def cases():
    """Yield names, masses (a row each), A of the losses, and accuracies asked for."""
    yield "5 equal", np.ones((1, 5)), 0.0, (1e-2, 1e-3, 1e-4, 1e-6)
    yield "1 1 .1 1 1", np.array([[1, 1, 0.1, 1, 1]]), 0.0, (1e-2, 1e-3)
    yield "20 equal", np.ones((1, 20)), 0.0, (1e-2, 1e-3)
    yield "ABCCA", np.array([[45, 53, 53, 53, 45]]) / 45, 0.0, (1e-2, 1e-3)  # grams, as elastic
    yield "100 equal", np.ones((1, 100)), 0.0, (1e-2, 1e-3)
    rng = np.random.default_rng(1)
    random = magnitudes(rng, 2, (300, 5))
    yield "5 random, two decades", random, 0.0, (1e-2, 1e-3)
    yield "5 equal, A = .03", np.ones((1, 5)), 0.03, (1e-2, 1e-3, 1e-4)
    six = magnitudes(rng, 2, (300, 6))
    yield "6 random, two decades", six, 0.0, (1e-3,)
    yield "6 random, A = .03", six, 0.03, (1e-3,)


def ours(masses, loss, accuracy):
    """Return the batch, as one thread calls it: checks, units, runs, certificate."""
    rows, n = masses.shape
    ones, out = np.ones((rows, n - 1)), motions(rows, n)
    springs = Springs(masses, struck(rows, n), ones, loss * ones, 0.0 * ones)

    def run():
        assert follow(springs, Law(1.5, accuracy, 1e7), out, True)[:2] == (rows, FINISHED)
        return out.v

    return run


@cache
def implied(masses):
    """Return the ratio of three elastic spheres, the first striking."""
    return effective_ratio(collide(Chain(masses, [1, 0, 0]), SpringChain()))


def fitted(masses):
    """Return forward and backward ratios that fit three neighbours."""
    n = masses.shape[1]
    if (masses == masses[0]).all():
        threes = [tuple(masses[0, k : k + 3].tolist()) for k in range(n - 2)]
        return [implied(m) for m in threes], [implied(m[::-1]) for m in threes]
    return RATIO, RATIO


def rule(masses, loss, ratios):
    rows, n = masses.shape
    left, right = spring_velocities([1, 1], [1, 0], viscosity=loss, accuracy=1e-6)
    e = right - left if loss else 1.0  # elastic spheres to all digits
    given = masses, struck(rows, n), e, *ratios
    return partial(post_impact_velocities, *given, excess="saturate")


def rival(masses, loss):
    """Return Verlet, as a function of the step."""
    v = struck(*masses.shape)
    return lambda step: verlet(masses, v, 1.0, 1.5, loss, step, FAINT)[0]


def largest_step(masses, loss, exact, error):
    """Return the step from which on all smaller ones of Verlet keep an error."""
    run, known = rival(masses[:300], loss), exact[:300]  # all the others are copies
    kept = takewhile(lambda step: abs(run(step) - known).max() <= error, STEPS[::-1])
    return max(kept, default=STEPS[-1])


def least(runs, seconds=0.6):
    """Least processor time of each, in turns: other work on the machine hardly counts."""
    for one in runs:
        one()
    times = [np.inf] * len(runs)
    end = time.process_time() + seconds
    while time.process_time() < end:
        times = [min(known, cpu(one)) for known, one in zip(times, runs)]
    return times


def forces():
    yield "chain method asked error microseconds ratio"
    for name, masses, loss, accuracies in cases():
        # Enough rows for one call from Python not to count.
        count = max(len(masses), 10_000 // masses.shape[1] ** 2 + 20)
        many = np.ascontiguousarray(np.resize(masses, (count, masses.shape[1])), float)
        exact = ours(many, loss, 1e-9)().copy()
        for accuracy in accuracies:
            # Both within the error asked for, or as near as Verlet's smallest step comes.
            step = largest_step(many, loss, exact, accuracy)
            one, other = ours(many, loss, accuracy), partial(rival(many, loss), step)
            errors = [f"{abs(run() - exact).max():.2e}" for run in (one, other)]
            mine, its = (1e6 * t / count for t in least([one, other]))
            asked = f"{accuracy:.0e}"
            yield name, "this package", asked, errors[0], f"{mine:.3g}", f"{its / mine:.2g}"
            yield name, "velocity Verlet", asked, errors[1], f"{its:.3g}", 1
        rules = {"the paper's rule": fitted(many)} | {key: (r, r) for key, r in RATIOS.items()}
        runs = [rule(many, loss, ratios) for ratios in rules.values()]
        for method, run, its in zip(rules, runs, least(runs, 1.2), strict=True):
            error = abs(run() - exact).max()
            yield name, method, "", f"{error:.2e}", f"{1e6 * its / count:.3g}", ""


if __name__ == "__main__":
    make(__doc__, forces)
