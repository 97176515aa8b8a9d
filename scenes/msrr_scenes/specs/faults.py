"""Specifications of things that go wrong on purpose, so that every outcome can be provoked."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from msrr_scenes.specs.spec import Finite, Name, Spec


class SeatSwitchStuck(Spec):
    """The seat switches at a unit's port report ``value`` whatever the pins do."""

    kind: Literal["seat_switch_stuck"]
    unit: Name
    value: Literal["open", "closed"]


class MarkerHidden(Spec):
    """A unit's tags are covered: they exist in the scene but show a blank plate."""

    kind: Literal["marker_hidden"]
    unit: Name


class PortPlugged(Spec):
    """Something sits in a port's holes; it falls out when the robot retreats from the last attempt named."""

    kind: Literal["port_plugged"]
    unit: Name
    port: Name
    attempts: tuple[int, ...] = (1,)


class CameraBlackout(Spec):
    """A camera delivers no frame between two times."""

    kind: Literal["camera_blackout"]
    camera: str
    from_s: float = Field(ge=0.0)
    to_s: float = Field(gt=0.0)


class CameraMisaligned(Spec):
    """The onboard camera is mounted askew by an angle that its calibration does not know."""

    kind: Literal["camera_misaligned"]
    unit: Name
    yaw_deg: Finite


Fault = Annotated[
    SeatSwitchStuck | MarkerHidden | PortPlugged | CameraBlackout | CameraMisaligned,
    Field(discriminator="kind"),
]
