"""Fit half a minute of a real cradle: its damping, then period, one gap and one law of loss.

Writes `data/cradle_fits.csv` in a quarter of an hour, and `data/cradle_turns.csv` in half a minute.
The mean of the five balls gives the damping and nearly the period: no impact changes it.  The rest
is fitted to the turning points of the outer balls; where these hang at rest is subtracted.
"""

import numpy as np
from real_cradles import table
from scipy.optimize import curve_fit, least_squares
from stored import make, read

import cradle
from cradle import Chain, ImpulseCorrelation, Pendulums, SequentialCollisions, swing

STEEL = {"masses": [0.044756] * 2, "stiffness": 1e10}  # of the balls
RATE = 200  # samples a second of a computed swing
COLUMNS = ["law", "loss", "gap_m", "release_m", "release_s", "period_s", "chi_places", "chi_times"]
TURNS = ["law", "ball", "t_s", "x_m"]
RATIO = 0.3  # tried in the place of pairs: ", ratio" behind a law
# Law: starts of loss and gap; their steps (None: not fitted).
STARTS = {
    "constant loss": ([(0.8e-3, 85e-6), (1e-3, 70e-6)], (1e-4, 1e-5)),
    "constant loss, small angles": ([(0.8e-3, 85e-6)], (1e-4, 1e-5)),
    "viscous loss": ([(0.9e-7, 85e-6), (1.2e-7, 80e-6)], (1e-8, 1e-5)),
    "constant restitution": ([(0.994, 83e-6), (0.994, 91e-6), (0.9915, 70e-6)], (1e-3, 1e-5)),
    "touching": ([(0.988, 0.0), (0.993, 0.0)], (1e-3, None)),
}


def common():
    """Return amplitude (at t = 0, m), damping (1/s), period and first extreme (s) of the mean."""
    t = table("cradle_trace.csv")
    mean, time = np.mean([t[f"x{k}_m"] for k in range(1, 6)], axis=0), t["t_s"]
    use = np.isfinite(mean) & (time > 0.8)

    def wave(time, damping, period, cosine, sine, middle):
        turn = 2 * np.pi * time / period
        return np.exp(-damping * time) * (cosine * np.cos(turn) + sine * np.sin(turn)) + middle

    start = 0.027, 0.732, 0.01, 0.0, 0.0
    (damping, period, cosine, sine, _), _ = curve_fit(wave, time[use], mean[use], start)
    phase = np.arctan2(-sine, cosine)  # mean = size exp(-damping t) cos(2 pi t/T + phase)
    first = (np.pi - phase) % (2 * np.pi) * period / (2 * np.pi)
    return np.hypot(cosine, sine), damping, period, first


def peaks():
    """Return ball (0 or 4), time, place and their uncertainties of every turning point."""
    t = table("cradle_peaks.csv")
    use = np.array([not kind.startswith("release") for kind in t["kind"]])
    return [t["ball"][use].astype(int) - 1, *(t[k][use] for k in ("t_s", "x_m", "u_t", "u_x"))]


def swung(law, parameters, damping):
    """Return the run of `swing` of a law at (loss, gap, release place, release time, period)."""
    loss, gap, place, start, period = parameters
    model = ImpulseCorrelation(RATIO) if law.endswith("ratio") else SequentialCollisions()
    e = loss
    if "loss" in law:
        constant = law.startswith("constant")
        kept = cradle.ConstantLoss(loss) if constant else cradle.ViscousLoss(loss, **STEEL)
        model, e = cradle.SpeedDependent(model, kept), 1.0
    length, angle = 9.81 * (period / 2 / np.pi) ** 2, "small" if "small" in law else "full"
    hanging = Pendulums(length, gaps=gap, damping=damping, angle=angle)
    times = np.arange(0, 29.95 - start, 1 / RATE)
    return swing(Chain([1] * 5, [0] * 5, e), model, [place, 0, 0, 0, 0], times, pendulums=hanging)


def turning(run, ball, near):
    """Return place and time where a ball of a run turns, near a time."""
    low, high = (int(max(0, (near + d) * RATE)) for d in (-0.12, 0.12))
    x, v = run.positions[low:high, ball], run.velocities[low:high, ball]
    turns = v * np.append(v[1:], v[-1]) <= 0  # or is struck, near the lowest point
    i = (np.abs(x) * turns).argmax()
    # From the sample on it is slowed down by g x / l.
    wait = v[i] / (run.pendulums.gravity / run.pendulums.length * x[i])
    return x[i] + 0.5 * v[i] * wait, run.times[low + i] + wait


def turns(run, start, found):
    """Return places and times, in the time of the film, of the computed turning points, (2, K)."""
    at = [turning(run, k, near - start) for k, near in zip(*found[:2])]
    return np.transpose(at) + np.array([[0.0], [start]])


def misfits(run, start, found):
    """Return residuals of places and of times, over their uncertainties, (2, K)."""
    ball, time, place, u_time, u_place = found
    off, late = np.array([place, time]) - turns(run, start, found)
    for k in (0, 4):  # where it hangs at rest
        off[ball == k] -= np.average(off[ball == k], weights=u_place[ball == k] ** -2.0)
    return np.array([off / u_place, late / u_time])


def fitted(law, start, steps, swing_of_mean, found):
    """Return the parameters of one fit, by least squares with wide differences."""
    size, damping, period, first = swing_of_mean
    begin = first + round((0.75 - first) / period) * period
    p = np.array([*start, -5 * size * np.exp(-damping * begin), begin, period - 5e-4])
    steps = (*steps, 1e-3, 0.01, 1e-4)
    free = np.array([step is not None for step in steps])
    unit = np.array([step or 1.0 for step in steps]) * free

    def residual(z):
        q = p.copy()
        q[free] += unit[free] * z
        q[0] = min(q[0], 1.0)  # restitution; a loss is far below
        return misfits(swung(law, q, damping), q[3], found).ravel()

    def slope(z):
        each = 0.05 * np.eye(len(z))
        return np.stack([(residual(z + d) - residual(z - d)) / 0.1 for d in each], axis=1)

    fit = least_squares(residual, np.zeros(free.sum()), jac=slope, max_nfev=12)
    p[free] += unit[free] * fit.x
    p[0] = min(p[0], 1.0)
    return p


def cradle_fits():
    """Yield the best fit of each law from several starts."""
    yield COLUMNS
    mean, found = common(), peaks()
    for law, (starts, steps) in STARTS.items():
        fits = []
        for start in starts:
            p = [float(f"{x:.6g}") for x in fitted(law, start, steps, mean, found)]
            fits.append(((misfits(swung(law, p, mean[1]), p[3], found) ** 2).sum(axis=1), p))
        chi, p = min(fits, key=lambda fit: fit[0].sum())
        yield [law, *(f"{x:.6g}" for x in p), *(f"{x:.4g}" for x in chi)]


def cradle_turns():
    """Yield the turning points of each stored fit, and of one with a ratio."""
    yield TURNS
    mean, found = common(), peaks()
    fits = read("cradle_fits.csv")
    fits += [{**x, "law": x["law"] + ", ratio"} for x in fits if "restitution" in x["law"]]
    for row in fits:
        p = [float(row[name]) for name in COLUMNS[1:6]]
        places, times = turns(swung(row["law"], p, mean[1]), p[3], found)
        for ball, place, time in zip(found[0], places, times):
            yield [row["law"], ball + 1, f"{time:.5f}", f"{place:.7f}"]


if __name__ == "__main__":
    make(__doc__, cradle_fits, cradle_turns)
