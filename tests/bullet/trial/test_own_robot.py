"""A robot of another maker docks: its URDF is beside the scene, and its links have names of their own."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import count
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
import yaml

from msrr_bullet.replay.log_replay import replay
from msrr_bullet.run import run_trial
from msrr_bullet.sweep.sweep import run_sweep
from msrr_perception.pose.target import TargetModel
from msrr_scenes.errors import ChangedFileError, MsrrError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import LIBRARY, load_scene, scene_hash
from msrr_scenes.outcome import Outcome

SCENE = LIBRARY / "round_robots.yaml"


def own_folder(folder: Path) -> Path:
    """A folder of a user with a scene and its URDF, which is not the working folder."""
    home = folder / "home"
    home.mkdir()
    text = SCENE.read_text()
    (home / "own.yaml").write_text(text.replace("round.urdf\n", "mine.urdf\n"))
    shutil.copy(find_urdf("round.urdf"), home / "mine.urdf")
    return home / "own.yaml"


@pytest.mark.usefixtures("undrawn_runs")
def test_a_robot_beside_its_scene_docks_and_replays_without_it(tmp_path: Path) -> None:
    """On pixels and by contact, near and as designed to be quick; the log has all that a replay needs."""
    quick = {
        "as_built": "perfect",
        "units.a.pose.x_m": "-0.35",
        "units.a.pose.spread": "{y_m: 0.02, yaw_deg: 5}",
    }
    scene, run = load_scene(own_folder(tmp_path), quick), tmp_path / "run"
    assert run_trial(scene, 1, out=run).outcome is Outcome.DOCKED
    shutil.rmtree(tmp_path / "home")
    assert replay(run).identical


BLIND = {"perception": "parametric", "plant": "unicycle", "as_built": "perfect", "time_limit_s": "1"}


def test_a_robot_that_is_edited_while_its_trial_runs_has_no_result(tmp_path: Path) -> None:
    """It had the verdict on the older robot under the hash of the newer one."""
    path = own_folder(tmp_path)
    urdf = path.with_name("mine.urdf")

    def edit(_: object) -> None:
        if "<!-- edited -->" not in urdf.read_text():
            urdf.write_text(urdf.read_text().replace("</robot>", "<!-- edited --></robot>"))

    scene = load_scene(path, BLIND)
    with pytest.raises(ChangedFileError, match="seed 1: while the trial ran, a URDF, mesh or texture was"):
        run_trial(scene, 1, observer=edit)
    assert run_trial(scene, 1).scene_hash == scene_hash(scene)


def test_a_sweep_of_a_robot_that_is_edited_keeps_what_was_run_before(tmp_path: Path) -> None:
    """Its results were lost without a word, and some were in the store as those of the other robot."""
    path, store = own_folder(tmp_path), tmp_path / "store.sqlite"
    urdf, scene, ended, again = path.with_name("mine.urdf"), load_scene(path, BLIND), [], []
    written, submitted = Event(), count(1)

    def edit(result: object, _: bool) -> None:
        ended.append(result)
        if len(ended) == 2:  # as editors write, for a trial may read the file meanwhile
            edited = urdf.with_suffix(".new")
            edited.write_text(urdf.read_text().replace("</robot>", "<!-- edited --></robot>"))
            edited.replace(urdf)
            written.set()

    class ThirdAfterTheEdit(ThreadPoolExecutor):
        """The third trial could end before the results of the first two are told."""

        def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
            if next(submitted) < 3:
                return super().submit(fn, *args, **kwargs)
            return super().submit(lambda: written.wait(60.0) and fn(*args, **kwargs))

    with ThirdAfterTheEdit(1) as waiting, pytest.raises(MsrrError):
        run_sweep(scene, range(3), store=store, executor=waiting, observer=edit)
    with ThreadPoolExecutor(1) as pool:
        assert run_sweep(scene, range(3), store=store, executor=pool).reused == 0
    urdf.write_text(urdf.read_text().replace("<!-- edited -->", ""))
    with ThreadPoolExecutor(1) as pool:
        found = run_sweep(scene, range(3), store=store, executor=pool, observer=lambda r, _: again.append(r))
    assert found.reused == 2
    assert again[:2] == ended[:2]


@pytest.mark.nightly
def test_every_one_of_twenty_docks() -> None:
    """A rate of 0.99 would fail here by chance in 1.7 % of cases; the seeds are fixed."""
    scene = load_scene("round_robots")
    outcomes = [run_trial(scene, seed).outcome for seed in range(20)]
    assert sum(outcome is Outcome.DOCKED for outcome in outcomes) >= 19


def merged(base: Any, extra: Any) -> Any:
    """Return a scene with the keys of a fragment."""
    if not isinstance(base, dict) or not isinstance(extra, dict):
        return extra
    return {**base, **{key: merged(base.get(key), value) for key, value in extra.items()}}


def test_the_page_tells_scenes_that_load(tmp_path: Path) -> None:
    """The first block is a scene; each of the others is put into it, but for the map of a marker."""
    page = (Path(__file__).resolve().parents[3] / "docs" / "how-to" / "own_robot.md").read_text()
    found = re.findall(r'```yaml(?: title="(.*?)")?\n(.*?)```', page, re.DOTALL)
    (tmp_path / "board.yaml").write_text(dict(found)["board.yaml"])
    first, *others = [yaml.safe_load(text) for title, text in found if title != "board.yaml"]
    for block in ({}, *others):
        data = merged(first, block)
        b = data["units"]["b"]
        for key in ("frames", "tag_sizes_m") if "markers" in b else ():
            b[key] = {name: value for name, value in b[key].items() if "_marker_" not in name}
        (tmp_path / "own.yaml").write_text(yaml.safe_dump(data))
        target = TargetModel.from_scene(scene := load_scene(tmp_path / "own.yaml"), scene.docks[0])
        corners = np.concatenate([target.corners_D[tag] for tag in target.port_tags])
        np.testing.assert_allclose(corners.min(axis=0), [0.06, -0.072, 0.16], atol=1e-9)
        np.testing.assert_allclose(corners.max(axis=0), [0.06, 0.072, 0.22], atol=1e-9)
