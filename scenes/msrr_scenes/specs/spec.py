"""The base class of every specification, and the specifications that others are built of."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from msrr_scenes.geometry.se2 import SE2

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class Spec(BaseModel):
    """A frozen specification that refuses unknown keys and numbers that are not finite.

    Every key ends in its unit; angles in scene files are degrees. The docstring below a field is the
    description of its key in the JSON schema.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        strict=False,
        arbitrary_types_allowed=True,
        use_attribute_docstrings=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _no_flag_for_a_number(cls, data: Any) -> Any:
        # Left alone, pydantic reads `yes` in a scene file as the number 1.
        if isinstance(data, dict):
            for key, value in data.items():
                field = cls.model_fields.get(key)
                if isinstance(value, bool) and field is not None and field.annotation is not bool:
                    context = {"key": key, "shown": str(value).lower()}
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

    name: str
    """Registered name or import path (``mypkg.mod:MyClass``) of the implementation."""
    params: dict[str, Any] = Field(default_factory=dict)
    """Parameters that the implementation is built with."""


class Spread(Spec):
    """Half-widths of a uniform distribution about a pose."""

    x_m: NonNegative = 0.0
    """Largest deviation along x [m]."""
    y_m: NonNegative = 0.0
    """Largest deviation along y [m]."""
    yaw_deg: NonNegative = 0.0
    """Largest deviation of the yaw [deg]."""


class PoseSpec(Spec):
    """A planar pose, drawn anew per trial when it has a spread.

    In frame ``world`` it is the pose of the body itself. In frame ``<unit>.<port>`` it is given in the dock
    frame D of that port (origin on the face, x into the unit) and is the pose of the *front port* of the unit
    that is placed: ``x_m: -0.70`` leaves 0.70 m between the two faces.
    """

    x_m: Finite = 0.0
    """Position along x of the frame [m]."""
    y_m: Finite = 0.0
    """Position along y of the frame [m]."""
    yaw_deg: Finite = 0.0
    """Yaw, counter-clockwise positive [deg]."""
    frame: str = Field(default="world", pattern=r"^(world|[a-z][a-z0-9_]*\.[a-z][a-z0-9_]*)$")
    """Frame of the pose: ``world`` or ``<unit>.<port>``."""
    spread: Spread = Spread()
    """Half-widths of the uniform distribution that a start is drawn from."""

    @property
    def nominal(self) -> SE2:
        """The pose without its spread, in its own frame."""
        return SE2(self.x_m, self.y_m, math.radians(self.yaw_deg))
