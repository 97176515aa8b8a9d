"""The example that trains an agent, with a stand-in for the library of algorithms."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pytest

from msrr_bullet.run import run_trial
from msrr_scenes.loading.load import load_scene
from msrr_scenes.outcome import Outcome
from tests.conftest import BLIND, CALIBRATION

PROGRAM = Path(__file__).resolve().parents[1] / "examples" / "train_agent.py"
SCALE = np.array([0.3, 0.03, 0.2])


class Pursuit:
    """Stands for the algorithm, and has nothing to learn: it steers at a point ahead on the axis."""

    rewards: ClassVar[list[float]] = []
    info: ClassVar[dict[str, Any]] = {}

    def __init__(self, policy: str, env: Any, **settings: Any) -> None:
        self.env = env

    @staticmethod
    def load(path: str, device: str) -> Pursuit:
        return Pursuit("MlpPolicy", None)

    def save(self, path: Path) -> None: ...

    def predict(self, seen: Any, deterministic: bool) -> tuple[Any, None]:
        assert np.abs(seen).max() < 6.0
        x, y, yaw = seen[:3] * SCALE
        v = np.clip(-0.5 * (x + 0.1), 0.04, 0.12)
        w = 12.0 * v * np.sin(np.clip(np.arctan2(-y, 0.15), -0.2, 0.2) - yaw)
        return np.clip([(v - 0.12) / 0.08, w / 0.5], -1.0, 1.0), None

    def learn(self, decisions: int) -> None:
        seen, _ = self.env.reset(seed=1)
        over = False
        while not over:
            seen, reward, terminated, truncated, Pursuit.info = self.env.step(self.predict(seen, True)[0])
            Pursuit.rewards.append(reward)
            over = terminated or truncated


@pytest.fixture(autouse=True)
def libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    torch, algorithms = ModuleType("torch"), ModuleType("stable_baselines3")
    torch.set_num_threads = lambda threads: None  # type: ignore[attr-defined]  # of a module that is made here
    algorithms.SAC = Pursuit  # type: ignore[attr-defined]  # of a module that is made here
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setitem(sys.modules, "stable_baselines3", algorithms)
    monkeypatch.syspath_prepend(str(PROGRAM.parent))


def test_a_dock_is_worth_what_its_potential_lacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Discounted, the rewards of an episode sum up to those without shaping, less the potential at first."""
    monkeypatch.chdir(tmp_path)
    Pursuit.rewards.clear()
    runpy.run_path(str(PROGRAM), run_name="__main__")
    assert Pursuit.info["is_success"]
    assert len(Pursuit.rewards) < 100  # ten a second
    total = np.sum(Pursuit.rewards * 0.99 ** np.arange(len(Pursuit.rewards)))
    assert 0.99 ** (len(Pursuit.rewards) - 1) - 0.6 < total < 0.99 ** (len(Pursuit.rewards) - 1) - 0.3


def test_what_has_been_learned_is_a_docking_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene("close_range", {**BLIND, **CALIBRATION, "control.docking": "train_agent:Agent"})
    result = run_trial(scene, seed=1)
    sys.modules.pop("train_agent", None)
    assert result.outcome is Outcome.DOCKED, result.reason
