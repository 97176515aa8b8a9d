"""Files of annotated frames: pictures and sheet."""

from __future__ import annotations

import cv2
import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.figures.frames.frame_files import FrameAnnotator, FramesError, write_frames
from msrr_bullet.log import read_log
from msrr_bullet.run_folder import RunFolderError
from msrr_bullet.timeline.camera_views import read_camera_views, read_exposures
from msrr_scenes.messages import NS_PER_S, OVERHEAD


def test_frames_and_their_sheet_are_written(short_log, tmp_path):
    written = write_frames(short_log, tmp_path / "frames", count=2)
    cameras = [path.name.partition("_0")[0] for path in written.frames]
    assert sorted(cameras) == ["a_onboard"] * 2 + ["overhead"] * 2
    sizes = {cv2.imread(str(path)).shape[1] for path in written.frames}
    assert sizes == {1280}
    assert written.sheet.is_file()
    again = write_frames(short_log, tmp_path / "again", count=2)
    for a, b in zip((*written.frames, written.sheet), (*again.frames, again.sheet), strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_pictures_of_an_earlier_run_give_way(short_log, tmp_path):
    kept = {tmp_path / name for name in ("sheet_1.png", "overhead_1.png", "overhead_00001.txt")}
    for path in (*kept, tmp_path / "z_2_onboard_00001.png", tmp_path / "overhead_100000.png"):
        path.write_text("")
    written = write_frames(short_log, tmp_path, count=1)
    assert set(tmp_path.iterdir()) == {*kept, *written.frames, written.sheet}


def test_frames_have_the_requested_interval(short_log, tmp_path):
    written = write_frames(short_log, tmp_path, "overhead", every_s=2.0)
    stamps = {e.frame: e.stamp_ns for e in read_exposures(short_log) if e.camera == OVERHEAD}
    chosen = [stamps[int(path.stem.rpartition("_")[2])] for path in written.frames]
    # The first frame of every 2 s; while the unit docks, the camera above is asked for fewer frames.
    first = {stamp_ns // (2 * NS_PER_S): stamp_ns for stamp_ns in sorted(stamps.values(), reverse=True)}
    assert chosen == sorted(first.values())
    assert [stamp_ns / NS_PER_S for stamp_ns in chosen[:4]] == pytest.approx([0.0, 2.0, 4.0, 6.0], abs=0.11)


def test_tags_of_the_last_frames_had_not_been_reported_when_the_run_ended(short_log):
    """They take 40 ms and more; the frame said that none was found, with the tags in the picture."""
    annotator = FrameAnnotator(short_log)
    views = [v for v in read_camera_views(short_log, read_exposures(short_log)[-30:]) if v.windows]
    assert not views[-1].complete
    assert "tags not reported before the end" in annotator.draw(views[-1]).title[2]
    seen = next(view for view in views if view.tags)
    assert f"{len(seen.tags)} tag" in annotator.draw(seen).title[2]


def test_what_cannot_be_drawn_is_refused(short_log, blind_run, tmp_path, capsys):
    with pytest.raises(FramesError, match="no frame of any camera"):
        write_frames(read_log(blind_run), tmp_path)
    for every_s in (0.0, float("inf"), float("nan")):
        with pytest.raises(FramesError, match="at least one frame, and a finite time above zero"):
            write_frames(short_log, tmp_path, every_s=every_s)
    with pytest.raises(FramesError, match="not both"):
        write_frames(short_log, tmp_path, every_s=1.0, count=8)
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match=r"file: the folder cannot be made or .* choose another --out"):
        write_frames(short_log, tmp_path / "file", count=1)
    assert run(["frames", str(blind_run)]) == BAD_INPUT
    assert "perception is images" in capsys.readouterr().err


def test_the_command_writes_beside_the_log(short_run, capsys):
    assert run(["frames", str(short_run), "--camera", "onboard", "--count", "1"]) == 0
    assert "1 frame," in capsys.readouterr().out.replace("\n", " ")
    assert (short_run / "frames" / "sheet.png").is_file()
