"""Random streams depend on the seed and their name, and on nothing else."""

import numpy as np

from msrr_scenes.random_streams import stream, stream_key


def test_a_stream_is_keyed_by_seed_and_name() -> None:
    draws = stream(3, "unit/a/odometry").normal(size=4)
    np.testing.assert_array_equal(stream(3, "unit/a/odometry").normal(size=4), draws)
    for seed, name in ((4, "unit/a/odometry"), (3, "unit/b/odometry")):
        assert not np.array_equal(stream(seed, name).normal(size=4), draws)


def test_keys_stay_as_they_are() -> None:
    """A changed key would change every logged trial."""
    assert stream_key(3, "start/a") == 0xB7FDEF64E1939464FDDAB396113E2F82
