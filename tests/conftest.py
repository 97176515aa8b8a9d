"""What every test of whole trials shares: shipped scenes, seen with one renderer that is named here."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest

from msrr_scenes.load import load_scene
from msrr_scenes.scene import Scene

#: How trials of the tests are rendered, unless a test is about rendering.
RENDERING: Mapping[str, str] = {"cameras.onboard.samples": "1"}

#: Ideal unicycles and the true pose with errors: a trial in a fraction of a second, for what needs no pixels.
BLIND: Mapping[str, str] = {"plant": "unicycle", "perception": "parametric"}

ShippedScene = Callable[..., Scene]


@pytest.fixture(scope="session")
def rendering() -> Mapping[str, str]:
    """How trials of the tests are rendered, as overrides of a scene."""
    return RENDERING


@pytest.fixture(scope="session")
def shipped() -> ShippedScene:
    """Load a shipped scene for a trial: ``shipped("weak_lock", {"lock.strength_n": "60"})``.

    ``blind=True`` replaces contact and pixels by their models.
    """

    def load(name: str, overrides: Mapping[str, str] | None = None, *, blind: bool = False) -> Scene:
        return load_scene(name, {**RENDERING, **(BLIND if blind else {}), **(overrides or {})})

    return load
