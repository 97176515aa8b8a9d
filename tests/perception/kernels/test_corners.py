"""The covariances of measured corners, against the errors of edges from which they follow."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.kernels.calibrated import BORDER, PARAMETERS, project_tag
from msrr_perception.kernels.corners import MeasuredCorners, roots_of_covariance
from msrr_perception.kernels.edges import BY_OFFSET
from msrr_perception.kernels.rates import Rates
from msrr_perception.kernels.section_errors import CornerVariances
from msrr_perception.pose.corner_errors import corners_by_sections
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.scene import Scene
from tests.perception.conftest import see


@pytest.mark.parametrize(("speed", "repeated"), [(0.0, 250.0), (1e-3, None), (1.0, 1.0)])
def test_what_stays_the_same_counts_by_the_number_of_exposures_that_it_lasts(
    scene: Scene, speed: float, repeated: float | None
) -> None:
    """Errors by the place between pixels last for half a pixel of motion, and at most 250 exposures.

    What lies beyond the borders is in the state for the tags of the port. For others it is a share of the
    variance that lasts 60 exposures, and so do the errors of their mounts for as long as the layout says.
    """
    built = Scene.model_validate({**scene.model_dump(exclude={"as_built"}), "as_built": "careful"})
    target = TargetModel.from_scene(built.told(), built.docks[0])
    layout, period = target.filter_layout, target.frame_period_s
    state = np.zeros(layout.size)
    state[:5] = pose_vector(SE2(-0.5, 0.05, 0.1))
    velocity = speed * np.array([[9.0, 9.0, 9.0], [0.1, 0.05, 0.3], [9.0, 9.0, 9.0]])  # that of the middle
    rates, rng = Rates(-0.01, 0.01, np.zeros((3, 3)), velocity), np.random.default_rng(2)
    tags = see(state[:5], target.tags)
    which = np.array([layout.index[tag.tag_id] for tag in tags])
    corners, count = np.array([tag.corners.reshape(8) for tag in tags]), len(tags)
    noise, place, changing, border = rng.uniform(0.01, 0.04, (4, count)) ** 2
    rest = rng.uniform(0.01, 0.04, (count, 4)) ** 2
    roots = roots_of_covariance(
        target.optics,
        layout.tags,
        MeasuredCorners(which, corners, np.zeros((count, 4)), np.zeros((count, 4))),
        rates,
        state,
        CornerVariances(noise, place, changing, np.sqrt(border), rest),
        period,
    )
    still, J = Rates(0.0, 1.0, np.zeros((1, 3)), np.zeros((1, 3))), np.empty((8, PARAMETERS))
    elsewhere = 0
    for t, tag in enumerate(which.tolist()):
        project_tag(target.optics, layout.tags, tag, 0.0, still, np.zeros(4), state, np.empty(8), J)
        moved = np.abs(J[:, :3] @ velocity[1]).max() * period
        lasts = float(np.clip(0.5 / max(moved, 1e-9), 1.0, 250.0))
        assert repeated is None or lasts == repeated
        in_state = layout.tags.columns[tag, BORDER] >= 0
        elsewhere += not in_state
        section, whole = (
            noise[t] + lasts * place[t],
            lasts * changing[t] + (0.0 if in_state else 60.0 * border[t]),
        )
        of_edges = np.tile([section + whole / BY_OFFSET**2, section + whole], 4)  # offset and slope of each
        M = corners_by_sections(corners[t].reshape(4, 2))
        S = M @ np.diag(of_edges) @ M.T + np.diag(np.repeat(rest[t], 2))
        S += J @ np.diag(layout.tags.considered[tag]) @ J.T
        np.testing.assert_allclose(roots[t] @ roots[t].T, S, rtol=1e-9, atol=1e-12)
        assert layout.tags.considered[tag].any() != in_state
    assert 0 < elsewhere < count
