"""The pose in the dock frame D of a state whose pose is that against the marker of the port."""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.dock_frame import pose_by_marker
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.calibration import StateLayout
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2

#: Standard deviations of gap [m] and yaw [rad] of a seated unit: the lock pulls the faces together, and it
#: may close before both pins rest at the bottom, which leaves the unit turned by up to half a degree.
_GAP_SIGMA, _YAW_SIGMA = 0.0001, math.radians(0.2)

#: Standard deviation of its lateral pose in plays of the pins, between whose ends it may be anywhere.
_PLAY_SHARE = 0.6


def pose_in_D(layout: StateLayout, state: FilterState) -> tuple[SE2, Array]:
    """Return the pose in D of a state and its derivatives by the state, shape (3, n).

    The marker turns about its reference tag, and the pose with it.
    """
    pose, shares = pose_by_marker(
        state.mean, -1 if layout.marker is None else layout.marker, layout.tags.pivot
    )
    J = np.zeros((3, len(state.mean)))
    J[:, :3] = shares[:, :3]
    if layout.marker is not None:
        J[:, layout.marker :] = shares[:, 3:]
    return SE2(*pose.tolist()), J


def in_seat(target: TargetModel, state: FilterState) -> FilterState:
    """Return a state corrected by the pose of a unit in its seat in the port of the target."""
    assert target.mechanism is not None, "a unit in a seat has pins"
    sigmas = np.array([_GAP_SIGMA, _PLAY_SHARE * target.mechanism.play, _YAW_SIGMA])
    X, H = pose_in_D(target.filter_layout, state)
    off = np.array([-target.front, 0.0, 0.0]) - X.as_array()
    S = H @ state.covariance @ H.T + np.diag(sigmas**2)
    gain = np.linalg.solve(S, H @ state.covariance).T
    left = np.eye(len(state.mean)) - gain @ H
    covariance = left @ state.covariance @ left.T + (gain * sigmas**2) @ gain.T
    return state._replace(mean=state.mean + gain @ off, covariance=covariance)
