"""An environment of Gymnasium, in which an agent takes the place of the docking controller of a trial.

Importing this module registers the environment as ``msrr_bullet/Docking-v0``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import get_ident
from types import MappingProxyType
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.replay.log_replay import AGENT
from msrr_bullet.run import run_trial
from msrr_bullet.seeds import checked_seed
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress
from msrr_control.docking.controller import ControlInputs, law_inputs
from msrr_control.docking.law import DockSetup
from msrr_scenes.errors import MissingPackageError, MsrrError, SceneError, StoppedError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Twist
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

try:
    import gymnasium
    from greenlet import GreenletExit, getcurrent, greenlet
except ImportError as error:
    raise MissingPackageError(
        f"msrr_bullet.gym needs {error.name}, which is not installed: pip install 'msrr-bullet[gym]'"
    ) from error

#: Key of the scene that chooses the docking controller.
_CONTROLLER = "control.docking"

#: Number of trials in a row in which the agent may have nothing to do.
_MOST_IDLE = 20

_TURN = math.pi
#: Lowest and highest value of each number of an observation.
_RANGES = (
    *((-math.inf, math.inf), (-math.inf, math.inf), (-_TURN, _TURN)),
    *((0.0, math.inf), (0.0, math.inf), (0.0, math.inf)),
    *((-_TURN, _TURN), (-_TURN, _TURN), (0.0, 1.0)),
    *((-math.inf, math.inf), (-math.inf, math.inf), (0.0, math.inf)),
)

Vector = NDArray[np.float32]


class AgentController:
    """The docking controller in a trial of :class:`DockingEnv`; every command is the agent's."""

    def __init__(self, setup: DockSetup) -> None:
        """Refuse to be part of any other trial.

        Raises:
            ValueError: The trial is not one of an environment, so that there is no agent.
        """
        episode = getcurrent()
        if not isinstance(episode, _Episode):
            raise ValueError("an agent drives here, so only msrr_bullet.gym.DockingEnv can run this trial")
        self._episode = episode

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach, of which the agent learns by the number of the attempt."""

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant."""
        return self._episode.ask(inputs)


class _AbandonedError(StoppedError):
    """Ends a trial that nobody goes on with."""


class _Episode(greenlet):
    """A trial that stands still while the agent chooses a command.

    Attributes:
        progress: State of the trial at its last control instant; None before the first one.
    """

    def __init__(self, scene: Scene, seed: int, out: str | Path | None) -> None:
        super().__init__()
        self.progress: Progress | None = None
        self._scene, self._seed, self._out = scene, seed, out
        self._agent, self._thread = getcurrent(), get_ident()

    def run(self, _: None) -> TrialResult | None:
        """Run the trial, in the greenlet; return None if it was abandoned."""
        with suppress(_AbandonedError):
            return run_trial(self._scene, self._seed, out=self._out, observer=self._note)
        return None

    def _note(self, progress: Progress) -> None:
        self.progress = progress

    def go_on(self, command: Twist | None = None) -> ControlInputs | TrialResult:
        """Run the trial until a command is asked for, and return its inputs, or until it ends.

        Args:
            command: The command that was asked for; None to begin the trial.
        """
        self.check_thread()
        self.parent = self._agent = getcurrent()
        turn: ControlInputs | TrialResult = self.switch(command)
        return turn

    def ask(self, inputs: ControlInputs) -> Twist:
        """Return the command for an instant of the trial, which waits here until the agent has acted."""
        try:
            command: Twist = self._agent.switch(inputs)
        except GreenletExit:
            raise _AbandonedError from None
        return command

    def abandon(self) -> None:
        """Stop the trial if it is under way; its log, if it has one, ends here."""
        if self:
            self.throw()

    def check_thread(self) -> None:
        """Refuse to go on with a trial that is under way in another thread."""
        if self and get_ident() != self._thread:
            raise MsrrError(
                "an episode goes on, and is closed, in the thread that began it; make an environment for each"
            )


class DockingEnv(gymnasium.Env[Vector, Vector]):
    """Trials of a scene in which an agent takes the place of the docking controller.

    An episode is a trial. The agent acts where a controller does: at every control instant of the docking
    phase, 50 times a second unless the scene says otherwise. To search for the port, to retreat, to drive to
    the staging pose and to close the lock remains the robot's part, so that more time passes between some
    steps. If the plan of the scene has several docks, the agent gets them one after another.

    An observation is what a controller is given, which are estimates: 12 numbers in the dock frame D of the
    target port (x into the other unit).

    - 0 to 2: pose (x, y, yaw) of the middle of the axle [m, m, rad].
    - 3 to 5: standard deviations of the pose [m, m, rad].
    - 6, 7: angles from the camera's axis to the left and to the right edge of the target [rad]; 0 if unknown.
    - 8: visibility of the target: 1 if it is seen, 0.5 if its edges are predicted, 0 if it is lost.
    - 9, 10: forward speed and yaw rate by the wheel encoders [m/s, rad/s].
    - 11: age of the pose [s].

    An action is the command (v, w) [m/s, rad/s], up to the scene's ``v_close_mps`` and ``w_max_radps``. The
    robot limits it further where the camera could not read the tags, at the port, and near other bodies.

    An episode is begun, stepped and closed in one thread.

    The reward is 1 for the step at the end of which the outcome is ``docked``, and else 0. The episode is
    truncated where the time limit of the scene is reached, and terminated by every other outcome. There is no
    observation of the end: the last one is given again.

    ``info`` has:

    - ``progress``: the :class:`~msrr_bullet.trial.telemetry.Progress` at the control instant before that of
      the observation, at the end of an episode that of the end: time, phase, number of the attempt, and the
      true pose, of which a reward may make use.
    - ``result``: at the end, the :class:`~msrr_bullet.trial.result.TrialResult`.
    - ``is_success``: at the end, whether the outcome is ``docked``; libraries log the rate under this name.
    - ``seed``: after a reset, the seed of the trial; equal commands in it lead to equal bits.
    - ``idle``: after a reset, the results of trials that were skipped.

    Attributes:
        scene: The scene.
    """

    def __init__(
        self,
        scene: str | Path = "close_range",
        overrides: Mapping[str, object] = MappingProxyType({}),
    ) -> None:
        """Load a scene.

        Args:
            scene: Name of a shipped scene, or path of a scene file.
            overrides: Dotted keys and their values, as of :func:`~msrr_scenes.loading.load.load_scene`.

        Raises:
            SceneError: The scene is unusable, a docking controller is chosen, or a base station leads several
                units of the scene at a time.
            UnknownNameError: No shipped scene has this name.
        """
        chosen = next((key for key in overrides if f"{key}.".startswith(f"{_CONTROLLER}.")), None)
        whole = overrides.get("control")
        if isinstance(whole, Mapping) and "docking" in whole:
            chosen = "control"
        if chosen is not None:
            raise SceneError(f"override {chosen}: the agent is the docking controller here; leave this out")
        loaded = load_scene(scene, overrides)
        if loaded.coordinated:
            raise SceneError(
                f"{loaded.name}: a base station leads several units at a time, and there is one agent; "
                "choose a scene with a plan of docks, such as close_range or two_units"
            )
        control = loaded.control.model_copy(update={"docking": Choice(name=AGENT)})
        self.scene = loaded.model_copy(update={"control": control})
        limits, (lowest, highest) = self.scene.limits, zip(*_RANGES, strict=True)
        fastest = np.array([limits.v_close_mps, limits.w_max_radps], dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-fastest, fastest)
        self.observation_space = gymnasium.spaces.Box(
            np.array(lowest, dtype=np.float32), np.array(highest, dtype=np.float32)
        )
        self._episode: _Episode | None = None
        self._leave: Callable[[], None] | None = None
        self._observation: Vector = np.zeros(len(_RANGES), dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Begin a trial and run it until the agent has to act.

        A trial in which there is nothing to do for the agent, such as one in which the port is not found, is
        followed by another one.

        Args:
            seed: Seed of the trial, and of the random numbers that choose the next ones; None goes on with
                these.
            options: With ``{"out": folder}`` the trial is written into a run folder.

        Raises:
            TypeError: The option ``out`` is no path.
            ValueError: There is no such option, it is empty, or the seed is out of range.
            MsrrError: The trial cannot be run, or the agent had nothing to do in 20 trials in a row.
        """
        if not isinstance(options, Mapping | None):
            raise ValueError(f"options are a dictionary; found {options!r:.60}")
        known = dict(options or {})
        out = known.pop("out", None)
        if known:
            raise ValueError(f"unknown option {next(iter(known))!r}; the only one is 'out', a run folder")
        seed = None if seed is None else checked_seed(seed)
        super().reset(seed=seed)
        idle: list[TrialResult] = []
        while len(idle) < _MOST_IDLE:
            if seed is None:
                seed = int(self.np_random.integers(2**31))
            self.close()
            self._episode = _Episode(self.scene, seed, out)
            # A trial refers to itself and would never end where an environment is dropped, not closed.
            self._leave = finalize(self, self._episode.abandon)
            turn = self._episode.go_on()
            if isinstance(turn, ControlInputs):
                self._observation = observation(turn)
                return self._observation.copy(), {
                    "progress": self._episode.progress,
                    "seed": seed,
                    "idle": idle,
                }
            idle.append(turn)
            seed = None
        raise MsrrError(
            f"{self.scene.name}: no docking phase began in {_MOST_IDLE} trials in a row; the last one ended "
            f"as {idle[-1].outcome.value}: {idle[-1].reason}"
        )

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Give the command of this instant, and run the trial until the next one or the end.

        Args:
            action: The command (v, w), shape (2,) [m/s, rad/s].

        Returns:
            Observation, reward, whether the episode has terminated, whether it was truncated, and ``info``.

        Raises:
            ResetNeeded: No trial is under way.
            ValueError: The action is not two finite numbers.
            MsrrError: The trial cannot go on.
        """
        if not self._episode:
            raise gymnasium.error.ResetNeeded("no trial is under way; call reset() first")
        try:
            command = np.asarray(action)
        except (TypeError, ValueError):  # rows of different lengths, or what is no array at all
            command = np.array(None)
        if command.shape != (2,) or command.dtype.kind not in "fiu" or not np.isfinite(command).all():
            raise ValueError(f"an action is two finite numbers, v [m/s] and w [rad/s]; found {action!r}")
        turn = self._episode.go_on(Twist(float(command[0]), float(command[1])))
        info: dict[str, Any] = {"progress": self._episode.progress}
        if isinstance(turn, ControlInputs):
            self._observation = observation(turn)
            return self._observation.copy(), 0.0, False, False, info
        late = turn.outcome is Outcome.TIMEOUT
        info |= {"result": turn, "is_success": turn.docked}
        return self._observation.copy(), float(turn.docked), not late, late, info

    def close(self) -> None:
        """Stop the trial that is under way."""
        if self._leave is not None and self._episode is not None:
            self._episode.check_thread()
            self._leave()
        self._episode = self._leave = None


def observation(inputs: ControlInputs) -> Vector:
    """Return the observation that an agent gets where a controller gets these inputs."""
    arrays = law_inputs(inputs)
    deviations = np.sqrt(np.diagonal(inputs.pose.covariance))
    parts = [arrays.pose, deviations, arrays.edges, arrays.visibility, arrays.twist, arrays.age]
    return np.hstack(parts).astype(np.float32)


gymnasium.register("msrr_bullet/Docking-v0", entry_point="msrr_bullet.gym:DockingEnv")
