"""What the paper shows: the ends of Fig. 4, Figs. 5, 7 and 8, the ten chains of Figs. 10 to 12."""

import numpy as np
import pytest
from chains import FIG_8, changes
from truth import in_fifty_digits

from cradle import Chain, ImpulseCorrelation, collide, paper_chain
from cradle.tables import paper_sequences


@pytest.mark.parametrize(("ratio", "after"), [(0.0, [0, 0, 1]), (0.5, [-1 / 3, 2 / 3, 2 / 3])])
def test_figure_4_ends(ratio, after):
    """Han and Gilmore's two answers, Eqs. 5 and 6."""
    trace = collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(ratio))
    np.testing.assert_allclose(trace.velocities, after, rtol=0, atol=1e-15)


def test_figure_4_between_its_ends():
    """From one answer to the other the last ball slows down, the first one comes to rebound."""
    ratios = np.linspace(0, 0.5, 51)
    after = np.array(
        [collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(a)).velocities for a in ratios]
    )
    assert (np.diff(after[:, 0]) < 0).all()
    assert (np.diff(after[:, 2]) < 0).all()
    np.testing.assert_allclose((after**2).sum(axis=1), 1, rtol=1e-14)


def test_figure_5_sequence():
    """v = (1, .8, 0); the text gives neither e nor the ratio: a point of their region."""
    trace = collide(Chain([1, 1, 1], [1, 0.8, 0], 0.2), ImpulseCorrelation(0.1))
    expected = [("end", 0), ("close", 0), ("end", 1), ("close", 1), ("end", 0), ("end", 1)]
    assert changes(trace.events) == expected
    exact, _ = in_fifty_digits([1, 1, 1], [1, "0.8", 0], "0.2", "0.1")
    np.testing.assert_allclose(trace.velocities, exact, atol=1e-15)


def test_figure_7_digits():
    """Printed: (-0.003, 0.348, 0.999).  The middle ball hangs on the last digits of the input."""
    chain = Chain([1, 0.01, 1], [1, 0, 0], 1)
    after = collide(chain, ImpulseCorrelation(0.15)).velocities
    assert [f"{v:.3f}" for v in after] == ["-0.003", "0.347", "0.999"]
    nudged = collide(chain, ImpulseCorrelation(0.15006)).velocities
    assert [f"{v:.3f}" for v in nudged] == ["-0.003", "0.348", "0.999"]
    exact, _ = in_fifty_digits([1, 0.01, 1], [1, 0, 0], 1, 0.15)
    np.testing.assert_allclose(after, exact, rtol=0, atol=1e-13)


def test_figure_8_sequence():
    trace = collide(Chain([1] * 4, [1, 0.5, 0, 0], 1), ImpulseCorrelation(0.1))
    assert changes(trace.events) == FIG_8
    # The second closing of contact 1 joins two runs: at the meeting both balls have one velocity.
    row = [tuple(event) for event in trace.events].index(("close", 1)) + 1
    assert trace.path[row, 1] == pytest.approx(trace.path[row, 2], abs=1e-15)


def test_figure_8_meeting_rule():
    """The ends of the overlap and its midpoint (section 3.2) give three outcomes."""
    chain, found = Chain([1] * 4, [1, 0.5, 0, 0], 1), []
    for meeting in (0.0, 0.5, 1.0):
        found.append(collide(chain, ImpulseCorrelation(0.1, meeting=meeting)).velocities)
        exact, _ = in_fifty_digits([1] * 4, [1, 0.5, 0, 0], 1, 0.1, meeting=meeting)
        np.testing.assert_allclose(found[-1], exact, rtol=0, atol=1e-14)
    assert np.abs(found[0] - found[2]).max() > 0.01


@pytest.mark.parametrize("sequence", list(paper_sequences()))
@pytest.mark.parametrize("speed", [0.5, 1.0, 1.5, 2.0])
def test_figures_10_to_12(sequence, speed):
    """The ten chains at the four speeds, against the reference solver in fifty digits."""
    chain, model = paper_chain(sequence, speed, excess="saturate")
    trace = collide(chain, model)
    own = chain.masses, chain.velocities, chain.restitution
    after, exact = in_fifty_digits(*own, model.forward, model.backward, excess="saturate")
    assert changes(trace.events) == changes(exact.events)
    np.testing.assert_allclose(trace.velocities, after, rtol=0, atol=1e-13 * speed)
    assert set(trace.saturated) == exact.held
    assert trace.collisions.tolist() == exact.collisions
    assert not trace.collapsed
    # The model is homogeneous: the speed of the first ball is only a scale.
    unit = collide(*paper_chain(sequence, 1.0, excess="saturate"))
    np.testing.assert_allclose(trace.velocities, speed * unit.velocities, rtol=1e-14, atol=1e-16)
    assert trace.events == unit.events


def test_abcca_breaks_its_bound():
    """CCA = .462 stands above Eq. 34; with contact 3 held it acts like the bound itself."""
    with pytest.raises(ValueError, match=r"forward\[2\] = 0\.462; .*ball 3.*0\.459184") as caught:
        collide(*paper_chain("ABCCA"))
    assert "saturate" in str(caught.value)
    chain, model = paper_chain("ABCCA", excess="saturate")
    held = collide(chain, model)
    assert held.saturated == (3,)
    assert held.velocities[3] == held.velocities[4]
    bound = 45 / (53 + 45)
    below = ImpulseCorrelation((*model.forward[:2], bound * (1 - 1e-12)), model.backward)
    np.testing.assert_allclose(held.velocities, collide(chain, below).velocities, atol=2e-6)


def test_abccab_is_admissible_at_the_start_and_held_later():
    """The ball behind raises the bound of CCA (Eq. 53) until its contact has ended."""
    trace = collide(*paper_chain("ABCCAB"))
    assert 3 in trace.saturated
