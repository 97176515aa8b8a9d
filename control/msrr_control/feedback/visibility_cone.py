"""The line-of-sight correction, which keeps the docking target inside the visibility cone of the camera."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import Field

from msrr_control.kinematics.controlled_point import rotate
from msrr_control.kinematics.elementwise import tanh_tan
from msrr_scenes.arrays import Array
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.spec import Gain, Length, NonNegative, Spec


class ConeGains(Spec):
    """Gains of the cone correction.

    Attributes:
        reach_m: k_cone, the shift of the reference for a force of 1 across the camera's axis. One edge at the
            outer bound a shifts it by sin(a) of this to the side, and by x_share cos(a) of it backwards.
        k1_per_s: Bandwidth of the first filter (the slower one, whose output shifts the reference).
        k2_per_s: Bandwidth of the second filter (whose input is the force).
        x_share: Share of the force that acts backwards along the unit's axis.
    """

    reach_m: Length = 0.04
    k1_per_s: Gain = 3.0
    k2_per_s: Gain = 9.0
    x_share: NonNegative = Field(default=0.1, le=1.0)


class ConeState(NamedTuple):
    """Filter states of both axes in D, shape (..., 2): ``shift`` lambda_1 [m], ``drive`` lambda_2 [m/s]."""

    shift: Array
    drive: Array


def edge_angles(pose: Array, los: LosSpec, camera_offset: float) -> Array:
    r"""Return the angles at which an ideal camera sees the edges of the target.

    .. math:: a_{l,r} = \mathrm{atan2}(\pm b - y_c, s_b - x_c) - \theta

    Studies and predictions use it; the running system measures these angles in the image.

    Source: Zheng et al., eq. 21; the target is set back by s_b (on the face itself the shipped one would be
    seen at 24 deg at contact, outside the inner bound, and the unit would stop short of the port).

    Args:
        pose: Axle pose (x, y, yaw) in D, shape (..., 3).
        los: Half-width b and setback s_b of the target.
        camera_offset: l_c, distance of the camera ahead of the axle [m].

    Returns:
        (left, right) from the camera's axis, counter-clockwise positive, shape (..., 2) [rad], in (-pi, pi].
    """
    x, y, yaw = pose[..., 0], pose[..., 1], pose[..., 2]
    ahead = los.setback_m - x - camera_offset * np.cos(yaw)
    y_camera = y + camera_offset * np.sin(yaw)
    angles = np.empty((*pose.shape[:-1], 2))
    for i, b in enumerate((los.half_width_m, -los.half_width_m)):
        angle = np.arctan2(b - y_camera, ahead) - yaw
        angles[..., i] = np.arctan2(np.sin(angle), np.cos(angle))
    return angles


def edge_force(angle: Array, inner: float, outer: float) -> Array:
    r"""Return the force of one edge: 0 up to the inner bound, rising to 1 at the outer one.

    .. math:: F = \tanh\tan\left(\tfrac{\pi}{2}\,
        \mathrm{clip}\left(\frac{|a| - \theta_{in}}{\theta_{out} - \theta_{in}}, 0, 1 - 10^{-6}\right)\right)

    Source: Zheng et al., eq. 22; printed with the bounds reversed and mixed. F is never negative: the side
    comes from the sine in eq. 23 alone (signing both cancels the correction).

    Args:
        angle: Edge angle a, any shape [rad].
        inner: th_in [rad].
        outer: th_out > th_in [rad].

    Returns:
        F in [0, 1], same shape.
    """
    return tanh_tan((np.abs(angle) - inner) / (outer - inner))


def cone_force(edges: Array, yaw: Array, los: LosSpec, x_share: float) -> Array:
    r"""Return the correction of both edges, in the dock frame.

    In the unit's body frame :math:`\Delta_x = -s_x \sum F\cos a,\ \Delta_y = \sum F\sin a`: the unit waits,
    and turns its controlled point towards the edge that is about to leave the view.

    Source: Zheng et al., eq. 23, in the body frame; the sign of x corrected (with +x the unit advances when
    it should wait).

    Args:
        edges: Angles (left, right), shape (..., 2) [rad].
        yaw: Heading in D, shape (...) [rad].
        los: Bounds th_in and th_out of the cone.
        x_share: s_x, share of the force along x.

    Returns:
        Delta in D, shape (..., 2), dimensionless.
    """
    force = edge_force(edges, los.inner, los.outer)
    body = np.empty(edges.shape)
    body[..., 0] = -x_share * np.add.reduce(force * np.cos(edges), axis=-1)
    body[..., 1] = np.add.reduce(force * np.sin(edges), axis=-1)
    return rotate(body, yaw)


def cone_step(state: ConeState, force: Array, gains: ConeGains, dt: float) -> tuple[ConeState, Array]:
    r"""Pass the correction through two first-order filters per axis.

    .. math:: \dot\lambda_2 = -k_2\lambda_2 + k_{cone} k_1 k_2 \Delta,\quad
        \dot\lambda_1 = -k_1\lambda_1 + \lambda_2

    The force is scaled so that :math:`\lambda_1` settles at :math:`k_{cone}\Delta`, in metres. The step is a
    backward Euler step, stable for any ``dt``.

    Source: Zheng et al., eq. 24.

    Args:
        state: Filter states.
        force: Delta in D, shape (..., 2).
        gains: k_cone, k1, k2.
        dt: Step [s].

    Returns:
        The new states and the rate of the shift (the feed-forward), shape (..., 2) [m/s].
    """
    k1, k2 = gains.k1_per_s, gains.k2_per_s
    drive = (state.drive + (dt * gains.reach_m * k1 * k2) * force) / (1.0 + dt * k2)
    shift = (state.shift + dt * drive) / (1.0 + dt * k1)
    return ConeState(shift, drive), drive - k1 * shift
