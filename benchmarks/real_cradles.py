"""Two real cradles against the models: first strikes of a film, half a minute of swinging, gaps.

Usage::

    python benchmarks/real_cradles.py            # prints tables, some minutes
    python benchmarks/real_cradles.py strikes    # or half_minute, or gaps

Strikes: velocities relative to the row, over the striker's, the striking side first.  Lengths in
Hertz units of the first release, (m v^2 / k)^(2/5); v its striker's speed.  The striker's speed was
read in part from the sum of momentum: of the five numbers of a release one may not be free, so the
degrees of freedom printed are too many by up to one a release.
"""

import csv
import itertools
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares

from cradle import (
    Chain,
    EnergyDistribution,
    ImpulseCorrelation,
    SequentialCollisions,
    SpringChain,
    collide,
    ratio_table,
)

DATA = Path(__file__).parents[1] / "data"
READINGS = (1, 2, 3, 4)
SLOWER = 0.766  # strikers of the second release over the one of the first, relative to the row


def table(name):
    """Return the columns of a file as arrays, empty fields as nan."""
    with (DATA / name).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        key: np.array([float(r[key] or "nan") if key != "kind" else r[key] for r in rows])
        for key in rows[0]
    }


def first_strikes(reading):
    """Return {release: (velocities, errors)} relative to the row, over the striker's speed."""
    t, found = table("film_strikes.csv"), {}
    for release in (1, 2):
        use = (t["reading"] == reading) & (t["release"] == release) & (t["strike"] == 1)
        v, sigma, before = (t[key][use][::-1] for key in ("after", "sigma_after", "before"))
        if reading > 2:  # in the room: the row drifts
            row = before[release:].mean()
            v, sigma = (v - row) / (1 - row), np.maximum(np.hypot(sigma, 0.002), 0.002)
        found[release] = v, sigma
    return found


def spheres(speeds, gaps, loss, limit=400.0):
    """Return velocities of equal spheres after F = k (d^1.5 + A d(d^1.5)/dt), never pulling.

    The balls rest at `gaps` in front of one another; mass and k are 1.
    """
    n, room = len(speeds), np.asarray(gaps, float)

    def rate(_, state):
        x, v = state[:n], state[n:]
        deep = np.maximum(x[:-1] - x[1:] - room, 0.0)
        push = deep**1.5 + loss * 1.5 * np.sqrt(deep) * (v[:-1] - v[1:])
        push = np.maximum(push, 0.0)
        return np.concatenate([v, np.append(0, push) - np.append(push, 0)])

    state, time = np.concatenate([np.zeros(n), speeds]), 0.0
    while time < limit:
        closing = state[n:-1] - state[n + 1 :]
        apart = room - (state[: n - 1] - state[1:n])
        if time and (closing < 1e-6).all() and (apart > 0).all():
            break
        if (apart > 0).all():  # nothing touches: fly to the next contact
            wait = np.min(np.where(closing > 1e-9, apart / np.maximum(closing, 1e-9), np.inf))
            state[:n] += wait * state[n:]
            time += wait
        run = solve_ivp(rate, (0, 4), state, method="DOP853", rtol=1e-8, atol=1e-10, max_step=0.3)
        state, time = run.y[:, -1], time + 4.0
    return state[n:]


def by_law(model, restitution, release):
    """Return the velocities that a model of the package gives to five equal balls."""
    chain = Chain(np.ones(5), [1.0] * release + [0.0] * (5 - release), restitution)
    return collide(chain, model).velocities


def by_spheres(p, release):
    """Return velocities: p = gaps of contacts 2, 3, 4 and of the two strikers, A."""
    unit = 1.0 if release == 1 else SLOWER
    gaps = [0.0 if release == 1 else p[3], p[0] if release == 1 else 0.0, p[1], p[2]]
    return spheres([unit] * release + [0.0] * (5 - release), np.abs(gaps), abs(p[4])) / unit


# Name: velocities from parameters and release, starts, bounds.
E = (0.5, 1.0)
LAWS = {
    "sequential, e": (lambda p, r: by_law(SequentialCollisions(), p[0], r), [[0.98]], [E]),
    "one ratio, e": (
        lambda p, r: by_law(ImpulseCorrelation(p[0], excess="saturate"), p[1], r),
        [[0.05, 0.99], [0.12, 0.99], [0.3, 0.98]],
        [(0, 0.5), E],
    ),
    "three ratios, e": (
        lambda p, r: by_law(ImpulseCorrelation(p[:3], excess="saturate"), p[3], r),
        [[*s, 0.985] for s in itertools.product((0.04, 0.12), repeat=3)],
        [(0, 0.5)] * 3 + [E],
    ),
    "energy law (Hertz), e": (
        lambda p, r: by_law(EnergyDistribution(1.0, 1.5), p[0], r),
        [[0.98]],
        [E],
    ),
    "spheres touching, elastic": (lambda _, r: by_law(SpringChain(), 1.0, r), [[]], []),
    "spheres touching, A": (
        lambda p, r: by_spheres([0, 0, 0, 0, p[0]], r),
        [[0.003], [0.02]],
        [(0, 0.1)],
    ),
    "spheres, one gap, A": (
        lambda p, r: by_spheres([p[0]] * 4 + [p[1]], r),
        [[0.05, 0.005], [0.15, 0.005], [0.4, 0.005]],
        [(0, 6), (0, 0.1)],
    ),
    "spheres, four gaps, A": (
        by_spheres,
        [[a, b, c, g, 0.007] for a, b, c in [(0.17, 0.03, 0.05), (0.1, 0.05, 0.05), (0.3,) * 3]
         for g in (1.0, 3.0)],
        [(0, 6)] * 4 + [(0, 0.1)],
    ),
}  # fmt: skip
# The gap that only this release has: of the contact that strikes in the other, of the two strikers.
OWN_GAP = {1: 0, 2: 3}
GAPS = np.append(np.arange(0, 1, 0.02), np.arange(1, 6, 0.2))


def misfits(law, p, data, releases):
    """Return residuals; the scale of each release is free within 1 %."""
    out = []
    for release in releases:
        v, sigma = data[release]
        w = law(p, release)
        scale = (1e4 + (v * w / sigma**2).sum()) / (1e4 + (w * w / sigma**2).sum())
        out += [*((v - scale * w) / sigma), (scale - 1) / 0.01]
    return np.array(out)


def fitted(name, data, releases):
    """Return the best of several fits."""
    law, starts, bounds = LAWS[name]
    if not bounds:
        return np.array([]), float((misfits(law, [], data, releases) ** 2).sum())
    best = None
    for start in starts:
        fit = least_squares(
            lambda p: misfits(law, p, data, releases),
            start,
            bounds=np.transpose(bounds),
            diff_step=3e-3,  # well above the noise of the integration
            x_scale=np.maximum(np.abs(start), 0.01),
            max_nfev=25,
        )
        best = fit if best is None or fit.cost < best.cost else best
    return best.x, 2 * best.cost


def strikes():
    """Print chi-square of each law: both releases, and one fitted predicting the other."""
    for reading in READINGS:
        print(f"\nReading {reading}: velocities and errors, the striking side first")
        data = first_strikes(reading)
        for release, (v, sigma) in data.items():
            print(release, *(f"{a:+.4f}+-{b:.4f}" for a, b in zip(v, sigma)))
    for reading in (4, 2):
        data = first_strikes(reading)
        print(f"\nFits to reading {reading}: chi-square / degrees of freedom")
        for name, (law, _, bounds) in LAWS.items():
            p, both = fitted(name, data, (1, 2))
            print(f"{name:28s} both {both:9.1f} / {10 - len(bounds)}", np.round(p, 4), flush=True)
            for one, other in ((1, 2), (2, 1)):
                q, own = fitted(name, data, (one,))
                free = OWN_GAP[other] if name == "spheres, four gaps, A" else None
                wrong = [
                    ((misfits(law, z, data, (other,)) ** 2).sum(), list(z))
                    for z in ([q] if free is None else [with_gap(q, free, g) for g in GAPS])
                ]
                wrong, z = min(wrong)
                print(f"    fitted to {one}: {own:.1f} / {max(5 - len(bounds), 0)};", end=" ")
                print(f"predicts {other}: {wrong:.1f} / {5 - (free is not None)}", end=" ")
                print(np.round(law(z, other), 3), flush=True)


def with_gap(p, index, gap):
    """Return parameters with one gap changed."""
    p = np.array(p)
    p[index] = gap
    return p


def half_minute():
    """Print what the swing of five balls says: the mean, the end, the outer amplitudes."""
    t = table("cradle_trace.csv")
    time, x = t["t_s"], np.stack([t[f"x{k}_m"] for k in range(1, 6)])
    use = np.isfinite(x).all(0) & (time > 0.8)
    time, mean = time[use], x[:, use].mean(0)

    def swing(p):
        return p[4] + p[0] * np.exp(-p[1] * time) * np.cos(p[2] * time + p[3])

    fits = [
        least_squares(lambda p: (swing(p) - mean) / 1e-4, [0.006, 0.03, 8.585, phase, 0.0],
                      x_scale=[1e-3, 0.01, 0.01, 1, 1e-4])
        for phase in np.arange(0, 6.3, 0.8)
    ]  # fmt: skip
    p = min(fits, key=lambda fit: fit.cost).x
    print(f"\nMean of five: {abs(p[0]) * 1e3:.3f} mm exp(-{p[1]:.4f} t) cos, period", end=" ")
    print(f"{2 * np.pi / p[2]:.4f} s; residual rms {np.std(swing(p) - mean) * 1e6:.0f} um")
    peaks, common = table("cradle_peaks.csv"), table("cradle_common.csv")
    flights = peaks["kind"] == "flight"
    first = np.abs(peaks["x_m"][flights & (peaks["t_s"] < 2)])
    print(f"A fifth of the first flights ({1e3 * first.mean():.2f} mm), decayed, against seen:")
    for at in (15.0, 20.0, 25.0, 28.0):
        near = np.abs(common["t_mid_s"] - at) < 1.5
        outer = np.abs(peaks["x_m"][np.abs(peaks["t_s"] - at) < 1.5])
        predicted = first.mean() / 5 * np.exp(-p[1] * (at - 1.3))
        print(f"  {at:4.0f} s: predicted {1e3 * predicted:.2f} mm, mean of five", end=" ")
        print(f"{1e3 * abs(p[0]) * np.exp(-p[1] * at):.2f}; inner", end=" ")
        print(
            f"{1e3 * np.nanmean(common['amplitude_m'][near]):.2f}, outer {1e3 * outer.mean():.2f}"
        )
    for ball in (1, 5):
        use = (peaks["ball"] == ball) & flights & (peaks["t_s"] < 20)
        at, size = peaks["t_s"][use], np.abs(peaks["x_m"][use])
        error = peaks["u_x"][use]
        for name, shape in (("line", lambda z: 1 - z), ("exponential", lambda z: np.exp(-z))):

            def curve(q, shape=shape, data=(at, size, error)):
                return (q[0] * shape(q[1] * data[0]) - data[1]) / data[2]

            fit = least_squares(curve, [0.028, 0.03])
            print(f"Ball {ball}, {name}: {1e3 * fit.x[0]:.2f} mm, {fit.x[1]:.4f} per s;", end=" ")
            print(f"chi-square {2 * fit.cost:.1f} / {len(at) - 2}")


def gaps():
    """Print the ratio that a gap behind the struck ball implies: three equal elastic spheres."""
    listed = ratio_table()
    print("\nTable 2, ratios:", np.round(np.percentile(listed["ratio"], (0, 25, 50, 75, 100)), 3))
    for ball in "ABCD":
        print(ball * 3, float(listed.set_index("triplet")["ratio"][ball * 3]), end="  ")
    bulk = 2.1e11 / (2 * (1 - 0.3**2))  # 1 / ((1 - nu^2) / E + ...), steel on steel
    radius, mass = 0.01109, 0.0448
    stiff = 4 / 3 * bulk * np.sqrt(radius / 2)

    def implied(units):
        v = spheres([1.0, 0.0, 0.0], [0.0, units], 0.0)
        chain = Chain([1, 1, 1], [1, 0, 0], 1.0)

        def misfit(ratio):
            return collide(chain, ImpulseCorrelation(ratio)).velocities[1] - v[1]

        return v, brentq(misfit, 0, 0.35) if misfit(0) < 0 else 0.0

    for units in (0, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2):
        v, ratio = implied(units)
        print(
            f"\ngap {units:5.2f} Hertz units: velocities {np.round(v, 4)}, ratio {ratio:.4f}",
            end="",
        )
    print()
    for speed in (0.36, 0.5, 1.0, 2.0):
        unit = (mass * speed**2 / stiff) ** 0.4
        row = [implied(gap * 1e-6 / unit)[1] for gap in (0, 0.1, 0.3, 1, 2, 5)]
        print(f"{speed} m/s, unit {unit * 1e6:.1f} um; gaps 0 .1 .3 1 2 5 um:", np.round(row, 3))


if __name__ == "__main__":
    for name in sys.argv[1:] or ("gaps", "half_minute", "strikes"):
        {"gaps": gaps, "half_minute": half_minute, "strikes": strikes}[name]()
