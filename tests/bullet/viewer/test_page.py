"""Readings and data of the page."""

from __future__ import annotations

import json
import re

from msrr_bullet.viewer.readings import READINGS, readings
from msrr_bullet.viewer.replay_page import write_replay


def test_readings_have_the_path_and_no_angles_of_a_lost_target(short_snapshots):
    snapshot = next(s for s in short_snapshots if s.first.assembly and s.stamp_ns >= 3_000_000_000)
    values = dict(zip(READINGS, readings(snapshot), strict=True))
    assert re.fullmatch(r"\d\.\d\d of \d\.\d\d m, \d+ mm off", values["on the path"])
    assert values["line of sight"] == "lost"
    assert values["phase"].startswith("assemble, ")


def test_a_description_cannot_end_the_script_that_holds_it(drive, tmp_path):
    nasty = drive.scene.model_copy(update={"description": "</script><script>alert(1)</script>"})
    text = write_replay(tmp_path / "replay.html", nasty, drive.snapshots[:3]).read_text()
    assert "alert(1)</script>" not in text
    data = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert json.loads(data[1])["description"] == nasty.description
