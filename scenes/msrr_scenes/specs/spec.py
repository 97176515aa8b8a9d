"""The base of every specification: frozen, unknown keys refused, no NaN, units in the key."""

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
    """A frozen specification. Numbers are SI with the unit in the key; angles in scene files are degrees."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=False, arbitrary_types_allowed=True
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
    """An implementation by registered name or import path (``mypkg.mod:MyClass``), with its parameters."""

    name: str
    params: dict[str, Any] = Field(default_factory=dict)


class Spread(Spec):
    """Half-widths of a uniform distribution about a pose."""

    x_m: NonNegative = 0.0
    y_m: NonNegative = 0.0
    yaw_deg: NonNegative = 0.0


class PoseSpec(Spec):
    """A planar pose, drawn anew per trial when it has a spread.

    In frame ``world`` it is the pose of the body itself. In frame ``<unit>.<port>`` it is given in the dock
    frame D of that port (face in the origin, x into the unit), and speaks of the *front port* of the unit
    that is placed: ``x_m: -0.70`` leaves 0.70 m between the two faces.
    """

    x_m: Finite = 0.0
    y_m: Finite = 0.0
    yaw_deg: Finite = 0.0
    frame: str = Field(default="world", pattern=r"^(world|[a-z][a-z0-9_]*\.[a-z][a-z0-9_]*)$")
    spread: Spread = Spread()

    @property
    def nominal(self) -> SE2:
        """The pose without its spread, in its own frame."""
        return SE2(self.x_m, self.y_m, math.radians(self.yaw_deg))
