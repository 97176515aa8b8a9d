"""A run as tables: complete, documented, repeatable, exact to the bit."""

from __future__ import annotations

import csv
import math
import re
import shutil
from collections import Counter

import numpy as np
import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from msrr_bullet.export import ExportError, documented_tables, write_csv
from msrr_bullet.export.csv_files import TABLES
from msrr_bullet.log import LOG_NAME, LogError, read_log
from msrr_bullet.log.formats import message_types
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.records import CameraWindow, FrameLinks
from msrr_bullet.run_folder import RunFolderError
from msrr_scenes.messages import Action, Detections, LosStatus, ObstacleEstimate, PoseEstimate
from msrr_scenes.messages.coordination import Authority, MissionStatus


@pytest.fixture(scope="module")
def folder(short_log, tmp_path_factory):
    path = tmp_path_factory.mktemp("csv")
    write_csv(short_log, path)
    return path


@pytest.fixture(scope="module")
def mission_folder(line_log, tmp_path_factory):
    path = tmp_path_factory.mktemp("mission_csv")
    write_csv(line_log, path)
    return path


def rows(folder, name):
    with (folder / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_message_has_a_table():
    """Obstacles are rows of the table of situations, and the scene holds the frames that never move."""
    assert {table.kind for table in TABLES} == set(message_types()) - {FrameLinks, ObstacleEstimate}
    names = [name for name, _, _ in documented_tables()]
    assert len(names) == len(set(names))


def test_every_message_has_its_rows(short_log, folder):
    counts = Counter(record.kind for record in short_log.records())
    for table in TABLES:
        path = folder / f"{table.name}.csv"
        if table.name in ("situation", "paths", "starts", "detections"):  # several rows each
            assert len(rows(folder, table.name)) > counts[table.kind]
        elif counts[table.kind]:
            assert len(rows(folder, table.name)) == counts[table.kind], table.name
        else:
            assert not path.exists()
    assert len(rows(folder, "approach")) == counts[Action]


def test_columns_are_the_documented_ones(folder):
    listed = {(row["table"], row["column"]) for row in rows(folder, "columns")}
    for name, _, table_columns in documented_tables():
        path = folder / f"{name}.csv"
        if path.exists():
            head = path.read_text(encoding="utf-8").partition("\n")[0].split(",")
            assert head == [column.name for column in table_columns]
            assert {(name, column) for column in head} <= listed


def test_the_columns_tell_the_frame_of_every_pose(folder):
    """The columns said "position" of the estimates in the dock frame and of the truth in the world alike."""
    listed = rows(folder, "columns")
    poses = {row["table"] for row in listed if row["column"] == "x_m"}
    assert {"starts", "truth", "estimates"} <= poses
    meanings = {row["table"]: row["about"] for row in listed if not row["column"]}
    for table in poses:
        assert ("in the world" in meanings[table]) != ("dock frame" in meanings[table])


def test_the_columns_name_every_word_that_their_cells_have(folder, mission_folder):
    """The reader of ``paths.csv`` was not told of the word that stands in all rows of a mission."""
    words = {"phase", "conviction", "setback", "status", "state", "mission", "mode", "position", "shape"}
    seen = set()
    for where in (folder, mission_folder):
        abouts = {(row["table"], row["column"]): row["about"] for row in rows(where, "columns")}
        for (table, column), about in abouts.items():
            if column in words:
                values = {row[column] for row in rows(where, table)} - {""}
                assert values <= set(re.findall(r"\w+", about)), (table, column)
                seen |= {column} if values else set()
    assert seen >= words - {"setback"}


def test_numbers_read_back_to_the_bit(short_log, folder):
    actions = [m for _, m in short_log.messages(Action, "/control/*")]
    table = rows(folder, "decisions")
    assert [(float(r["v_mps"]), float(r["w_radps"])) for r in table] == [
        (a.twist.v, a.twist.w) for a in actions
    ]
    assert [r["phase"] for r in table] == [a.phase.value for a in actions]
    estimates = [m for _, m in short_log.messages(PoseEstimate, "/perception/*")]
    for row, estimate in zip(rows(folder, "estimates"), estimates, strict=True):
        assert (float(row["x_m"]), float(row["yaw_rad"])) == (estimate.X_DU.x, estimate.X_DU.yaw)
        assert round(float(row["stamp_s"]) * 1e9) == estimate.stamp_ns
        assert float(row["sigma_x_m"]) == math.sqrt(estimate.covariance[0, 0])


def test_windows_and_exposures_are_those_of_the_log(short_log, folder):
    windows = [m for _, m in short_log.messages(CameraWindow, "/camera/*")]
    table = rows(folder, "windows")
    assert [(r["camera"], int(r["width_px"])) for r in table] == [
        (w.exposure.camera, w.window.width) for w in windows
    ]


def test_the_deviation_of_each_corner_stands_beside_it(short_log, folder):
    tags = [tag for _, seen in short_log.messages(Detections, "/perception/*") for tag in seen.tags]
    names = [f"{corner}_sigma_px" for corner in ("bottom_left", "bottom_right", "top_right", "top_left")]
    table = [[row[name] for name in names] for row in rows(folder, "detections")]
    told = [
        [""] * 4 if t.corner_sigma_px is None else [repr(float(s)) for s in t.corner_sigma_px] for t in tags
    ]
    assert table == told
    assert any(row[0] for row in table)


def test_the_table_of_the_approach_holds_truth_and_belief(folder):
    table = [r for r in rows(folder, "approach") if r["phase"] == "dock" and r["believed_gap_m"]]
    gaps = np.array([(float(r["true_gap_m"]), float(r["believed_gap_m"])) for r in table])
    assert len(gaps) > 20
    assert np.abs(gaps[:, 0] - gaps[:, 1]).max() < 0.01
    assert np.ptp(gaps[:, 0]) > 0.01
    assert [(r["true_v_mps"] == "", r["true_w_radps"] == "") for r in rows(folder, "approach")[-2:]] == [
        (False, False),
        (True, True),  # there is no next decision, up to which a velocity would be measured
    ]


def test_an_empty_cell_is_an_unknown_value(folder):
    lost = [r for r in rows(folder, "sight") if r["status"] == LosStatus.LOST.value]
    assert lost
    assert {r["left_rad"] for r in lost if r["left_rad"] == ""} == {""}


def test_the_same_log_gives_the_same_bytes(short_log, folder, tmp_path):
    for path in write_csv(short_log, str(tmp_path)):
        assert path.read_bytes() == (folder / path.name).read_bytes()
        assert b"\r" not in path.read_bytes()


def test_tables_of_an_earlier_run_give_way(folder, blind_run, tmp_path):
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    (tmp_path / "mine.csv").write_text("kept")
    written = write_csv(read_log(blind_run), tmp_path)
    assert {*written, tmp_path / "mine.csv"} == set(tmp_path.iterdir())
    assert not (tmp_path / "windows.csv").exists()


def test_the_command(blind_run, tmp_path, capsys):
    assert run(["export", str(blind_run), "--csv", "--out", str(tmp_path / "tables")]) == 0
    assert (tmp_path / "tables" / "approach.csv").is_file()
    assert run(["export", str(blind_run), "--csv"]) == 0
    assert rows(blind_run / "csv", "pose_measurements")
    assert run(["export", str(blind_run)]) == BAD_INPUT
    assert "--csv" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_refused(short_log, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match=r"file: the folder cannot be made or .* choose another --out"):
        write_csv(short_log, tmp_path / "file")


def test_an_export_that_fails_leaves_the_tables_of_before(short_run, short_log, folder, tmp_path, room):
    """Of a damaged log and on a full disk alike: half of the new tables beside old ones would mislead."""
    shutil.copytree(folder, tmp_path / "csv")
    before = {path: path.read_bytes() for path in (tmp_path / "csv").iterdir()}
    log = bytearray((short_run / LOG_NAME).read_bytes())
    log[len(log) // 2] ^= 0xFF
    (tmp_path / LOG_NAME).write_bytes(log)
    with pytest.raises(LogError, match="the log is damaged"):
        write_csv(read_log(tmp_path), tmp_path / "csv")
    with pytest.raises(ExportError, match="cannot be written"), room(4096):
        write_csv(short_log, tmp_path / "csv")
    assert {path: path.read_bytes() for path in (tmp_path / "csv").iterdir()} == before


def test_a_log_without_a_message_leaves_the_tables_of_before(short_log, folder, tmp_path):
    """It was an export of no table, which deleted those that were there."""
    kept = shutil.copytree(folder, tmp_path / "tables")
    names = {file.name for file in kept.iterdir()}
    with McapRecorder(tmp_path / "empty.mcap", short_log.header):
        pass
    with pytest.raises(ExportError, match=r"empty\.mcap: no message of which a table has a row"):
        write_csv(read_log(tmp_path / "empty.mcap"), kept)
    assert {file.name for file in kept.iterdir()} == names


def test_a_mission_has_its_tables(line_log, mission_folder):
    """What the base station knew, sent and heard; every message by radio that arrived was sent before."""
    statuses = [m for _, m in line_log.messages(MissionStatus)]
    table = rows(mission_folder, "mission")
    assert len(table) == sum(len(status.units) for status in statuses)
    last = {row["unit"]: row for row in table[-3:]}
    assert {row["mission"] for row in last.values()} == {"complete"}
    assert [float(last[u.unit]["progress_m"]) for u in statuses[-1].units] == [
        u.progress for u in statuses[-1].units
    ]
    authorities = [m for _, m in line_log.messages(Authority)]
    assert [float(row["limit_m"]) for row in rows(mission_folder, "authorities")] == [
        m.limit for m in authorities
    ]
    reports = rows(mission_folder, "reports")
    assert {row["mode"] for row in reports} >= {"standing", "driving", "docking", "docked"}
    sent = {("authority", m.unit, str(m.seq), "") for m in authorities}
    sent |= {("report", row["unit"], "", row["time_s"]) for row in reports}
    receipts = [(r["message"], r["unit"], r["number"], r["sent_s"]) for r in rows(mission_folder, "receipts")]
    assert set(receipts) < sent
    assert len(set(receipts)) == len(receipts)
    assert {(row["port"], row["target"].partition(".")[2]) for row in rows(mission_folder, "steps")} == {
        ("front", "rear")
    }
    assert {row["unit"] for row in rows(mission_folder, "global_measurements")} == {"base_station"}
