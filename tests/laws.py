"""What the outcome of every law keeps, whatever the chain."""

import numpy as np
import pytest


def keeps(trace, energy=1e-13, momentum=1e-12, order=1e-14):
    """Momentum ball by ball, order, the ledger, and a path that says the same as the totals.

    `energy` is granted as a part of the energy of the relative motion, `momentum` of all masses at
    the largest speed; `order` as a speed.
    """
    chain, after = trace.chain, trace.velocities
    m, before = chain.masses, chain.velocities
    size = np.abs(before).max()
    off = momentum * size * m.sum() + 1e-15
    passed = np.diff(trace.path_impulses, axis=1, prepend=0, append=0)
    np.testing.assert_allclose(m * (trace.path - before), -passed, rtol=0, atol=off)
    assert not trace.path_impulses[0].any()
    assert (np.diff(after) >= -order).all()
    available = 0.5 * m @ (before - chain.momentum / m.sum()) ** 2
    lost = chain.kinetic_energy - 0.5 * m @ after**2
    granted = energy * available + 1e-15 * (1 + chain.kinetic_energy)
    assert trace.energy_loss == pytest.approx(lost, abs=granted)
    assert lost >= -granted
    assert trace.path[0].tolist() == before.tolist()
    assert trace.path[-1].tolist() == after.tolist()
    assert trace.path_impulses[-1].tolist() == trace.impulses.tolist()
    # Of an integrated path the impulses are as exact as its steps, a hundredth of the energies.
    pulled = off + 0.01 * energy * size * m.sum()
    assert (np.diff(trace.path_impulses, axis=0) >= -pulled).all()
    assert len(trace.path) == len(trace.path_impulses) == len(trace.events) + 1
    ends = [contact for kind, contact in trace.events if kind in ("end", "collapse")]
    assert np.bincount(ends, minlength=len(m) - 1).tolist() == [*trace.collisions]
    if not (chain.closing_speeds > 0).any():
        assert after.tolist() == before.tolist()
        assert not trace.events
