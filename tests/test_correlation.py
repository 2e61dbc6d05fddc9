"""The paper's model behind its public names: input, record, batch, and how an impact gives up."""

import numpy as np
import pytest
from chains import magnitudes, random_chains, uniform, with_ends, within_bounds

from cradle import (
    Chain,
    ImpactNotCertified,
    ImpactNotFinished,
    ImpulseCorrelation,
    collide,
    outcomes,
    post_impact_velocities,
)


@pytest.mark.parametrize("name", ["forward", "backward"])
@pytest.mark.parametrize("length", [1, 3])
def test_wrong_number_of_ratios(name, length):
    options = {"forward": 0.1, name: [0.1] * length}
    with pytest.raises(ValueError, match=f"^{name} has {length} values; 4 balls need 2"):
        collide(Chain([1] * 4, [1, 0, 0, 0], 1), ImpulseCorrelation(**options))
    with pytest.raises(ValueError, match=rf"^{name} has shape \({length},\); must be .* 4 balls"):
        post_impact_velocities([1] * 4, [1, 0, 0, 0], 1, **options)


def test_two_balls_take_one_number_or_none():
    for ratio in (0.3, []):
        after = collide(Chain([1, 3], [1, 0], 0.5), ImpulseCorrelation(ratio)).velocities
        np.testing.assert_allclose(after, [0.25 - 0.375, 0.25 + 0.125], atol=1e-16)
        np.testing.assert_array_equal(post_impact_velocities([1, 3], [1, 0], 0.5, ratio), after)
    with pytest.raises(ValueError, match="forward has 1 values; 2 balls need 0"):
        collide(Chain([1, 3], [1, 0], 0.5), ImpulseCorrelation([0.3]))


BEYOND = [
    (0.51, 0.1, r"forward\[1\] = 0\.51; at ball 2.* not exceed 0\.5 \(Eq\. 53\)"),
    ([0.6, 0.2], 0.1, r"forward\[0\] = 0\.6; at ball 1.* not exceed 0\.555556 \(Eq\. 53\)"),
    (0.1, 0.51, r"backward\[0\] = 0\.51; at ball 1.* not exceed 0\.5 \(Eq\. 53, mirrored\)"),
    (0.1, [0.2, 0.6], r"backward\[1\] = 0\.6; at ball 2.* not exceed 0\.555556 \(Eq\. 53, mirr"),
]


@pytest.mark.parametrize(("forward", "backward", "message"), BEYOND)
def test_ratios_beyond_their_bound(forward, backward, message):
    chain, model = Chain([1] * 4, [1, 0, 0, 0], 1), ImpulseCorrelation(forward, backward)
    with pytest.raises(ValueError, match="^" + message) as caught:
        collide(chain, model)
    assert "excess='saturate'" in str(caught.value)
    with pytest.raises(ValueError, match=message.replace(r"\[", r"\[(0, )?")):
        post_impact_velocities(np.ones((1, 4)), [1, 0, 0, 0], 1, forward, backward)
    collide(chain, ImpulseCorrelation(forward, backward, excess="saturate"))


def test_the_short_cut_decides_as_the_loop_does():
    """Two and three balls on both sides of Eq. 44: the same collisions, velocities to 1e-15."""
    rng = np.random.default_rng(44)
    taken = 0

    def strike(count, n):
        return np.tile(np.eye(n)[0], (count, 1))

    for n in (2, 3):
        m, v, e, f, b = random_chains(rng, 1500, n, decades=3, speed=strike)
        result = outcomes(m, v, e, f, b)
        for k in range(len(m)):
            trace = collide(Chain(m[k], v[k], e[k]), ImpulseCorrelation(f[k], b[k]))
            assert result.collisions[k].tolist() == trace.collisions.tolist()
            error = np.abs(result.velocities[k] - trace.velocities).max()
            assert error <= 2e-15  # of the striker's speed
            taken += (trace.collisions == 1).all()
    assert 1500 < taken < 2900


def test_no_row_of_a_batch_is_left_out_in_silence(monkeypatch):
    """Should the impact that stopped a batch not stop alone, those after it are not solved."""
    monkeypatch.setattr(ImpulseCorrelation, "solve", lambda *_: None)
    with pytest.raises(ImpactNotCertified, match="among others it stops, alone it does not"):
        post_impact_velocities([[1, 1, 1, 1]] * 3, [1, 0, 0, 0], 1, 0.1, max_events=1)


def test_a_row_that_is_not_finished_is_named():
    """By its place in the batch; there is none to name where it is alone."""
    speeds = np.zeros((2, 3, 3))
    speeds[1, 1:, 0] = 1.0
    with pytest.raises(ImpactNotFinished) as stopped:
        post_impact_velocities([1, 1, 1], speeds, 0.9, 0.1, max_events=1)
    assert stopped.value.__notes__ == ["in the batch it is chain [1, 1]"]
    with pytest.raises(ImpactNotFinished) as stopped:
        post_impact_velocities([1, 1, 1], [1, 0, 0], 0.9, 0.1, max_events=1)
    assert not hasattr(stopped.value, "__notes__")


def test_batch_is_a_loop_of_single_impacts():
    """Every argument with its own leading axes: one broadcast against the others, bit by bit."""
    rng = np.random.default_rng(5)
    n = 4
    m = magnitudes(rng, 2, (3, 1, 1, n))
    v = uniform(rng, -1, 1, (2, 1, n))
    e = with_ends(rng)((2, 1, 1, n - 1))[0]
    f, b = 0.2 * rng.random((4, n - 2)), 0.2 * rng.random((3, 1, 2, 1, n - 2))[:, 0]
    f, b = np.minimum(f, 0.05), np.minimum(b, 0.05)
    batch = post_impact_velocities(m, v, e, f, b, excess="saturate", meeting=0.3)
    margins = outcomes(m, v, e, f, b, excess="saturate", meeting=0.3).margin
    lead = np.broadcast_shapes(*(part.shape[:-1] for part in (m, v, e, f, b)))
    assert batch.shape == (*lead, n)
    assert margins.shape == lead
    assert len(np.unique(margins)) > 5
    full = [np.broadcast_to(part, lead + part.shape[-1:]) for part in (m, v, e, f, b)]
    for at in np.ndindex(*lead):
        chain = Chain(*(part[at] for part in full[:3]))
        model = ImpulseCorrelation(full[3][at], full[4][at], excess="saturate", meeting=0.3)
        trace = collide(chain, model)
        assert batch[at].tobytes() == trace.velocities.tobytes()
        assert margins[at] == trace.margin


def test_scalars_and_the_missing_backward_ratio():
    full = post_impact_velocities([1, 2, 1], [1, 0, 0], [0.5, 0.5], [0.1], [0.1])
    assert full.tobytes() == post_impact_velocities([1, 2, 1], [1, 0, 0], 0.5, 0.1).tobytes()
    light = [[1, 0.1, 1], [1, 0, 0], 0.5, 0.1]
    assert post_impact_velocities(*light, 0.1).tobytes() == post_impact_velocities(*light).tobytes()
    assert post_impact_velocities(*light, 0.3).tobytes() != post_impact_velocities(*light).tobytes()


def test_small_batches():
    assert post_impact_velocities(np.ones((0, 3)), [1, 0, 0], 1, 0.1).shape == (0, 3)
    whole = np.array([1, 1], np.int8)
    assert post_impact_velocities(whole, [1, 0], 1, 0).tolist() == [0.0, 1.0]


def test_inputs_are_left_alone():
    given = [np.array(x) for x in ([1.0, 0.01, 1.0], [1.0, 0.0, 0.0], [0.5, 0.5], [0.15])]
    before = [part.tolist() for part in given]
    post_impact_velocities(*given)
    assert [part.tolist() for part in given] == before


def test_impact_not_finished():
    chain = Chain([1, 1e-6, 1], [1, 0, 0], 1)
    with pytest.raises(ImpactNotFinished, match="max_events = 50") as caught:
        collide(chain, ImpulseCorrelation(0.0, max_events=50))
    trace = caught.value.trace
    assert isinstance(caught.value, RuntimeError)
    assert trace.chain is chain
    assert 50 <= len(trace.events) <= 200
    assert trace.velocities @ chain.masses == pytest.approx(1, rel=1e-15)
    assert trace.velocities[1] != 0
    # It went the way of the whole impact, and stands at its last event or a little beyond.
    whole = collide(chain, ImpulseCorrelation(0.0))
    k = len(trace.events)
    assert whole.events[:k] == trace.events
    assert whole.path[: k + 1].tobytes() == trace.path.tobytes()
    assert (trace.path_impulses[-1] <= trace.impulses).all()
    assert (trace.impulses <= whole.path_impulses[k + 2]).all()


def test_enough_events_are_enough():
    """The limit refuses what needs more, and nothing else."""
    chain = Chain([1, 0.01, 1], [1, 0, 0], 1)
    expected = collide(chain, ImpulseCorrelation(0.15)).velocities
    limits = []
    for limit in range(1, 200):
        try:
            after = collide(chain, ImpulseCorrelation(0.15, max_events=limit)).velocities
        except ImpactNotFinished:
            limits.append(limit)
        else:
            assert after.tobytes() == expected.tobytes()
    assert limits == list(range(1, len(limits) + 1))
    assert 10 < len(limits) < 100


def test_batch_and_single_draw_the_line_of_excess_alike():
    """A few roundings around Eq. 53: refused by both, in the same words, or by neither."""
    rng = np.random.default_rng(53)
    refused = 0
    for _ in range(300):
        n = int(rng.integers(3, 6))
        m = magnitudes(rng, 4, n)
        bounds = within_bounds(m, np.ones)
        ratios = [part * (1 + rng.integers(0, 12) * 2.0**-53) for part in bounds]
        f, b = np.minimum(ratios, 1.0)
        chain = Chain(m, np.eye(n)[0], 0.5)
        try:
            expected = repr(collide(chain, ImpulseCorrelation(f, b)).velocities)
        except ValueError as error:
            expected = str(error)
            refused += 1
        try:
            found = repr(post_impact_velocities(m, np.eye(n)[0], 0.5, [f], b)[0])
        except ValueError as error:
            found = str(error).replace("[0, ", "[")
        assert found.partition(" = ")[0] == expected.partition(" = ")[0]
    assert 100 < refused < 250
