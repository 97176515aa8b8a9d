"""Specifications of deviations: how far a true value may be from the drawing, in its unit and its bounds."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import model_validator

from msrr_scenes.specs.spec import Spec, between


class Deviation(Spec):
    """How far a true value may be from the drawing, and, if it is given, how far it is.

    A scene file may write the true error alone: ``yaw_deg: 2`` for ``yaw_deg: {error: 2}``.
    """

    one_sided: ClassVar[bool] = False  # whether the true error is the magnitude of what is drawn

    sigma: Annotated[float, between(0.0, 1e3)] = 0.0
    """Standard deviation, which a robot may know as a tolerance."""
    error: Annotated[float, between(-1e3, 1e3)] | None = None
    """True error, which no robot knows; without it, it is drawn once per trial."""

    @model_validator(mode="before")
    @classmethod
    def _from_number(cls, data: Any) -> Any:
        return {"error": data} if is_number(data) else data


def is_number(data: Any) -> bool:
    """Return whether a value of a scene file is a number, which is the short form of a deviation."""
    return isinstance(data, (int, float)) and not isinstance(data, bool)


class LengthDeviation(Deviation):
    """Deviation of a position [m]; five centimetres is beyond every plate and every mast of the unit."""

    sigma: Annotated[float, between(0.0, 0.01)] = 0.0
    """Standard deviation [m], which a robot may know as a tolerance."""
    error: Annotated[float, between(-0.05, 0.05)] | None = None
    """True error [m], which no robot knows; without it, it is drawn once per trial."""


class HeightDeviation(Deviation):
    """Height of what should not be there [m]; beyond a centimetre no wheel of the unit climbs it."""

    one_sided = True

    sigma: Annotated[float, between(0.0, 0.005)] = 0.0
    """Standard deviation [m]; the height is the magnitude of what is drawn."""
    error: Annotated[float, between(0.0, 0.01)] | None = None
    """True height [m], which no robot knows; without it, it is drawn once per trial."""


class AngleDeviation(Deviation):
    """Deviation of an angle [deg]."""

    sigma: Annotated[float, between(0.0, 10.0)] = 0.0
    """Standard deviation [deg], which a robot may know as a tolerance."""
    error: Annotated[float, between(-45.0, 45.0)] | None = None
    """True error [deg], which no robot knows; without it, it is drawn once per trial."""


class PlayDeviation(Deviation):
    """Play of a gear [deg]."""

    one_sided = True

    sigma: Annotated[float, between(0.0, 30.0)] = 0.0
    """Standard deviation [deg]; the play is the magnitude of what is drawn."""
    error: Annotated[float, between(0.0, 90.0)] | None = None
    """True play [deg], which no robot knows; without it, it is drawn once per trial."""


class RatioDeviation(Deviation):
    """Relative deviation of a length, a mass or a focal length [%]; half or one and a half of it at most."""

    sigma: Annotated[float, between(0.0, 10.0)] = 0.0
    """Standard deviation [%], which a robot may know as a tolerance."""
    error: Annotated[float, between(-50.0, 50.0)] | None = None
    """True error [%], which no robot knows; without it, it is drawn once per trial."""


class FrictionDeviation(Deviation):
    """Relative deviation of the friction of the floor [%]: drawn floors are more slippery than drawings say.

    The logarithm of the friction is what is drawn: with a standard deviation of 50 % a floor one deviation
    off has exp(-0.5) = 0.6 of the friction. No floor has less than a tenth, on which the unit hardly starts.
    """

    one_sided = True

    sigma: Annotated[float, between(0.0, 300.0)] = 0.0
    """Standard deviation of the logarithm [%]; the friction is lower by the magnitude of what is drawn."""
    error: Annotated[float, between(-90.0, 100.0)] | None = None
    """True error [%], which no robot knows; without it, it is drawn once per trial."""


class PixelDeviation(Deviation):
    """Deviation of a place in the image [px]."""

    sigma: Annotated[float, between(0.0, 50.0)] = 0.0
    """Standard deviation [px], which a robot may know as a tolerance."""
    error: Annotated[float, between(-200.0, 200.0)] | None = None
    """True error [px], which no robot knows; without it, it is drawn once per trial."""


class CoefficientDeviation(Deviation):
    """Deviation of a coefficient of the lens distortion, which has no unit."""

    sigma: Annotated[float, between(0.0, 0.2)] = 0.0
    """Standard deviation, which a robot may know as a tolerance."""
    error: Annotated[float, between(-1.0, 1.0)] | None = None
    """True error, which no robot knows; without it, it is drawn once per trial."""


class ClockDeviation(Deviation):
    """Deviation of a clock [ms]."""

    sigma: Annotated[float, between(0.0, 200.0)] = 0.0
    """Standard deviation [ms], which a robot may know as a tolerance."""
    error: Annotated[float, between(-1000.0, 1000.0)] | None = None
    """True error [ms], which no robot knows; without it, it is drawn once per trial."""


class DelayDeviation(Deviation):
    """A delay that no data sheet has [ms]."""

    one_sided = True

    sigma: Annotated[float, between(0.0, 200.0)] = 0.0
    """Standard deviation [ms]; the delay is the magnitude of what is drawn."""
    error: Annotated[float, between(0.0, 1000.0)] | None = None
    """True delay [ms], which no robot knows; without it, it is drawn once per trial."""


class SpeedDeviation(Deviation):
    """A speed of a wheel below which it does not turn [rad/s]."""

    one_sided = True

    sigma: Annotated[float, between(0.0, 1.0)] = 0.0
    """Standard deviation [rad/s]; the speed is the magnitude of what is drawn."""
    error: Annotated[float, between(0.0, 5.0)] | None = None
    """True speed [rad/s], which no robot knows; without it, it is drawn once per trial."""
