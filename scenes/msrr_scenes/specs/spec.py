"""The base class of every specification, and the specifications that others are built of."""

from __future__ import annotations

import math
from typing import Annotated, Any, get_origin

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.field_descriptions import field_descriptions


def between(low: float, high: float) -> Any:
    """Return the field of a number from ``low`` to ``high``, both included."""
    return Field(ge=low, le=high, allow_inf_nan=False)


# Every number has a range, so that whatever is accepted can be run. The ranges say what the testbed can
# compute with, not what is wise: each lies well outside the values for which the unit was designed.

#: Place along an axis [m]. The rasteriser works in single precision, which resolves 8 um at 100 m: a tenth
#: of the error with which a unit touches its port.
Coordinate = Annotated[float, between(-100.0, 100.0)]
#: Distance, margin or deviation [m], up to the farthest place; zero is allowed.
Distance = Annotated[float, between(0.0, 100.0)]
#: Length that is divided by [m]. A hundredth of a millimetre is the collision margin of small shapes.
Length = Annotated[float, between(1e-5, 100.0)]
#: Edge or radius of a body or of a tag [m]. Bullet advises against shapes below some centimetres; 5 mm is
#: what a pixel of the overhead camera shows at its usual height. 10 m is wider than the usual arena.
Size = Annotated[float, between(0.005, 10.0)]
#: Angle of a pose or of a camera [deg], one turn each way.
Angle = Annotated[float, between(-360.0, 360.0)]
#: Magnitude of an angle [deg], up to a turn.
Turn = Annotated[float, between(0.0, 360.0)]
#: Magnitude of an angle that is divided by [deg]: a thousandth is finer than any encoder of the unit.
Tolerance = Annotated[float, between(1e-3, 360.0)]
#: Events per second [Hz]. Below one a second a moving unit is blind for more than its own length; a
#: thousand is the rate of fast servo loops.
Rate = Annotated[float, between(1.0, 1000.0)]
#: Delay of a message [ms]. Beyond two seconds the unit has passed every place that a frame shows.
Latency = Annotated[float, between(0.0, 2000.0)]
#: Time at or for which something happens [s], up to an hour.
Time = Annotated[float, between(0.0, 3600.0)]
#: Time that something has to take [s], from a millisecond, the shortest tick of the physics that counts.
Duration = Annotated[float, between(1e-3, 3600.0)]
#: Speed [m/s]: from a millimetre per second, a fiftieth of the press speed, to that of a runner.
Speed = Annotated[float, between(1e-3, 5.0)]
#: Turn rate [rad/s]: three turns a second at most, at which the body's edge is as fast as a walker.
TurnRate = Annotated[float, between(1e-3, 20.0)]
#: Acceleration [m/s^2 or rad/s^2]; wheels slip far below 50 m/s^2.
Acceleration = Annotated[float, between(1e-3, 50.0)]
#: Gain of a loop [1/s]. A loop sampled a thousand times a second is unstable above two thousand.
Gain = Annotated[float, between(1e-3, 2000.0)]
#: Force [N]: from the weight of a coin to a hundred times that of the unit.
Force = Annotated[float, between(0.01, 3000.0)]
#: Torque [N m] on a wheel, from one that turns nothing; at 33 mm radius, 100 N m is the largest force.
Torque = Annotated[float, between(1e-6, 100.0)]
#: Standard deviation or step in grey levels, of which an image has 255.
Grey = Annotated[float, between(0.0, 255.0)]
#: Positive figure without a unit of its own. A millionth to a million leaves squares and their reciprocals
#: within the twelve digits that double precision can still add to one.
Positive = Annotated[float, between(1e-6, 1e6)]
#: Figure that may be zero as well.
NonNegative = Annotated[float, between(0.0, 1e6)]
Probability = Annotated[float, between(0.0, 1.0)]

_NAME = r"[a-z][a-z0-9_]{0,31}"
#: Name of a body or port, which becomes part of topics and of names of streams.
Name = Annotated[str, Field(pattern=f"^{_NAME}$")]
#: Name of a port together with its unit.
PortName = Annotated[str, Field(pattern=rf"^{_NAME}\.{_NAME}$")]
#: Text for people: about a page.
Text = Annotated[str, Field(max_length=4000)]
#: Name of a file or of an implementation: the longest name that common file systems allow.
FileName = Annotated[str, Field(min_length=1, max_length=255)]


class Spec(BaseModel):
    """A frozen specification that refuses unknown keys and numbers that are not finite.

    Every key ends in its unit; angles in scene files are degrees. The docstring below a field is the
    description of its key in the JSON schema.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
    )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for name, description in field_descriptions(cls).items():
            if name in properties:
                properties[name].setdefault("description", description)
        return schema

    @model_validator(mode="before")
    @classmethod
    def _no_flag_for_a_number(cls, data: Any) -> Any:
        # Left alone, pydantic reads `yes` in a scene file as the number 1.
        if isinstance(data, dict):
            for key, value in data.items():
                field = cls.model_fields.get(key)
                if field is None or field.annotation in (bool, dict[str, Any]):
                    continue
                parts = (value,)
                if isinstance(value, (list, tuple)):
                    parts = tuple(value)
                elif isinstance(value, dict) and get_origin(field.annotation) is dict:
                    parts = tuple(value.values())
                flag = next((part for part in parts if isinstance(part, bool)), None)
                if flag is not None:
                    context = {"key": key, "shown": str(flag).lower()}
                    raise PydanticCustomError("flag", "{key}: expected a value, found {shown}", context)
        return data

    @model_validator(mode="before")
    @classmethod
    def _complete_choices(cls, data: Any) -> Any:
        # `docking: c2` is a choice without parameters, `docking: {params: ...}` one with the default's name.
        if not isinstance(data, dict):
            return data
        completed = dict(data)
        for key, value in data.items():
            default = cls.model_fields[key].default if key in cls.model_fields else None
            if isinstance(default, Choice):
                if isinstance(value, str):
                    completed[key] = {"name": value}
                elif isinstance(value, dict) and "name" not in value:
                    completed[key] = {"name": default.name, **value}
        return completed


class Choice(Spec):
    """An implementation of an extension point, with its parameters."""

    name: FileName
    """Registered name or import path (``mypkg.mod:MyClass``) of the implementation."""
    params: dict[str, Any] = Field(default_factory=dict, max_length=100)
    """Parameters that the implementation is built with."""


class Spread(Spec):
    """Half-widths of a uniform distribution about a pose."""

    x_m: Distance = 0.0
    """Largest deviation along x [m]."""
    y_m: Distance = 0.0
    """Largest deviation along y [m]."""
    yaw_deg: Turn = 0.0
    """Largest deviation of the yaw [deg]."""


class PoseSpec(Spec):
    """A planar pose, drawn anew per trial when it has a spread.

    In frame ``world`` it is the pose of the body itself. In frame ``<unit>.<port>`` it is given in the dock
    frame D of that port (origin on the face, x into the unit) and is the pose of the *front port* of the unit
    that is placed: ``x_m: -0.70`` leaves 0.70 m between the two faces.
    """

    x_m: Coordinate = 0.0
    """Position along x of the frame [m]."""
    y_m: Coordinate = 0.0
    """Position along y of the frame [m]."""
    yaw_deg: Angle = 0.0
    """Yaw, counter-clockwise positive [deg]."""
    frame: str = Field(default="world", pattern=rf"^(world|{_NAME}\.{_NAME})$")
    """Frame of the pose: ``world``, or ``<unit>.<port>``, the dock frame of a port, where a unit is placed by
    its front port."""
    spread: Spread = Spread()
    """Half-widths of the uniform distribution that a start is drawn from."""

    @property
    def nominal(self) -> SE2:
        """The pose without its spread, in its own frame."""
        return SE2(self.x_m, self.y_m, math.radians(self.yaw_deg))
