"""The environment of Gymnasium: its trials are those that the command line runs."""

from __future__ import annotations

import gc
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from msrr_bullet.gym import DockingEnv, Vector
from msrr_bullet.log import read_log
from msrr_bullet.replay.comparison import ReplayError
from msrr_bullet.replay.log_replay import replay
from msrr_bullet.run import run_trial
from msrr_bullet.trial.result import TrialResult
from msrr_control.docking.controller import ControlInputs
from msrr_control.docking.law import DockSetup
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Twist
from msrr_scenes.outcome import Outcome
from tests.conftest import BLIND, CALIBRATION

IMAGES = {"plant": "bullet", "perception": "images"}

#: Distance from the axle to the front port of the shipped units [m].
OFFSET = 0.1


def pursue(observation: Vector) -> Vector:
    """Steer at a point ahead on the axis of the port, as the example of a controller of one's own does."""
    x, y, yaw = observation[:3]
    v = min(0.12, 0.03 + 0.5 * max(-x - OFFSET, 0.0))
    error = np.clip(np.arctan2(-y, 0.15), -0.2, 0.2) - yaw
    return np.array([v, 2.0 * v / 0.15 * np.sin(error)], dtype=np.float32)


def stand(observation: Vector) -> Vector:
    """Wait."""
    return np.zeros(2, dtype=np.float32)


@pytest.fixture
def made() -> Iterator[Callable[..., DockingEnv]]:
    """Make environments, without contact and pixels unless told otherwise, and close them."""
    environments: list[DockingEnv] = []

    def make(scene: str = "close_range", **overrides: object) -> DockingEnv:
        environments.append(DockingEnv(scene, {**BLIND, **CALIBRATION, **overrides}))
        return environments[-1]

    yield make
    for env in environments:
        env.close()


def episode(env: DockingEnv, policy: Callable[[Vector], Vector] = pursue) -> tuple[list[Any], TrialResult]:
    """Return the steps of an episode that was begun with a reset, and the result of the trial."""
    steps = [env.step(policy(env._observation))]
    while not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(policy(steps[-1][0])))
    result = steps[-1][4]["result"]
    assert isinstance(result, TrialResult)
    return steps, result


@pytest.mark.filterwarnings("ignore:.*Box.*")  # the checker prefers spaces of -1 to 1, which have no units
def test_it_is_an_environment_as_gymnasium_wants_them(made: Callable[..., DockingEnv]) -> None:
    env = gymnasium.make("msrr_bullet/Docking-v0", scene="close_range", overrides={**BLIND, **CALIBRATION})
    assert isinstance(env.unwrapped, DockingEnv)
    check_env(env.unwrapped)
    env.close()


class Played:
    """A controller that gives the commands that an agent gave, and notes its inputs."""

    commands: ClassVar[list[Vector]] = []
    inputs: ClassVar[list[ControlInputs]] = []

    def __init__(self, setup: DockSetup) -> None:
        self.left = iter(Played.commands)
        Played.inputs.clear()

    def reset(self, inputs: ControlInputs) -> None: ...

    def step(self, inputs: ControlInputs) -> Twist:
        Played.inputs.append(inputs)
        return Twist(*map(float, next(self.left)))


def test_an_observation_is_the_agent_s_own(made: Callable[..., DockingEnv]) -> None:
    """What an agent does to one changes none that follows; at the end the last one is given again."""
    env = made(time_limit_s=4.0)
    given, _ = env.reset(seed=0)
    ended = False
    while not ended:
        last = given.copy()
        given *= 0.0
        given, _, terminated, ended, _ = env.step(np.zeros(2, dtype=np.float32))
        assert not terminated
    assert np.array_equal(given, last)


@pytest.mark.usefixtures("undrawn_runs")
def test_a_controller_with_the_same_commands_has_the_same_trial(
    made: Callable[..., DockingEnv], tmp_path: Path
) -> None:
    near = {**IMAGES, "units.a.pose.x_m": -0.35}
    env = made(**near)
    first, info = env.reset(seed=3, options={"out": tmp_path / "agent"})
    steps, result = episode(env)
    observations = [first, *(step[0] for step in steps[:-1])]
    Played.commands = [pursue(observation) for observation in observations]

    scene = load_scene("close_range", {**CALIBRATION, **near, "control.docking": f"{__name__}:Played"})
    again = run_trial(scene, 3, out=tmp_path / "played")

    assert result.outcome is Outcome.DOCKED
    assert info["seed"] == 3
    assert again.model_copy(update={"scene_hash": "", "folder": None}) == result.model_copy(
        update={"scene_hash": "", "folder": None}
    )
    logs = [list(read_log(tmp_path / run).records()) for run in ("agent", "played")]
    assert [record.data for record in logs[0]] == [record.data for record in logs[1]]
    # What the agent sees is what the controller is given.
    poses = np.array([inputs.pose.X_DU.as_array() for inputs in Played.inputs])
    deviations = np.array([np.diagonal(inputs.pose.covariance) ** 0.5 for inputs in Played.inputs])
    twists = np.array([(inputs.twist.v, inputs.twist.w) for inputs in Played.inputs])
    numbers = np.array(observations)
    np.testing.assert_allclose(numbers[:, :3], poses, rtol=1e-6)
    np.testing.assert_allclose(numbers[:, 3:6], deviations, rtol=1e-6)
    np.testing.assert_allclose(numbers[:, 9:11], twists, rtol=1e-6)


def test_environments_that_take_turns_do_not_disturb_each_other(made: Callable[..., DockingEnv]) -> None:
    env = made(**IMAGES)
    env.reset(seed=1)
    seen_alone, alone = env._observation, []
    for _ in range(60):
        seen_alone = env.step(pursue(seen_alone))[0]
        alone.append(seen_alone)
    seeds, environments = (1, 2), [made(**IMAGES), made(**IMAGES)]
    seen = [env.reset(seed=seed)[0] for seed, env in zip(seeds, environments, strict=True)]
    together = []
    for _ in range(60):
        seen = [env.step(pursue(last))[0] for env, last in zip(environments, seen, strict=True)]
        together.append(seen[0])
    np.testing.assert_array_equal(together, alone)


def test_only_the_last_step_of_a_dock_is_rewarded(made: Callable[..., DockingEnv]) -> None:
    env = made()
    env.reset(seed=0)
    steps, result = episode(env)
    assert result.outcome is Outcome.DOCKED
    assert [step[1] for step in steps] == [0.0] * (len(steps) - 1) + [1.0]
    assert [step[2] for step in steps] == [False] * (len(steps) - 1) + [True]
    assert not any(step[3] for step in steps)
    assert steps[-1][4]["progress"].true.x == pytest.approx(-OFFSET, abs=0.005)
    assert [step[4].get("is_success") for step in steps] == [None] * (len(steps) - 1) + [True]


@pytest.mark.usefixtures("undrawn_runs")
def test_an_action_at_the_edge_of_the_space_is_what_the_robot_is_told(
    made: Callable[..., DockingEnv], tmp_path: Path
) -> None:
    """In front of a port units drive slower than elsewhere."""
    env = made()
    env.reset(seed=0, options={"out": tmp_path})
    fastest = float(env.action_space.high[0])
    for v in (fastest, -fastest):
        env.step(np.array([v, 0.0]))
    env.close()
    told = [record.message.twist.v for record in read_log(tmp_path).records("/control/*/action")]
    assert told[-2:] == pytest.approx([fastest, -fastest])
    assert fastest < env.scene.limits.v_max_mps


def test_an_agent_that_stands_still_gets_all_attempts_and_no_reward(made: Callable[..., DockingEnv]) -> None:
    env = made(**{"docking.attempts": 2})
    env.reset(seed=0)
    steps, result = episode(env, stand)
    assert result.outcome is Outcome.GAVE_UP
    assert {step[4]["progress"].attempt for step in steps} == {1, 2}
    assert steps[-1][4]["is_success"] is False
    assert sum(step[1] for step in steps) == 0.0
    assert steps[-1][2]


def test_the_time_limit_of_the_scene_truncates(made: Callable[..., DockingEnv]) -> None:
    env = made(time_limit_s=4.0)
    env.reset(seed=0)
    steps, result = episode(env)
    assert result.outcome is Outcome.TIMEOUT
    assert steps[-1][1:4] == (0.0, False, True)


def test_a_plan_of_two_docks_is_one_episode(made: Callable[..., DockingEnv]) -> None:
    env = made("three_units")
    env.reset(seed=0)
    steps, result = episode(env)
    assert result.outcome is Outcome.DOCKED, result.reason
    assert len({step[4]["progress"].step.unit for step in steps}) == len(result.steps) == 2


def test_the_seed_of_the_first_reset_chooses_those_of_the_next(made: Callable[..., DockingEnv]) -> None:
    seeds = []
    for env in (made(), made()):
        seeds.append([env.reset(seed=7)[1]["seed"], *(env.reset()[1]["seed"] for _ in range(3))])
    assert seeds[0] == seeds[1]
    assert seeds[0][0] == 7
    assert len(set(seeds[0])) == 4


@pytest.mark.parametrize("ending", ["closed", "forgotten"])
def test_a_trial_that_is_left_ends_its_log(ending: str, tmp_path: Path) -> None:
    """It has no result: neither did it fail, nor did the agent."""
    env = DockingEnv("close_range", {**BLIND, **CALIBRATION})
    observation, _ = env.reset(seed=0, options={"out": tmp_path})
    for _ in range(10):
        env.step(stand(observation))
    if ending == "closed":
        env.close()
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(stand(observation))
    del env
    gc.collect()
    assert read_log(tmp_path).complete
    assert read_log(tmp_path).end_ns() > 0
    assert not (tmp_path / "result.json").exists()
    for trust in (False, True):
        with pytest.raises(ReplayError, match="no log holds how it decides"):
            replay(tmp_path, trust=trust)


def test_trials_without_a_docking_phase_are_skipped_and_at_last_given_up(
    made: Callable[..., DockingEnv],
) -> None:
    env = made(time_limit_s=0.05)
    with pytest.raises(MsrrError, match=r"close_range: no docking phase began in 20 trials.*timeout"):
        env.reset(seed=0)


def test_an_episode_goes_on_in_its_own_thread(made: Callable[..., DockingEnv]) -> None:
    env = made()
    env.reset(seed=0)
    with ThreadPoolExecutor(1) as other:
        for use in (lambda: env.step(np.zeros(2, np.float32)), lambda: env.reset(seed=1), env.close):
            with pytest.raises(MsrrError, match=r"in the thread that began it; make an environment"):
                other.submit(use).result()
    env.step(np.zeros(2, np.float32))
    env.close()


def test_what_cannot_be_done_is_refused(made: Callable[..., DockingEnv]) -> None:
    with pytest.raises(SceneError, match=r"override control\.docking\.name: the agent is the docking"):
        made(**{"control.docking.name": "cbf"})
    with pytest.raises(SceneError, match=r"override control: the agent is the docking"):
        made(control={"docking": "cbf"})
    for scene in ("assemble_line", "corridor"):
        with pytest.raises(SceneError, match=f"{scene}: a base station leads several units at a time"):
            DockingEnv(scene)
    env = made()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(2))
    with pytest.raises(ValueError, match="unknown option 'folder'"):
        env.reset(options={"folder": "runs"})
    with pytest.raises(ValueError, match="a seed is a number from 0"):
        env.reset(seed=-1)
    for out, error in (("", ValueError), (5, TypeError)):
        with pytest.raises(error, match=r"^out is "):
            env.reset(options={"out": out})
    with pytest.raises(ValueError, match="options are a dictionary; found 'runs'"):
        env.reset(options="runs")
    env.reset(seed=0)
    for action in ([0.1], [0.1, np.nan], [[0.1, 0.0]], [0.1j, 0.0], "ahead", {"v": 1.0}):
        with pytest.raises(ValueError, match="an action is two finite numbers"):
            env.step(np.array(action))


def test_only_an_environment_can_run_a_trial_of_an_agent() -> None:
    agent = {"control.docking": "msrr_bullet.gym:AgentController"}
    with pytest.raises(SceneError, match=r"only msrr_bullet\.gym\.DockingEnv can run this trial"):
        run_trial(load_scene("close_range", {**BLIND, **agent}))


def test_without_its_packages_it_says_which_one_is_missing() -> None:
    code = "import sys; sys.modules['gymnasium'] = None; import msrr_bullet.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "needs gymnasium, which is not installed: pip install 'msrr-bullet[gym]'" in done.stderr
