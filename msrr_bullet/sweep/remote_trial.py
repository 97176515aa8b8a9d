"""A trial in another process, which may run other code than the program that asked for it."""

from __future__ import annotations

import logging
import socket
from collections.abc import Mapping

from msrr_bullet.sensors.preparation import prepare_cameras
from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.worker_pool import TrialFunction
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.errors import ChangedFileError, MsrrError
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.specs.scene import Scene

_log = logging.getLogger(__name__)

#: Fingerprints of the code for which this process is ready.
_PREPARED: set[str] = set()


class OtherCodeError(MsrrError):
    """The code of a worker is not that of the program which started the trials."""


def remote_trial(trial: TrialFunction, codes: Mapping[str, str], scene: Scene, seed: int) -> TrialResult:
    """Run a trial, if the code here is that of whoever asks for it.

    ``codes`` are the fingerprints of the code that has to run, by hash of the scene.

    Raises:
        OtherCodeError: The code here is another one.
    """
    code = codes.get(scene_hash(scene))  # none where a file that the scene names is another one
    if code is None or code_fingerprint(scene, imported=True) != code:
        raise OtherCodeError(
            f"the worker on {socket.gethostname()} has another version of msrr-bullet, of a package, or of a "
            "class or file that the scene names; install there what is installed here, and start the workers "
            "again"
        )
    _prepare(code, scene)
    return trial(scene, seed)


def local_trial(trial: TrialFunction, codes: Mapping[str, str], scene: Scene, seed: int) -> TrialResult:
    """Run a trial in a process that was spawned for it, if the code is still that of when trials began.

    A process that is spawned later, as one before it died, imports what is there then. Arguments are those of
    :func:`remote_trial`.

    Raises:
        ChangedFileError: A file was written meanwhile.
    """
    code = codes.get(scene_hash(scene))
    if code is None or code_fingerprint(scene, imported=True) != code:
        raise ChangedFileError(
            f"{scene.name}, seed {seed}: a file of the scene, of a class that it names, or of msrr-bullet "
            "was written while the trials ran. Results from before are kept; start again, from a copy of the "
            "project that nobody edits"
        )
    return trial(scene, seed)


def _prepare(code: str, scene: Scene) -> None:
    """Make this process ready as a worker of a pool is: one thread, simulator and kernels loaded."""
    if code not in _PREPARED:
        import cv2

        cv2.setNumThreads(1)
        prepare_cameras(scene, _log.info)
        _PREPARED.add(code)
