"""A batch of trials is that many trials: what one of them meets is nothing to the others."""

import numpy as np

from msrr_control.path_following.path import Desired
from msrr_control.path_following.reference import (
    ReferenceGains,
    ReferenceState,
    SideWall,
    reference_step,
)


def test_a_wall_before_one_trial_is_nothing_to_the_others() -> None:
    """50 trials in one call and one by one; limits bite in most of them."""
    rng = np.random.default_rng(3)
    n = 50
    angle = rng.uniform(-np.pi, np.pi, n)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    foot = rng.normal(size=(n, 2))
    state = ReferenceState(
        foot + rng.uniform(0.05, 0.5, (n, 1)) * normal,
        0.2 * rng.normal(size=(n, 2)),
        0.1 * rng.normal(size=(n, 2)),
    )
    desired = Desired(
        state.position + 0.3 * rng.normal(size=(n, 2)), 0.2 * rng.normal(size=(n, 2)), rng.normal(size=(n, 2))
    )
    active = rng.random(n) < 0.5
    gains = ReferenceGains()
    together = reference_step(state, desired, SideWall(active, foot, angle), gains, 0.02)
    for i in range(n):
        alone = reference_step(
            ReferenceState(*(a[i] for a in state)),
            Desired(*(a[i] for a in desired)),
            SideWall(active[i], foot[i], angle[i]),
            gains,
            0.02,
        )
        for one, all_ in zip(alone, together, strict=True):
            np.testing.assert_allclose(one, all_[i], rtol=0.0, atol=1e-12)
