"""Replays a run in this process, in the way that its scene asks for."""

from __future__ import annotations

from pathlib import Path

from msrr_bullet.log.codec import LogError
from msrr_bullet.log.reader import read_log, unpacked
from msrr_bullet.replay.comparison import ReplayError, ReplayReport
from msrr_bullet.replay.coordinated_replayer import CoordinatedReplayer
from msrr_bullet.replay.replayer import PlannedReplayer, RobotFactory, fail_safe_autonomy
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import check_scene
from msrr_scenes.registry import choices, is_import_path

#: Docking controller of a trial of :mod:`msrr_bullet.gym`: its commands are those of an agent.
AGENT = "msrr_bullet.gym:AgentController"


def replay(run: Path, robot: RobotFactory = fail_safe_autonomy, *, trust: bool = False) -> ReplayReport:
    """Replay a run in this process.

    ``robot`` builds the robot of a step of a plan that units carry out on their own. ``trust`` is whether
    classes that the log names by their import paths may be built, which runs their code.

    Raises:
        LogError: The log cannot be read, or its scene contradicts itself.
        ReplayError: The log is not that of a trial, an agent drove in it, or it names a class by import path
            and is not trusted.
    """
    log = read_log(run)
    if log.header.recording is not None:
        raise ReplayError(
            f"{log.path}: the log is of a recording, in which no robot of ours decided; use msrr perceive"
        )
    named = [choice.name for choice in choices(log.header.scene.control) if is_import_path(choice)]
    if AGENT in named:
        raise ReplayError(f"{log.path}: an agent of msrr_bullet.gym drove, and no log holds how it decides")
    if named and not trust:
        raise ReplayError(
            f"{log.path}: the log names {', '.join(named)} by import path, and a replay would run that code; "
            "give --trust if you trust the log and the code"
        )
    with unpacked(log) as files:
        scene = files.header.scene.told()
        try:
            check_scene(scene)  # a trial was run of it, but the log may have been changed since
        except SceneError as error:
            raise LogError(f"{log.path}: {error}") from error
        replayer = (
            CoordinatedReplayer(log, scene) if scene.coordinated else PlannedReplayer(log, scene, robot)
        )
        return replayer.run().model_copy(update={"own_classes": tuple(named)})
