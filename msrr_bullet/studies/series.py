"""Series of one trial over time, as the JSON of a reproduction holds them."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field

from msrr_bullet.studies.measures import PhaseName


class ResultPart(BaseModel, frozen=True, extra="forbid", ser_json_inf_nan="strings"):
    """A part of the results: frozen, without unknown keys, infinite numbers as strings."""


def _rounded(values: Any) -> Any:
    """Turn an array into nested lists, rounded to the micrometre; leave anything else as it is."""
    return np.round(values, 6).tolist() if isinstance(values, np.ndarray) else values


_Scalars = Annotated[tuple[float, ...], BeforeValidator(_rounded)]
_Pairs = Annotated[tuple[tuple[float, float], ...], BeforeValidator(_rounded)]
_Triples = Annotated[tuple[tuple[float, float, float], ...], BeforeValidator(_rounded)]


class Series(ResultPart):
    """One trial over time, for the six panels; SI, in the frame of the phase's reference.

    Every series may be given as an array of shape (T,), (T, 2) or (T, 3), and is rounded to the micrometre.

    Attributes:
        time: Time [s].
        tip: Controlled point (x, y).
        reference: Point (x, y) that the controlled point is to follow; nothing if it follows none.
        corrected: The same with the line-of-sight correction (close phase), or nothing.
        error: Difference (x, y, yaw) from the reference, in the frame of the phase; from the port's axis if
            there is no reference.
        command: Commanded speeds (v, w).
        twist: Speeds (v, w) behind the drive's limits.
        angles: The two edge angles (close phase), or nothing.
        distance: Distance from the body to the centre of the obstacle (long phase), or nothing.
        auxiliary: States that only this law has, by name, each with two axes.
        obstacle: Centre (x, y) and radius of the obstacle, if there is one.
        limits: Largest v and w.
    """

    time: _Scalars
    tip: _Pairs
    reference: _Pairs = ()
    corrected: _Pairs = ()
    error: _Triples
    command: _Pairs
    twist: _Pairs
    angles: _Pairs = ()
    distance: _Scalars = ()
    auxiliary: dict[str, _Pairs] = Field(default_factory=dict)
    obstacle: tuple[float, float, float] | None = None
    limits: tuple[float, float]


class Panels(ResultPart):
    """The series of one phase, by the controller's label."""

    phase: PhaseName
    setting: str
    series: dict[str, Series]


class Figure6(ResultPart):
    """C1 and C2 in one trial of the close phase, at the setting that is most like the paper's.

    Attributes:
        plant: The plant.
        description: The setting.
        series: Series by label; the heading is the third component of the error.
    """

    plant: str
    description: str
    series: dict[str, Series]
