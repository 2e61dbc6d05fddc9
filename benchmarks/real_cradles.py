"""The first strikes of a filmed cradle against the models.

Writes `data/film_fits.csv` and `film_distances.csv` in some minutes.
The striking side comes first; lengths are in Hertz units of the first release.  The striker's speed
was read in part from the sum of momentum: up to one degree of freedom a release is too many.
"""

from functools import partial
from itertools import product
from operator import itemgetter

import numpy as np
import pandas as pd
from chains import magnitudes
from dop853 import integrated
from scipy.optimize import least_squares
from stored import DATA, make

import cradle
from cradle import Chain, ImpulseCorrelation, SequentialCollisions, collide, spring_velocities

EQUAL = (1, 1, 1, 1, 1)
SLOWER = 0.766  # strikers of the second release over the one of the first, relative to the row


def table(name):
    """Return the columns of a file as arrays, empty fields as nan."""
    return {key: column.to_numpy() for key, column in pd.read_csv(DATA / name).items()}


def first_strikes(reading):
    """Return {release: (velocities, errors)} relative to the row, over the striker's speed."""
    t, found = pd.read_csv(DATA / "film_strikes.csv"), {}
    first = t[(t.reading == reading) & (t.strike == 1)]
    for release, rows in first.groupby("release"):
        v, sigma, before = rows[["after", "sigma_after", "before"]].to_numpy()[::-1].T
        if reading > 2:  # in the room: the row drifts
            row = before[release:].mean()
            v, sigma = (v - row) / (1 - row), np.hypot(sigma, 0.002)
        found[release] = v, sigma
    return found


def spheres(speeds, gaps, loss, masses=EQUAL):
    """Return velocities of spheres at `gaps` after F = k (d^1.5 + A d(d^1.5)/dt) without a pull."""
    return integrated(masses[: len(speeds)], speeds, loss=loss, gaps=gaps)


def by_law(model, restitution, release, apart, masses=EQUAL):
    """Return velocities of five balls; `model(k)` is the law of the balls from k on.

    Strikers that are apart come one after another: all meet in pairs after the first one.
    """
    late = release - 1 if apart else 0
    speeds = [1.0] * (release - late) + [0.0] * (5 - release)
    e = np.broadcast_to(restitution, 4)
    v = collide(Chain(masses[late:], speeds, e[late:]), model(late)).velocities
    for k in range(late, 0, -1):
        chain = Chain(masses[k - 1 :], [1.0, *v], e[k - 1 :])
        v = collide(chain, SequentialCollisions()).velocities
    return v


def ratios(p, e, release, apart, backward=None, masses=EQUAL):
    """Return velocities by the ratios p of balls 2, 3, 4."""
    back = p if backward is None else backward
    model = lambda k: ImpulseCorrelation(p[k:], back[k:], excess="saturate")  # noqa: E731
    return by_law(model, e, release, apart, masses)


def quick(speeds, gaps, loss, masses=EQUAL):
    """Return the same by the package, within a millionth."""
    gaps = np.where(np.less(gaps, 1e-9), 0.0, gaps)
    given = masses[: len(speeds)], speeds
    return spring_velocities(*given, viscosity=loss, gaps=gaps, accuracy=1e-6)


def by_spheres(p, release, apart=False, masses=EQUAL, solve=spheres):
    """Return velocities: p = gaps of contacts 2, 3, 4, A, and the gap of the strikers."""
    unit = 1.0 if release == 1 else SLOWER
    between = APART if apart else p[4]
    gaps = [between] * (release - 1) + [0.0] + list(p[release - 1 : 3])
    speeds = [unit] * release + [0.0] * (5 - release)
    return solve(speeds, np.abs(gaps), abs(p[3]), masses=masses) / unit


APART = 30.0  # Hertz units: 0.6 mm; gaps fitted to the release of two depend on it
E, LOSS, THREE = (0.5, 1.0), (0.0, 0.1), list(product((0.04, 0.12), repeat=3))
FINE = product((0.02, 0.05, 0.08, 0.11), (0.07, 0.1, 0.13), (0.1, 0.14))
GAPS = list(product((0.08, 0.17, 0.33), (0.04, 0.08, 0.12, 0.16), (0.02, 0.05)))
MASSES = [(0.95, 1.05)] * 4
# Name: velocities from parameters, release and whether strikers are apart; starts; bounds.
LAWS = {
    "pairs, e": (
        lambda p, r, a: by_law(lambda _: SequentialCollisions(), p[0], r, a),
        [[0.98]], [E]),
    "energy law (Hertz), e": (
        lambda p, r, a: by_law(lambda _: cradle.EnergyDistribution(1.0, 1.5), p[0], r, a),
        [[0.98]], [E]),
    "one ratio, e": (
        lambda p, r, a: ratios([p[0]] * 3, p[1], r, a),
        [[0.05, 0.99], [0.12, 0.99], [0.3, 0.98]], [(0, 0.5), E]),
    "one ratio, e, four masses": (
        lambda p, r, a: ratios([p[0]] * 3, p[1], r, a, masses=[1, *p[2:]]),
        [[s, 0.985, 1, 1, 1, 1] for s in (0.05, 0.1, 0.13)], [(0, 0.45), E, *MASSES]),
    "three ratios, e": (
        lambda p, r, a: ratios(p[:3], p[3], r, a),
        [[*s, 0.985] for s in FINE], [(0, 0.5)] * 3 + [E]),
    "three ratios, e, four masses": (
        lambda p, r, a: ratios(p[:3], p[3], r, a, masses=[1, *p[4:]]),
        [[*s, 0.985, 1, 1, 1, 1] for s in THREE], [(0, 0.45)] * 3 + [E, *MASSES]),
    "three ratios, four e": (
        lambda p, r, a: ratios(p[:3], p[3:], r, a),
        [[*s, *[0.985] * 4] for s in THREE], [(0, 0.5)] * 3 + [E] * 4),
    "three ratios each way, e": (
        lambda p, r, a: ratios(p[:3], p[6], r, a, p[3:6]),
        [[*s, *t, 0.985] for s in THREE for t in ([0.1] * 3, [0.04, 0.12, 0.12])],
        [(0, 0.5)] * 6 + [E]),
    "touching spheres, A": (
        lambda p, r, a: by_spheres([0, 0, 0, p[0], 0], r, a, solve=quick),
        [[0.003], [0.02]], [LOSS]),
    "touching spheres, A, four masses": (
        lambda p, r, a: by_spheres([0, 0, 0, p[0], 0], r, a, [1, *p[1:]], quick),
        [[0.005, 1, 1, 1, 1]], [LOSS, *MASSES]),
    "spheres, one gap, A": (
        lambda p, r, a: by_spheres([p[0]] * 3 + [p[1], p[0]], r, a, solve=quick),
        [[0.05, 0.005], [0.15, 0.005], [0.4, 0.005]], [(0, 6), LOSS]),
    "spheres, three gaps, A": (
        lambda p, r, a: by_spheres(p, r, a, solve=quick),
        [[*s, 0.007] for s in GAPS], [(0, 6)] * 3 + [LOSS]),
    "spheres, four gaps, A": (  # the strikers' own
        lambda p, r, _: by_spheres(p, r, solve=quick),
        [[*s, 0.007, own] for s in GAPS for own in (1.0, 3.0, 5.0)],
        [(0, 6)] * 3 + [LOSS, (0, 6)]),
}  # fmt: skip
TOGETHER = [name for name in LAWS if name != "spheres, three gaps, A"]
ONE_BY_ONE = [name for name in LAWS if name != "spheres, four gaps, A"]
SUMS = ("chi_one", "chi_two", "chi_three")
COLUMNS = ["reading", "law", "strikers", "fitted", "freedom", *SUMS, "parameters"]


def misfits(velocities, data, releases):
    """Return residuals of {release: velocities}; the scale of each is free within 1 %."""
    out = []
    for release in releases:
        (v, sigma), w = data[release], velocities(release)
        scale = (1e4 + (v * w / sigma**2).sum()) / (1e4 + (w * w / sigma**2).sum())
        out += [*((v - scale * w) / sigma), (scale - 1) / 0.01]
    return np.array(out)


def chi_square(law, p, apart, data, releases):
    """Return the sum of squared residuals of a law; the three strikers come one by one."""
    off = misfits(lambda r: LAWS[law][0](p, r, apart or r == 3), data, releases)
    return float((off**2).sum())


def fitted(law, apart, data, releases):
    """Return the parameters of the best fit, and of other minima that are nearly as deep."""
    solve, starts, bounds = LAWS[law]
    fits = [
        least_squares(
            lambda p: misfits(lambda r: solve(p, r, apart or r == 3), data, releases),
            start,
            bounds=np.transpose(bounds),
            diff_step=3e-3,  # well above the noise of the integration
            x_scale=np.maximum(np.abs(start), 0.01),
            max_nfev=40,
        )
        for start in starts
    ]
    minima = []
    for fit in sorted(fits, key=lambda fit: fit.cost):
        near = 2 * (fit.cost - (minima or [fit])[0].cost) < 3.84  # 95 % of one number
        if near and all(abs(fit.x - one.x)[:3].max() > 0.02 for one in minima):
            minima.append(fit)
    return [fit.x for fit in minima]


def fits_of(reading, law, apart):
    """Yield rows of a law fitted to the releases of one and two, to one alone, and to all."""
    data, count = first_strikes(reading), len(LAWS[law][2])
    how = "own gap" if "four gaps" in law else "apart" if apart else "together"
    minima = fitted(law, apart, data, (1, 2))
    names = ("both", "both, second", "both, third") if count < 6 else ("both",)
    found = [(name, 10 - count, p) for name, p in zip(names, minima, strict=False)]
    if count < 3 or (apart and count == 4):
        minima = sorted(map(tuple, fitted(law, apart, data, (1,))))
        found += [("one" if count < 3 else f"one, {k}", 5, p) for k, p in enumerate(minima, 1)]
    if apart and 3 in data:
        found.append(("all", 15 - count, fitted(law, apart, data, (1, 2, 3))[0]))
    for name, free, p in found:
        p = [float(f"{x:.5g}") for x in p]  # as stored
        sums = [chi_square(law, p, apart, data, (r,)) for r in data]
        chi = [*(f"{x:.4g}" for x in sums), ""][:3]
        row = [reading, law, how, name, free, *chi, " ".join(f"{x:.5g}" for x in p)]
        print(*row, sep=", ", flush=True)
        yield row


def out_of_reach(p):
    """Return velocities after two strikers by gaps, balls 2 and 3 far apart before the second."""
    v = np.array([SLOWER, *quick([SLOWER, 0, 0, 0], [0.0, *p[1:3]], p[3])])
    while (meets := np.diff(v) < -1e-9).any():  # then all are apart: pairs
        k = int(meets.argmax())
        v[k : k + 2] = quick(v[k : k + 2], [0.0], p[3])
    return v / SLOWER


def misfits_at(between, data, releases=(1, 2)):
    """Return residuals as a function of three gaps and A, two strikers being so far apart."""

    def by(p, release):
        if release == 2 and between is None:
            return out_of_reach(p)
        return by_spheres([*p, between], release, release == 3, solve=quick)

    return lambda p: misfits(lambda release: by(p, release), data, releases)


lower = partial(min, key=itemgetter(0))  # of pairs of a chi-square and where it is


def best_at(between, data, starts):
    """Return the least chi-square of the first two releases from some starts, and where it is."""
    limits, off = ([0] * 4, [1, 1, 1, 0.1]), misfits_at(between, data)
    fits = (least_squares(off, p, bounds=limits, diff_step=1e-3) for p in starts)
    return lower((2.0 * fit.cost, fit.x) for fit in fits)


def film_distances():
    """Gaps chosen anew for each distance of two strikers, in Hertz units; the last out of reach."""
    yield "apart both three gap_2 gap_3 gap_4 loss"
    data, rng = first_strikes(4), np.random.default_rng(1)
    distances = [*np.geomspace(2.5, 250, 81), None]
    random = 0.08 * magnitudes(rng, 2, (40, 3))
    starts = [[*gaps, 0.007] for gaps in (*GAPS, *random)]
    found = [best_at(between, data, starts) for between in distances]
    last = len(distances) - 2
    ways = [(k, k + 1) for k in range(last)[::-1]] + [(k + 1, k) for k in range(last)]
    for k, near in ways * 2:  # the valley of a neighbour may be deeper
        found[k] = lower([found[k], best_at(distances[k], data, [found[near][1]])])
    for between, (both, p) in zip(distances, found, strict=True):
        three = (misfits_at(between, data, (3,))(p) ** 2).sum()
        yield "" if between is None else float(between), both, float(three), *map(float, p)


def film_fits():
    yield COLUMNS
    for reading, (apart, laws) in product((4, 2), ((False, TOGETHER), (True, ONE_BY_ONE))):
        for law in laws:
            yield from fits_of(reading, law, apart)


if __name__ == "__main__":
    make(__doc__, film_fits, film_distances)
