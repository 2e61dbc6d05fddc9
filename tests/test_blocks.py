"""Blocks of a batch under dask: the same bits, and errors that name the index in the whole."""

import pickle

import dask.array as da
import numpy as np
import pytest

from cradle import ImpactNotFinished, post_impact_velocities
from cradle.models.blocks import post_impact_block


def batch():
    """Chains on two axes: 20 sets of masses, 6 of restitution."""
    masses = 1.0 + np.arange(60.0).reshape(20, 1, 3) / 64
    return {
        "masses": masses,
        "velocities": np.array([1.0, 0.0, 0.0]),
        "restitution": np.linspace(0.5, 1, 12).reshape(6, 2),
        "forward": np.array([0.1]),
        "backward": np.full((20, 1, 1), 0.2),
    }


def lazy(given, **options):
    """Cut what has leading axes into blocks, and solve by map_blocks."""
    chunks = {"masses": (8, 1, 3), "restitution": (4, 2), "backward": (8, 1, 1)}
    arrays = [
        da.from_array(values, chunks=chunks[name]) if name in chunks else values
        for name, values in given.items()
    ]
    return da.map_blocks(post_impact_block, *arrays, dtype=float, **options)


def test_the_bits_of_one_call():
    whole = post_impact_velocities(*batch().values())
    assert whole.shape == (20, 6, 3)
    cut = lazy(batch())
    assert cut.numblocks == (3, 2, 1)
    assert cut.compute(scheduler="synchronous").tobytes() == whole.tobytes()


@pytest.mark.parametrize(
    ("name", "at", "value", "message"),
    [
        ("masses", (17, 0, 2), -1.0, r"^masses\[17, 0, 2\] = -1.0; must be above 0$"),
        ("restitution", (5, 1), 1.5, r"^restitution\[5, 1\] = 1.5; must lie in \[0, 1\]$"),
        ("velocities", (1,), np.nan, r"^velocities\[1\] = nan; must be finite$"),
        ("backward", (9, 0, 0), 2.0, r"^backward\[9, 0, 0\] = 2.0; must lie in \[0, 1\]$"),
    ],
)
def test_errors_name_the_index_in_the_whole(name, at, value, message):
    given = batch()
    given[name][at] = value
    with pytest.raises(ValueError, match=message):
        lazy(given).compute(scheduler="synchronous")
    # As in one call.
    with pytest.raises(ValueError, match=message):
        post_impact_velocities(*given.values())


def test_an_index_of_what_is_broadcast_is_that_of_the_outcome():
    """A velocity, one row for all, is too large beside one of the masses.

    Which of the two blocks of these masses comes first is dask's affair.
    """
    given = batch()
    given["masses"][17] *= 1e300
    given["velocities"][0] = 1e10
    with pytest.raises(ValueError, match=r"^velocities\[17, [04], 0\] = 10000000000.0; kinetic"):
        lazy(given).compute(scheduler="synchronous")


def test_other_errors_say_which_block():
    given = batch()
    with pytest.raises(ImpactNotFinished) as stopped:
        lazy(given, max_events=1).compute(scheduler="synchronous")
    (note,) = stopped.value.__notes__
    begins = [f"({row}, {column})" for row in (0, 8, 16) for column in (0, 4)]
    assert note in [f"in the block that begins at {begin}" for begin in begins]


def test_a_refusal_survives_another_process():
    with pytest.raises(ValueError, match="must be above 0") as error:
        post_impact_velocities([1, -1, 1], [1, 0, 0], 1, 0.1)
    again = pickle.loads(pickle.dumps(error.value))
    assert (str(again), again.index) == ("masses[1] = -1.0; must be above 0", (1,))
