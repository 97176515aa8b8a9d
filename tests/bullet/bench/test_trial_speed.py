"""The speed of a trial: the figures agree with each other, and the naive loop does without the savings."""

from __future__ import annotations

import json
import mmap
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_bullet.bench.trial_speed import (
    BenchError,
    calls_per_s,
    measure_trial_speed,
    naive_loop,
    peak_mb,
    trial_speed_table,
)
from msrr_bullet.bench.unit_cost import measure_unit_cost, pair_of
from msrr_bullet.log import CameraWindow, MemoryRecorder
from msrr_bullet.profiler import StageProfiler
from msrr_bullet.sweep.spawned_pool import SpawnedPool
from msrr_bullet.trial.trial import Trial
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice


@pytest.fixture(scope="module")
def scene(shipped: Callable[..., Scene]) -> Scene:
    """The beginning of close_range at one sample a pixel, where the naive loop is cheap enough for a test."""
    loaded = shipped("close_range")
    onboard = loaded.cameras.onboard.model_copy(update={"samples": 1})
    return loaded.model_copy(
        update={"time_limit_s": 0.8, "cameras": loaded.cameras.model_copy(update={"onboard": onboard})}
    )


def test_the_naive_loop_reads_whole_frames_with_a_floor_mesh(scene: Scene) -> None:
    slow = naive_loop(scene)
    onboard = slow.cameras.onboard
    assert onboard.renderer == Choice(name="tiny", params={"floor": "mesh"})
    assert onboard.samples == scene.cameras.onboard.samples
    assert naive_loop(load_scene("close_range"), samples=1).cameras.onboard.samples == 1
    recorder = MemoryRecorder()
    Trial(slow.model_copy(update={"time_limit_s": 0.3}), 3, recorder=recorder).run()
    windows = [m.window for _, _, m in recorder.messages if isinstance(m, CameraWindow)]
    assert len(windows) >= 7  # 25 Hz
    assert set(windows) == {onboard.pinhole.frame}


def test_the_trial_itself_reads_less(scene: Scene) -> None:
    recorder = MemoryRecorder()
    Trial(scene, 3, recorder=recorder).run()
    windows = [m.window for _, _, m in recorder.messages if isinstance(m, CameraWindow)]
    assert sum(w.area for w in windows) < 0.5 * len(windows) * scene.cameras.onboard.pinhole.frame.area


def test_the_figures_of_a_report_agree_with_each_other(scene: Scene) -> None:
    report = measure_trial_speed(scene, seed=3)
    total = 1e3 / report.real_time_factor
    assert sum(report.stages_ms_per_s.values()) == pytest.approx(total)
    assert {"physics", "render", "perception", "control", "clearance", "rest"} <= set(report.stages_ms_per_s)
    assert all(ms >= 0.0 for ms in report.stages_ms_per_s.values())
    assert "collision monitor" not in report.stages_ms_per_s  # without an overhead camera there is none
    assert report.control_step_ms == pytest.approx(report.stages_ms_per_s["control"] / 50.0)
    assert json.loads(report.model_dump_json())["control_step_ms"] == report.control_step_ms
    assert report.times_physics_alone == pytest.approx(total / report.physics_alone_ms_per_s)
    assert report.naive_ratio == report.naive_ratio_one_sample  # the scene has one sample a pixel itself
    assert report.naive_ratio is not None
    assert report.naive_ratio > 1.0
    assert 0.9 < report.units_under_way <= 1.0
    assert 30.0 < report.peak_mb < 4_000.0
    assert json.loads(report.model_dump_json())["naive_ratio"] == report.naive_ratio
    table = trial_speed_table(report)
    assert "as built perfect" in str(table.title)
    assert table.row_count == len(report.stages_ms_per_s) + 10


def test_every_run_of_a_trial_calls_as_many_functions(scene: Scene) -> None:
    """After the first one, in which what a process needs once is set up."""
    _, *later = (calls_per_s(scene, 3) for _ in range(3))
    assert later[0] == later[1]
    assert 1e4 < later[0] < 1e6


def test_what_a_unit_costs_is_measured_where_one_docks_and_all_others_stand_by() -> None:
    scene = load_scene("assemble_tee")
    crowd, pair = (pair_of(scene, parked, 20.0) for parked in (True, False))
    first, *_, last = scene.units
    assert crowd.coordinated
    assert pair.coordinated
    assert (tuple(crowd.units), tuple(pair.units)) == (tuple(scene.units), (first, last))
    assert crowd.plan == pair.plan == (DockStep(unit=first, to=f"{last}.rear"),)

    def ms_per_s(timed: Scene, seed: int) -> float:
        """A start that takes 100 ms, 10 ms a second for each unit, and 20 ms a second for all."""
        assert timed.as_built == scene.as_built  # `two_units` as well: a grade costs time
        return 100.0 / timed.time_limit_s + 20.0 + 10.0 * len(timed.units)

    cost = measure_unit_cost(scene, 0, 82.0, ms_per_s)
    assert cost.parked_ms_per_s == pytest.approx(10.0)
    assert cost.mover_ratio == pytest.approx(82.0 / (100.0 / 90.0 + 40.0))  # two_units may take 90 s


def test_the_guard_is_a_stage_of_its_own(shipped: Callable[..., Scene]) -> None:
    profiler = StageProfiler()
    Trial(shipped("two_units", {"time_limit_s": "0.3"}), 0, profiler=profiler).run()
    assert profiler.spent_ns["collision monitor"] > 0
    assert profiler.spent_ns["control"] > 0


def test_a_scene_without_images_cannot_be_measured(scene: Scene) -> None:
    with pytest.raises(BenchError, match="parametric"):
        measure_trial_speed(scene.model_copy(update={"perception": "parametric"}))


def test_a_trial_in_which_a_class_of_a_user_s_own_fails_is_not_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The figures were those of a unit that stood."""
    (tmp_path / "broken_bench.py").write_text(
        "from msrr_perception.estimation.corner_filter import CornerEkf\n\n\n"
        "class Broken(CornerEkf):\n    def add_odometry(self, reading):\n        raise OSError('no file')\n"
    )
    monkeypatch.chdir(tmp_path)
    broken = load_scene("close_range", {"control.estimator": "broken_bench:Broken"})
    with pytest.raises(BenchError, match=r"program_failed, .* broken_bench\.py line 6: .* no file"):
        measure_trial_speed(broken)


def test_the_memory_of_a_process_is_its_own() -> None:
    """What a parent takes counts for a child that it starts, where the resource usage is asked for."""
    with mmap.mmap(-1, 700_000_000) as taken, SpawnedPool(1) as pool:
        for _ in range(700):
            taken.write(bytes(1_000_000))
        child_mb = pool.submit(peak_mb).result()
        assert peak_mb() > 700.0
    assert 10.0 < child_mb < 500.0
