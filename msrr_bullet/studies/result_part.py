"""What all parts of a reproduction's JSON have in common."""

from __future__ import annotations

from pydantic import BaseModel


class ResultPart(BaseModel, frozen=True, extra="forbid", ser_json_inf_nan="strings"):
    """A part of the results: frozen, without unknown keys, infinite numbers as strings."""
