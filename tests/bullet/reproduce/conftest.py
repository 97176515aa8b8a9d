"""Trials of the loop without contact or pixels."""

import pytest


@pytest.fixture
def blind_loop() -> dict[str, str]:
    """Overrides that replace contact and pixels by models: a trial of the loop in a fraction of a second."""
    return {"plant": "unicycle", "perception": "parametric"}
