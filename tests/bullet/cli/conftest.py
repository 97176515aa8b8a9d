"""Commands of the tests run in a folder of their own, with a terminal of fixed width."""

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


@pytest.fixture
def short_trial() -> list[str]:
    """Options for a real trial that takes no time: no contact, no pixels, one simulated second."""
    return ["--set", "plant=unicycle", "--set", "perception=parametric", "--set", "time_limit_s=1"]
