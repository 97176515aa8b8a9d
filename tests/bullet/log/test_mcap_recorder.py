"""Files of the recorder: repeatable, readable after a crash, with one clear error on a full disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.log import CameraWindow, Event, LogError, LogHeader, read_log, topics
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure
from tests.bullet.log.conftest import record_trial


def test_the_same_messages_give_the_same_file(tmp_path: Path, header: LogHeader) -> None:
    for name in ("one", "two"):
        with McapRecorder(tmp_path / name, header) as recorder:
            record_trial(recorder, 3.0)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    with McapRecorder(tmp_path / "other", header) as recorder:
        record_trial(recorder, 3.0, seed=1)
    assert (tmp_path / "one").read_bytes() != (tmp_path / "other").read_bytes()


def test_a_killed_process_leaves_a_readable_log(tmp_path: Path) -> None:
    code = f"""
import os, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from conftest import LogHeader, McapRecorder, Scene, record_trial
scene = Scene.model_validate({{"name": "x", "units": {{"a": {{"number": 0}}}},
    "plan": [{{"unit": "a", "to": "a.rear"}}]}})
recorder = McapRecorder(Path({str(tmp_path / "t.mcap")!r}), LogHeader.of(scene, 0, {{}}))
record_trial(recorder, 20.0)
[batch.result() for batch in recorder._waiting]
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr.decode()
    log = read_log(tmp_path / "t.mcap")
    last = list(log.records())[-1]
    assert not log.complete
    assert 18.9e9 < last.stamp_ns < 19e9  # the last second is lost


def test_a_full_disk_is_one_error_that_names_the_file(header: LogHeader) -> None:
    threads = set(threading.enumerate())
    with pytest.raises(LogError, match=r"/dev/full: cannot write the log: No space left"):
        McapRecorder(Path("/dev/full"), header)
    assert set(threading.enumerate()) <= threads
    links = (link for link in Path("/proc/self/fd").iterdir() if link.is_symlink())
    assert "/dev/full" not in {os.readlink(link) for link in links}, "there is no recorder to close it"


def test_a_full_disk_raises_while_recording_and_closing_still_works(
    tmp_path: Path, header: LogHeader
) -> None:
    recorder = McapRecorder(tmp_path / "t.mcap", header, flush_every_s=0.1)
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, recorder._file.fileno())
    os.close(full)
    with pytest.raises(LogError, match=r"t\.mcap: cannot write the log: No space left"):
        record_trial(recorder, 60.0)
    with pytest.raises(LogError, match="No space left"):
        recorder.write(topics.EVENTS, 0, Event(0, "trial", "on"))
    recorder.close()
    assert recorder._file.closed


def test_a_log_that_is_closed_between_the_windows_of_a_frame_is_complete(
    tmp_path: Path, header: LogHeader
) -> None:
    """Ctrl-C, or the limit on the wall clock, ends a trial anywhere."""
    recorder = McapRecorder(tmp_path / "t.mcap", header)
    exposure, window = Exposure("a/onboard", 0, 0), Window(3, 5, 60, 40)
    recorder.write(topics.exposure("a/onboard"), 0, exposure)
    recorder.window(exposure, window, np.full((40, 60), 7, dtype=np.uint8))
    recorder.close()
    log = read_log(tmp_path / "t.mcap")
    assert log.complete
    ((_, logged),) = log.messages(CameraWindow)
    assert logged.window == window
    assert np.all(logged.pixels == 7)


def test_a_log_that_is_closed_when_python_ends_is_complete(tmp_path: Path, header: LogHeader) -> None:
    """Python lets the worker finish before it closes an environment that its user did not close."""
    recorder = McapRecorder(tmp_path / "t.mcap", header)
    record_trial(recorder, 0.5)
    recorder._worker.shutdown()
    recorder.close()
    with McapRecorder(tmp_path / "other", header) as other:
        record_trial(other, 0.5)
    assert read_log(tmp_path / "t.mcap").complete
    assert (tmp_path / "t.mcap").read_bytes() == (tmp_path / "other").read_bytes()


def test_a_missing_folder_is_refused(tmp_path: Path, header: LogHeader) -> None:
    with pytest.raises(LogError, match=r"gone/t\.mcap: cannot write the log: No such file"):
        McapRecorder(tmp_path / "gone" / "t.mcap", header)


def test_a_closed_log_refuses_messages(tmp_path: Path, header: LogHeader) -> None:
    recorder = McapRecorder(tmp_path / "t.mcap", header)
    recorder.close()
    recorder.close()
    with pytest.raises(LogError, match="closed"):
        recorder.write(topics.EVENTS, 0, Event(0, "trial", "on"))
