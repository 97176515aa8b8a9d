"""Specifications of missions of many units: the shape to build, what is assembled at the start, the radio."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, model_validator

from msrr_scenes.specs.bodies import MAX_UNITS
from msrr_scenes.specs.spec import Latency, Name, PortName, Probability, Rate, Spec, Time

#: Number of units of a shape, up to that of a scene.
Count = Annotated[int, Field(ge=1, le=MAX_UNITS)]

Pattern = Literal["line", "tee", "cross", "comb", "zigzag"]


class ShapeSpec(Spec):
    """A shape that units assemble into: a pattern with a number of units, or a tree of ports."""

    line: Count | None = None
    """Number of units of a line, each docked to the rear of the one before it."""
    tee: Annotated[int, Field(ge=4, le=MAX_UNITS)] | None = None
    """Number of units of a T: a line, and a second one at the left of its middle."""
    cross: Annotated[int, Field(ge=4, le=MAX_UNITS)] | None = None
    """Number of units of a cross: arms at the rear, the left and the right of the root."""
    comb: Annotated[int, Field(ge=3, le=MAX_UNITS)] | None = None
    """Number of units of a comb: a line with a unit at the left of every second one."""
    zigzag: Annotated[int, Field(ge=2, le=MAX_UNITS)] | None = None
    """Number of units of a zigzag: docked to the rear of the root, then to left and right in turns."""
    tree: (
        Annotated[dict[Name, PortName | Literal["root"]], Field(min_length=1, max_length=MAX_UNITS)] | None
    ) = None
    """Every place with the port that it docks to, ``<place>.<port>``, or ``root``."""
    named: bool = False
    """Whether the places of the tree are named by the units that are to stand there; else any unit may."""

    @model_validator(mode="after")
    def _exactly_one(self) -> ShapeSpec:
        kinds = (*get_args(Pattern), "tree")
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(given) != 1:
            found = ", ".join(given) or "none"
            raise ValueError(f"exactly one of {', '.join(kinds)} is needed, found {found}")
        if self.named and self.tree is None:
            raise ValueError("named needs a tree: the places of a pattern have no units' names")
        return self

    def __str__(self) -> str:
        """Return the shape in words."""
        return f"{self.key} of {self.count}"

    @property
    def key(self) -> str:
        """Key under which the scene gives the shape."""
        return "tree" if self.pattern is None else self.pattern[0]

    @property
    def count(self) -> int:
        """Number of places."""
        return len(self.tree or {}) if self.pattern is None else self.pattern[1]

    @property
    def pattern(self) -> tuple[Pattern, int] | None:
        """The pattern and its number of units; None for a tree."""
        pattern: Pattern
        for pattern in get_args(Pattern):
            count: int | None = getattr(self, pattern)
            if count is not None:
                return pattern, count
        return None


def _as_list(value: Any) -> Any:
    return value if value is None or isinstance(value, (list, tuple)) else [value]


#: Shapes that are built one after the other; a single one is written without the brackets of a list.
Shapes = Annotated[
    Annotated[tuple[ShapeSpec, ...], Field(min_length=1, max_length=20)] | None, BeforeValidator(_as_list)
]


class AssembledPair(Spec):
    """Two units that are locked together when a trial begins; a scene file writes ``a.front-b.rear``."""

    active: PortName
    """Active port, ``<unit>.<port>``."""
    passive: PortName
    """Passive port that holds it, ``<unit>.<port>``."""

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, data: Any) -> Any:
        if isinstance(data, str):
            active, dash, passive = data.partition("-")
            if not dash:
                raise ValueError(f"expected <unit>.<port>-<unit>.<port>, found {data!r}")
            return {"active": active, "passive": passive}
        return data

    @model_validator(mode="after")
    def _two_units(self) -> AssembledPair:
        if self.active.partition(".")[0] == self.passive.partition(".")[0]:
            raise ValueError(f"a unit cannot be locked to itself, found {self.active}-{self.passive}")
        return self


class SilenceSpec(Spec):
    """A time in which messages are lost: those that are sent in it."""

    from_s: Time
    """Beginning [s]."""
    until_s: Time
    """End [s]."""
    units: tuple[Name, ...] = Field(default=(), max_length=MAX_UNITS)
    """Units whose messages, in both directions, are lost; all if it is empty."""

    @model_validator(mode="after")
    def _in_order(self) -> SilenceSpec:
        if self.until_s <= self.from_s:
            raise ValueError(f"until_s has to be after from_s, found {self.until_s:g} and {self.from_s:g}")
        return self


class RadioSpec(Spec):
    """The radio between the base station and the units."""

    rate_hz: Rate = 5.0
    """Reports per second of each unit [Hz]; what the base station grants is sent five times a second."""
    latency_ms: Latency = 20.0
    """Delay of a message [ms]."""
    jitter_ms: Latency = 0.0
    """Largest additional delay of a message, drawn for each one [ms]; messages may overtake each other."""
    loss: Probability = 0.0
    """Probability that a message is lost."""
    silences: tuple[SilenceSpec, ...] = Field(default=(), max_length=100)
    """Times in which messages are lost."""
