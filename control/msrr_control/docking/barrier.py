"""The law ``cbf``: linear tracking with a barrier, the safety envelope, on the two line-of-sight angles."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pydantic import Field

from msrr_control.docking.edge_barrier import Arc, EdgeBarrier, Sighting
from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.kinematics.controlled_point import offset_point, position_error
from msrr_control.kinematics.elementwise import cos, hypot, join, limit, number, sin, split, where
from msrr_control.kinematics.motion_history import MotionHistory, coast, under_way
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class BarrierParams(Spec):
    """Parameters of :class:`BarrierLaw`.

    Attributes:
        k_n_per_s: Gain of the linear tracking.
        braking: Share of the drive's angular acceleration that stops an edge; the rest turns the unit along
            as it comes nearer.
        rho_rad: Angle over which the envelope rounds off.
        margin_deg: Angle by which the barrier lies inside the outer cone.
        guidance: Guidance trajectory.
    """

    k_n_per_s: Positive = 2.0
    braking: float = Field(default=0.6, gt=0.0, lt=1.0)
    rho_rad: Positive = 0.05
    margin_deg: NonNegative = math.degrees(0.05)
    guidance: GuidanceSpec = GuidanceSpec()


class BarrierState(NamedTuple):
    """State of the law.

    Attributes:
        guidance: Reference on the docking axis.
        motion: Motion since the line of sight was measured.
        sent: Commands (v, w) under way to the drive, the last one first, floats or of shape (...).
    """

    guidance: GuidanceState
    motion: MotionHistory
    sent: tuple[tuple[Any, Any], ...]


class BarrierLaw:
    """Tracks the guidance linearly, with speed and turn rate bounded so that the target stays in view.

    The bounds are those of :class:`~msrr_control.docking.edge_barrier.EdgeBarrier`, in closed form, at the
    time when the command reaches the drive: the line of sight is moved forward from its exposure by the
    measured twists since then, and through the latency of the link by the commands under way. Either motion
    is taken as one arc, which is right for tenths of a second. Tracking takes the pose as the estimator gives
    it. The law is not in the paper; it needs no force, no filter and no quadratic program.
    """

    def __init__(self, params: BarrierParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step.

        Raises:
            ParameterError: The margin leaves nothing of the cone.
        """
        self.params, self.setup = params, setup
        self._barrier = EdgeBarrier(setup, params.braking, params.rho_rad, math.radians(params.margin_deg))

    def start(self, inputs: LawInputs) -> BarrierState:
        """Return the state at the beginning of an approach."""
        twist = self._possible(inputs.twist)
        waiting = under_way(self.setup.link_latency_s, 1.0 / self.setup.rate_hz)
        guidance = guidance_start(offset_point(inputs.pose, self.setup.offset))
        return BarrierState(guidance, MotionHistory.starting(twist), (twist,) * waiting)

    def step(self, state: BarrierState, inputs: LawInputs, dt: float) -> tuple[Array, BarrierState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup, limits = self.params, self.setup, self.setup.limits
        visibility = number(inputs.visibility)
        x, y, yaw = split(inputs.pose)
        c, s = cos(yaw), sin(yaw)
        tip_x, tip_y = x + setup.offset * c, y + setup.offset * s
        tip = join(tip_x, tip_y)
        guidance = guidance_step(state.guidance, tip, visibility, params.guidance, setup.pin_reach, dt)
        velocity_x = -params.k_n_per_s * position_error(tip_x, number(guidance.x)) + number(guidance.speed)
        velocity_y = -params.k_n_per_s * position_error(tip_y, 0.0)
        ahead, across = c * velocity_x + s * velocity_y, c * velocity_y - s * velocity_x
        v = limit(ahead, -limits.v_close_mps, limits.v_close_mps)
        w = limit(across / setup.offset, -limits.w_max_radps, limits.w_max_radps)
        motion = state.motion.advanced(self._possible(inputs.twist), dt, inputs.age)
        v, w = self.kept_in_view((v, w), motion, state.sent, inputs)
        v = limit(v, -limits.v_close_mps, limits.v_close_mps)
        w = limit(w, -limits.w_max_radps, limits.w_max_radps)
        return join(v, w), BarrierState(guidance, motion, ((v, w), *state.sent)[: len(state.sent)])

    def kept_in_view(
        self,
        wanted: tuple[Any, Any],
        motion: MotionHistory,
        sent: tuple[tuple[Any, Any], ...],
        inputs: LawInputs,
    ) -> tuple[Any, Any]:
        """Return the command (v, w) nearest to the wanted one that keeps the target in view.

        A target that is lost sets no bounds: its last angles are no measurement.

        Args:
            wanted: (v, w) that is wanted, floats or of shape (...) [m/s, rad/s].
            motion: Motion since the line of sight was measured.
            sent: Commands (v, w) under way to the drive, the last one first.
            inputs: What the law is given.
        """
        v, w = wanted
        (v_then, w_then), edges = self._at_the_drive(motion, sent, inputs)
        v_in_view, w_in_view = self._barrier.limited(wanted, (v_then, w_then), edges)
        known = number(inputs.visibility) > 0.0
        return where(known, v_in_view, v), where(known, w_in_view, w)

    def _at_the_drive(
        self, motion: MotionHistory, sent: tuple[tuple[Any, Any], ...], inputs: LawInputs
    ) -> tuple[tuple[Any, Any], tuple[Sighting, Sighting]]:
        """Return twist and sightings of both edges at the time when a command of now reaches the drive."""
        setup = self.setup
        length, turn = motion.since(inputs.age)
        twist, further, beyond = coast(
            motion.twist, sent, setup.link_latency_s, setup.limits, 1.0 / setup.rate_hz
        )
        x, y, yaw = split(inputs.pose)
        camera_x, camera_y = x + setup.camera_offset * cos(yaw), y + setup.camera_offset * sin(yaw)
        left, right = split(inputs.edges)
        ahead, half_width = setup.los.setback_m - camera_x, setup.los.half_width_m
        seen_left = Sighting(left, hypot(ahead, half_width - camera_y))
        seen_right = Sighting(right, hypot(ahead, -half_width - camera_y))
        arc, l_c = Arc.of(length + further, turn + beyond), setup.camera_offset
        return twist, (seen_left.after(arc, l_c), seen_right.after(arc, l_c))

    def _possible(self, twist: Array) -> tuple[Any, Any]:
        """Return a measured (v, w) within what the drive can do: more is an error of the measurement."""
        limits, (v, w) = self.setup.limits, split(twist)
        return (
            limit(v, -limits.v_max_mps, limits.v_max_mps),
            limit(w, -limits.w_max_radps, limits.w_max_radps),
        )

    def reference(self, state: BarrierState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return state.guidance.point
