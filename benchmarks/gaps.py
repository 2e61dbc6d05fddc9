"""Gaps and leans: what a row of spheres does when its balls do not just touch.

Writes `data/gaps_five.csv` and `data/gaps_triplets.csv` in ten minutes.
Spheres push with F = k s^1.5, where ds = u dt while they close with u, and u dt / e^2 while they
give back: the energy law of Liu, Zhao and Brogliato, in time.  A gap starts at s = -gap, a lean at
s > 0, balanced by constant forces.  Lengths are in Hertz units, (m v^2 / k)^(2/5).
"""

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from stored import make

import cradle
from cradle import Chain, SpringChain, collide, paper_chain, post_impact_velocities
from cradle.measures import effective_ratio
from cradle.tables import ball_masses

# Row of five: gaps of all three contacts at rest.
GAPS = (0.0, *(float(f"{10 ** (k / 8):.4g}") for k in range(-24, 5)))
# Triplets: the contact that the striker does not touch; negative for a lean.
SHIFTS = np.round(
    [*-np.arange(1, 0.1, -0.05), *np.arange(-10, 10) / 100, *np.arange(2, 20) / 20,
     *np.arange(4, 17) / 4], 3
) + 0.0  # fmt: skip
ONE = np.linspace(0, 0.5, 101)  # ratios
QUOTIENTS = np.array([float(f"{10 ** (k / 4):.4g}") for k in range(-16, 17)])  # stiffness
LAWS = {
    "sequential": cradle.SequentialCollisions(),
    "energy_hertz": cradle.EnergyDistribution(1.0),
    "energy_linear": cradle.EnergyDistribution(1.0, 1),
    "convex": cradle.QuadraticDissipation(),
    "fused": cradle.FusedChain(),
}


def strike(masses, velocities, restitution, gaps, stiffness=1.0, step=0.02, longest=60.0):
    """Return velocities (..., N) after the impact of spheres at `gaps` (..., N - 1).

    What is still closing after the time `longest`, or is closed when nothing pushes any more, goes
    on as pairs, one after the other.
    """
    m, v, e, s = (np.asarray(x, float) for x in (masses, velocities, restitution, gaps))
    n = m.shape[-1]
    row = np.broadcast_shapes(m.shape, v.shape, *((*x.shape[:-1], n) for x in (e, s)))
    contacts = (*row[:-1], n - 1)
    m, e = np.broadcast_to(m, row), np.broadcast_to(e, contacts)
    # The states of the contacts, then the velocities of the balls.
    y = np.concatenate([-np.broadcast_to(s, contacts), np.broadcast_to(v, row)], -1)
    held = stiffness * np.maximum(y[..., : n - 1], 0.0) ** 1.5

    def rate(y):
        s, v = y[..., : n - 1], y[..., n - 1 :]
        closing = v[..., :-1] - v[..., 1:]
        push = stiffness * np.maximum(s, 0.0) ** 1.5 - held
        slow = np.where((closing < 0) & (s > 0), closing / np.maximum(e, 1e-3) ** 2, closing)
        return np.concatenate([slow, -np.diff(push, prepend=0, append=0) / m], -1)

    left, time, out = np.ones(row[:-1], bool), 0.0, np.empty(row)
    while time < longest and left.any():
        a = rate(y)  # Runge-Kutta of order four
        b = rate(y + step / 2 * a)
        c = rate(y + step / 2 * b)
        y = y + step / 6 * (a + 2 * b + 2 * c + rate(y + step * c))
        time += step
        s, v = y[..., : n - 1], y[..., n - 1 :]
        ordered = (v[..., :-1] <= v[..., 1:]).all(-1)
        done = left & (s <= 0).all(-1) & (ordered | (held > 0).any(-1))
        out[done] = v[done]
        left &= ~done
    if left.any():
        out[left] = v[left]
        out = post_impact_velocities(m, out, e, np.zeros(n - 2))
    return out


def gaps_five():
    """Yield gap and velocities: five equal elastic balls, the first striking."""
    yield "gap v1 v2 v3 v4 v5"
    after = strike([1] * 5, np.eye(5)[0], 1.0, np.outer(GAPS, [0.0, 1.0, 1.0, 1.0]))
    yield from (map(written, row) for row in np.column_stack([GAPS, after]))


def of_triplets(names):
    """Return masses over that of A, restitution, and the outcomes that Table 2 encodes."""
    pairs = [paper_chain(t, excess="saturate") for t in names]
    masses = np.array([chain.masses for chain, _ in pairs]) / ball_masses()["A"]
    listed = np.array([collide(chain, model).velocities for chain, model in pairs])
    return masses, np.array([chain.restitution for chain, _ in pairs]), listed


def off(after, listed):
    return np.abs(after - listed).max(-1)


def shared(errors, keys):
    """Return the choice (last axis) that each group of equal keys has the least rms error with."""
    return pd.DataFrame(errors**2).groupby(keys).transform("mean").to_numpy().argmin(axis=1)


def by_pair(names, masses, e, listed):
    """Return outcomes with one stiffness a pair of kinds, fitted to all triplets.

    Twelve searches end in as many valleys; the deepest is taken.
    """
    pairs = [["".join(sorted(t[k : k + 2])) for k in (0, 1)] for t in names]
    kinds, place = np.unique(pairs, return_inverse=True)

    def after(p):
        k = np.exp(np.append(p, 0.0)[place])
        k /= k.max(1, keepdims=True)
        return strike(masses, [1, 0, 0], e, np.zeros((len(names), 2)), k, 0.04, 100.0)

    fits = [
        least_squares(lambda p: (after(p) - listed).ravel(), start, diff_step=0.02, max_nfev=60)
        for start in np.random.default_rng(0).normal(0, 1, (12, len(kinds) - 1))
    ]
    return after(min(fits, key=lambda fit: fit.cost).x)


def gaps_triplets():
    """Yield how far each law is from the outcome that Table 2 encodes."""
    names = list(cradle.ratio_table()["triplet"])
    masses, e, listed = of_triplets(names)
    columns = {"triplet": names}
    for name, model in LAWS.items():
        chains = [Chain(m, [1, 0, 0], r) for m, r in zip(masses, e, strict=True)]
        columns[name] = off(np.array([collide(c, model).velocities for c in chains]), listed)
    touching = [Chain(m, [1, 0, 0], 1) for m in masses]
    columns["implied"] = [
        effective_ratio(collide(chain, SpringChain(accuracy=1e-10))) for chain in touching
    ]
    every, m, r, listed_too = np.arange(len(names)), masses[:, None], e[:, None], listed[:, None]
    alike = [""] * len(names)
    after = post_impact_velocities(m, [1, 0, 0], r, ONE[:, None], excess="saturate")
    one = off(after, listed_too)
    columns["one_ratio"] = one[every, shared(one, alike)]
    shift = np.stack(np.broadcast_arrays(0.0, SHIFTS), -1)
    errors = off(strike(m, [1, 0, 0], r, shift), listed_too)
    last = ["".join(sorted(t[1:])) for t in names]
    for name, found in (("gap", np.where(SHIFTS >= 0, errors, 9.0)), ("shift", errors)):
        columns[f"one_{name}"] = found[every, shared(found, alike)]
        columns[f"{name}_of_pair"] = found[every, shared(found, last)]
        own = shared(found, names)
        columns[f"own_{name}"] = SHIFTS[own]
        columns[f"with_own_{name}"] = found[every, own]
    k = np.stack([np.minimum(1, 1 / QUOTIENTS), np.minimum(1, QUOTIENTS)], -1)
    errors = off(strike(m, [1, 0, 0], r, 0.0 * k, k, longest=150.0), listed_too)
    own = shared(errors, names)
    columns["own_quotient"], columns["with_own_quotient"] = QUOTIENTS[own], errors[every, own]
    columns["stiffness_of_pair"] = off(by_pair(names, masses, e, listed), listed)
    yield from zip(*([name, *map(written, one)] for name, one in columns.items()), strict=True)


def written(x):
    """Return a number to four decimals, or four digits."""
    if isinstance(x, str):
        return x
    return f"{round(x, 4) + 0.0:.4f}" if abs(x) < 100 else f"{x:g}"


if __name__ == "__main__":
    make(__doc__, gaps_five, gaps_triplets)
