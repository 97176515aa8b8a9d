"""Specifications of deliberate faults, so that every outcome can be provoked."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from msrr_scenes.specs.spec import Angle, FileName, Name, Spec, Time


class SeatSwitchStuck(Spec):
    """The seat switches at a unit's port report one value whatever the pins do."""

    kind: Literal["seat_switch_stuck"]
    """Kind of fault."""
    unit: Name
    """Docked unit that carries the switches."""
    value: Literal["open", "closed"]
    """Value that both switches report."""


class MarkerHidden(Spec):
    """A unit's tags are covered: they exist in the scene but show a blank plate."""

    kind: Literal["marker_hidden"]
    """Kind of fault."""
    unit: Name
    """Unit whose tags are covered."""


class PortPlugged(Spec):
    """An object plugs a port's holes in some attempts of every docking step at this port."""

    kind: Literal["port_plugged"]
    """Kind of fault."""
    unit: Name
    """Unit whose port is plugged."""
    port: Name
    """Port that is plugged."""
    attempts: tuple[Annotated[int, Field(ge=1, le=20)], ...] = Field(default=(1,), max_length=20)
    """Attempts during which the port is plugged, counted from 1."""


class LockJammed(Spec):
    """The lock of a unit does not open any more once it is closed, and reports what it is."""

    kind: Literal["lock_jammed"]
    """Kind of fault."""
    unit: Name
    """Unit whose lock jams."""


class CameraBlackout(Spec):
    """A camera delivers no frame between two times."""

    kind: Literal["camera_blackout"]
    """Kind of fault."""
    camera: FileName
    """Camera that fails: ``overhead`` or ``<unit>/onboard``."""
    from_s: Time
    """Time of the first lost frame [s]."""
    to_s: Time
    """Time from which frames are delivered again [s]."""


class CameraMisaligned(Spec):
    """The onboard camera is mounted askew by an angle that its calibration does not know."""

    kind: Literal["camera_misaligned"]
    """Kind of fault."""
    unit: Name
    """Unit that carries the camera."""
    yaw_deg: Angle
    """Angle by which the camera is turned, counter-clockwise positive [deg]."""


class EncoderStuck(Spec):
    """The encoder of a wheel tells the same angle from a time on, whatever the wheel does."""

    kind: Literal["encoder_stuck"]
    """Kind of fault."""
    unit: Name
    """Unit whose encoder fails."""
    wheel: Literal["left", "right"]
    """Wheel whose angle is not told any more."""
    from_s: Time = 0.0
    """Time from which on the angle is the same [s]."""


class UnitSeized(Spec):
    """The drive of a unit does nothing from a time on, and its wheels are held. The unit is not told."""

    kind: Literal["unit_seized"]
    """Kind of fault."""
    unit: Name
    """Unit whose drive fails."""
    from_s: Time = 0.0
    """Time from which on its wheels are held [s]."""


Fault = Annotated[
    SeatSwitchStuck
    | MarkerHidden
    | PortPlugged
    | LockJammed
    | CameraBlackout
    | CameraMisaligned
    | EncoderStuck
    | UnitSeized,
    Field(discriminator="kind"),
]
