"""Trials of the loop without contact or pixels."""

import pytest


@pytest.fixture(scope="session")
def blind_loop() -> dict[str, str]:
    """Overrides for the loop as `msrr reproduce` runs it, with models in place of contact and pixels."""
    return {"as_built": "perfect", "plant": "unicycle", "perception": "parametric"}
