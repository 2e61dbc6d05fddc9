"""Time and error of the event solver, and of a Hertz chain integrated in time, in one run.

Usage::

    python benchmarks/speed.py             # about a minute, plus the first compilation
    python benchmarks/speed.py --quick     # fewer repetitions and chains

Times are medians; machines are noisy, so read the ratios.  Every error is numerical: the distance
from the converged answer of the same model, relative to the striker's speed.
"""

import argparse
import os
import statistics
import time

import numpy as np
from scipy.integrate import DOP853

from cradle import Chain, ImpulseCorrelation, collide, post_impact_velocities, runtime
from cradle.closed_form import one_collision_each, three_balls


def median_time(function, repeats, inner=1):
    """Return the median time of one call of `function`, in seconds."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        for _ in range(inner):
            function()
        times.append((time.perf_counter() - begin) / inner)
    return statistics.median(times)


def random_chains(balls, count):
    """Return random chains of that many balls, ratios within the bounds."""
    rng = np.random.default_rng(balls)
    masses = 10.0 ** rng.uniform(-0.5, 0.5, (count, balls))
    velocities = np.zeros((count, balls))
    velocities[:, 0] = 1.0
    restitution = rng.uniform(0.3, 1.0, (count, balls - 1))
    # Eq. 34 with any onward ratio: the bound of Eq. 53 is never below it, forward or backward.
    part = rng.uniform(0.0, 1.0, (count, balls - 2))
    forward = part * masses[:, 2:] / (masses[:, 2:] + masses[:, 1:-1])
    backward = part * masses[:, :-2] / (masses[:, :-2] + masses[:, 1:-1])
    return masses, velocities, restitution, forward, backward


def invariant_error(masses, velocities, after):
    """Return the worst relative error of momentum, a check where no closed form exists."""
    change = np.abs(np.sum(masses * (after - velocities), axis=-1))
    return float(np.max(change / np.sum(masses * np.abs(velocities), axis=-1)))


def hertz(balls, rtol):
    """Integrate equal elastic Hertz balls, the first striking at speed 1; (velocities, steps)."""

    def motion(_, y):
        q, v = y[:balls], y[balls:]
        force = np.maximum(q[:-1] - q[1:], 0.0) ** 1.5
        a = np.zeros(balls)
        a[:-1] -= force
        a[1:] += force
        return np.concatenate([v, a])

    y = np.zeros(2 * balls)
    y[balls] = 1.0
    solver = DOP853(motion, 0.0, y, np.inf, rtol=rtol, atol=1e-3 * rtol)
    steps = 0
    while True:
        solver.step()
        steps += 1
        q, v = solver.y[:balls], solver.y[balls:]
        # The last word: every pair is apart and stays so.
        if np.all(q[:-1] <= q[1:]) and np.all(v[:-1] <= v[1:]):
            return v.copy(), steps


def with_kernel(name, function):
    """Run `function` with the kernel of that name."""
    before = os.environ.get(runtime.VARIABLE)
    os.environ[runtime.VARIABLE] = name
    try:
        return function()
    finally:
        os.environ.pop(runtime.VARIABLE)
        if before is not None:
            os.environ[runtime.VARIABLE] = before


def measure(quick):
    """Yield (what, seconds per impact, error)."""
    repeats = 3 if quick else 9
    count = 2_000 if quick else 100_000
    chain = Chain([1.0] * 5, [1.0, 0.0, 0.0, 0.0, 0.0], 1.0)
    model = ImpulseCorrelation(0.15)
    kernels = ["plain"] if runtime.compiled() is None else ["compiled", "plain"]
    for name in kernels:
        slow = name == "plain"
        calls = 20 if slow else 200

        def one(chain=chain):
            return collide(chain, model).velocities

        def outcome(chain=chain):
            return post_impact_velocities(chain.masses, chain.velocities, 1.0, 0.15)

        for what, function in (("one, with its path", one), ("one, outcome alone", outcome)):
            after = with_kernel(name, function)
            seconds = with_kernel(name, lambda f=function, k=calls: median_time(f, repeats, k))
            error = invariant_error(chain.masses, chain.velocities, after)
            yield f"five equal elastic balls, {what}, {name}", seconds, error, "momentum"
        for balls in (3, 6):
            some = count // 100 if slow else count
            chains = [array[:some] for array in random_chains(balls, count)]

            def many(chains=chains):
                return post_impact_velocities(*chains)

            after = with_kernel(name, many)
            seconds = with_kernel(name, lambda f=many: median_time(f, repeats)) / some
            if balls == 3:
                once = one_collision_each(*chains[:3], chains[3][:, 0])
                exact = three_balls(*chains[:3], chains[3][:, 0])
                error = float(np.max(np.abs(after - exact)[once]))
                against = "closed form"
            else:
                error = invariant_error(chains[0], chains[1], after)
                against = "momentum"
            yield f"{some} chains of {balls} balls, batch, {name}", seconds, error, against
    exact, _ = hertz(5, 1e-12)
    after, steps = hertz(5, 1e-6)
    seconds = median_time(lambda: hertz(5, 1e-6), repeats)
    error = float(np.max(np.abs(after - exact)))
    yield f"five equal Hertz balls, DOP853, rtol 1e-6, {steps} steps", seconds, error, "rtol 1e-12"


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer repetitions and chains")
    rows = list(measure(parser.parse_args().quick))
    slowest = rows[-1][1]
    print(f"{'':56} {'per impact':>12} {'Hertz / this':>12} {'error':>9}  against")
    for what, seconds, error, against in rows:
        print(
            f"{what:56} {1e6 * seconds:9.2f} us {slowest / seconds:12.1f} {error:9.1e}  {against}"
        )


if __name__ == "__main__":
    main()
