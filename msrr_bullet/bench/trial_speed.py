"""The speed of a trial, stage by stage, beside that of its physics alone and of a naive loop."""

from __future__ import annotations

import resource
import sys
from contextlib import AbstractContextManager
from cProfile import Profile
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel
from rich.table import Table

from msrr_bullet.bench.physics_alone import note_commands
from msrr_bullet.bench.unit_cost import UnitCost, measure_unit_cost
from msrr_bullet.profiler import NullProfiler, StageProfiler
from msrr_bullet.run import run_trial
from msrr_bullet.trial.check import check_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.versions import package_versions
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.distortion import COEFFICIENTS
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.deviations import CoefficientDeviation
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec
from msrr_scenes.specs.spec import Choice

#: Stage of the robot's decisions: estimator query, laws and phase machine, without the collision monitor.
_CONTROL = "control"

#: Stage in which the simulated world moves.
_PHYSICS = "physics"

#: Name for the time of the loop that belongs to no stage.
_REST = "rest"


class BenchError(MsrrError):
    """A scene whose speed cannot be measured."""


class TrialSpeed(BaseModel, frozen=True):
    """Speed and memory of one trial, log and viewer off, set-up of the world not counted.

    Attributes:
        scene: Name of the scene.
        seed: Seed of the trial.
        as_built: Grade of the workmanship, with the quantities that are not as the grade has them.
        outcome: How the trial ended.
        duration_s: Simulated time, without the pull tests at the end.
        real_time_factor: Simulated time, with the pull tests, over wall-clock time of the loop.
        units_under_way: Number of units that dock or are on their way to a port, on average over the trial.
        naive_ratio: Wall-clock time that the naive loop takes per simulated second, over that of the trial;
            None for a mission of a base station, for which it would take an hour.
        naive_ratio_one_sample: That ratio for a naive loop without anti-aliasing, whose corners are worse;
            None likewise.
        naive_outcome: How the naive trial ended; it sees other windows, so it may end differently; None
            likewise.
        physics_alone_ms_per_s: Wall-clock time of the physics per simulated second in the same world with the
            same commands, and nothing else.
        stages_ms_per_s: Wall-clock time of each stage of the loop per simulated second.
        control_step_ms: Time of one control step: estimator query, laws and phase machine, without the
            collision monitor [ms].
        calls_per_s: Calls of functions from Python, compiled ones too, per simulated second. With the same
            versions of the packages every run has nearly as many, however busy the machine is.
        unit_cost: What one unit costs in a mission of a base station of three and more that begin apart from
            each other; None otherwise.
        start_up_s: Time that the first trial of a process takes longer than the next ones.
        peak_mb: Largest memory of the process before the naive loop began [10^6 bytes].
        versions: Versions of the packages.
    """

    scene: str
    seed: int
    as_built: str
    outcome: Outcome
    duration_s: float
    real_time_factor: float
    units_under_way: float
    naive_ratio: float | None
    naive_ratio_one_sample: float | None
    naive_outcome: Outcome | None
    physics_alone_ms_per_s: float
    stages_ms_per_s: dict[str, float]
    control_step_ms: float
    calls_per_s: float
    unit_cost: UnitCost | None
    start_up_s: float
    peak_mb: float
    versions: dict[str, str]

    @property
    def times_physics_alone(self) -> float:
        """Wall-clock time of the trial over that of its physics alone."""
        return 1e3 / self.real_time_factor / self.physics_alone_ms_per_s

    @property
    def times_own_physics(self) -> float:
        """Wall-clock time of the trial over that of the physics within it.

        The two are measured within the same milliseconds, so that other programs change this ratio by a tenth
        where they double that to the physics alone.
        """
        return 1e3 / self.real_time_factor / self.stages_ms_per_s[_PHYSICS]


@dataclass(frozen=True)
class _Timing:
    """One trial and its wall-clock times, in all [ns] and [ms] per simulated second."""

    result: TrialResult
    span_ns: int
    ms_per_s: float
    stages_ms_per_s: dict[str, float]


def measure_trial_speed(scene: Scene, seed: int = 0, *, naive: bool = True, runs: int = 3) -> TrialSpeed:
    """Measure one trial, its physics alone and its naive loop, one after the other in this process.

    The trial is run once, and then ``runs`` times, of which the fastest counts, as the fastest run of the
    physics alone does, one after each of them. One more run counts the calls of functions. The additional
    time of the first trial (to load compiled code, to compute the faces of the meshes) is spent once in a
    process and reported separately. Without ``naive`` neither the naive loop nor what a unit costs is
    measured. The naive loop of a mission of a base station is left out.

    Memory is that of the process from its start, so it is the trial's own only in a new process.

    Raises:
        BenchError: The scene's perception uses no images.
    """
    if scene.perception != "images":
        raise BenchError(f"{scene.name}: nothing to measure, perception is {scene.perception!r}, not images")
    check_trial(scene)
    profiler = StageProfiler()
    commanded = note_commands(scene, seed, profiler)
    # The fastest of several runs is the one that other processes disturbed least. A machine that is slow for
    # a while is so for the trial and for the physics alone if they take turns.
    turns = [(_run_timed(scene, seed), commanded.replay()[0]) for _ in range(runs)]
    trial = min((run for run, _ in turns), key=lambda run: run.ms_per_s)
    alone_ms_per_s = min(alone for _, alone in turns)
    peak = peak_mb()
    calls = calls_per_s(scene, seed)
    slow = coarse = None
    if naive and not scene.coordinated:
        slow = coarse = _run_timed(naive_loop(scene), seed)
        if scene.cameras.onboard.samples > 1:
            coarse = _run_timed(naive_loop(scene, samples=1), seed)
    result = trial.result
    under_way = sum(step.ended_s - step.started_s for step in result.steps) / result.duration_s
    cost = None
    apart = scene.coordinated and not scene.assembled and len(scene.units) > 2
    if naive and apart and under_way > 0.0:
        cost = measure_unit_cost(scene, seed, trial.ms_per_s / under_way, _ms_per_s)
    return TrialSpeed(
        scene=scene.name,
        seed=seed,
        as_built=result.as_built,
        outcome=result.outcome,
        duration_s=result.duration_s,
        real_time_factor=1e3 / trial.ms_per_s,
        units_under_way=under_way,
        naive_ratio=None if slow is None else slow.ms_per_s / trial.ms_per_s,
        naive_ratio_one_sample=None if coarse is None else coarse.ms_per_s / trial.ms_per_s,
        naive_outcome=None if slow is None else slow.result.outcome,
        physics_alone_ms_per_s=alone_ms_per_s,
        stages_ms_per_s=trial.stages_ms_per_s,
        control_step_ms=trial.stages_ms_per_s.get(_CONTROL, 0.0) / scene.control.rate_hz,
        calls_per_s=calls,
        unit_cost=cost,
        # On a busy machine the second run may take longer.
        start_up_s=max(1e-9 * (profiler.span_ns - trial.span_ns), 0.0),
        peak_mb=peak,
        versions=package_versions(),
    )


def trial_speed_table(report: TrialSpeed) -> Table:
    """Return the report as a table for a terminal."""
    title = f"{report.scene}, seed {report.seed}, as built {report.as_built}: {report.duration_s:.1f} s"
    table = Table(title=title, title_justify="left")
    table.add_column("")
    table.add_column("per simulated second", justify="right")
    for stage, ms in sorted(report.stages_ms_per_s.items(), key=lambda item: -item[1]):
        table.add_row(stage, f"{ms:.1f} ms")
    table.add_section()
    table.add_row("one control step, without the collision monitor", f"{report.control_step_ms:.3f} ms")
    table.add_row("physics alone: the same world and commands", f"{report.physics_alone_ms_per_s:.1f} ms")
    table.add_row("the trial, over physics alone", f"{report.times_physics_alone:.1f}")
    table.add_row("calls of functions", f"{report.calls_per_s:,.0f}")
    table.add_row("real time factor", f"{report.real_time_factor:.1f}")
    table.add_row("units under way, on average", f"{report.units_under_way:.1f}")
    if report.unit_cost is not None:
        table.add_row("a unit under way, over that of two_units", f"{report.unit_cost.mover_ratio:.2f}")
        table.add_row("a unit that stands by", f"{report.unit_cost.parked_ms_per_s:.1f} ms")
    if report.naive_ratio is not None and report.naive_ratio_one_sample is not None:
        table.add_row("times faster than the naive loop", f"{report.naive_ratio:.1f}")
        table.add_row("... than a naive loop with one sample a pixel", f"{report.naive_ratio_one_sample:.1f}")
    table.add_row("start-up, once in a process", f"{report.start_up_s:.1f} s")
    table.add_row("memory at its peak", f"{report.peak_mb:.0f} MB")
    return table


def naive_loop(scene: Scene, samples: int | None = None) -> Scene:
    """Return the scene of the naive loop: a trial without the three things that make perception cheap here.

    It reads full frames only, detects tags in all of them, and the renderer draws the floor as a mesh, with
    ``samples`` samples per pixel edge or, without that, the scene's.
    """

    def plain(camera: CameraSpec) -> dict[str, object]:
        return {
            "renderer": Choice(name="tiny", params={"floor": "mesh"}),
            "readout": "frames",
            "samples": samples or camera.samples,
            "exposure_ms": 0.0,  # TinyRenderer draws one instant only
            "rolling_shutter_ms": 0.0,
        }

    cameras = scene.cameras
    overhead = cameras.overhead
    slow = cameras.model_copy(
        update={
            "onboard": cameras.onboard.model_copy(update=plain(cameras.onboard)),
            "overhead": overhead.model_copy(update=plain(overhead)) if overhead else None,
        }
    )
    lens = {key: CoefficientDeviation() for key in COEFFICIENTS}  # TinyRenderer draws ideal lenses only
    deviations = scene.as_built
    ideal = {group: getattr(deviations, group).model_copy(update=lens) for group in ("onboard", "overhead")}
    return scene.model_copy(update={"cameras": slow, "as_built": deviations.model_copy(update=ideal)})


def _run_timed(scene: Scene, seed: int) -> _Timing:
    profiler = StageProfiler()
    result = run_trial(scene, seed, profiler=profiler)
    per_s = 1.0 / _simulated_s(scene, seed, result)
    stages = {name: 1e-6 * ns * per_s for name, ns in profiler.spent_ns.items()}
    stages[_REST] = 1e-6 * (profiler.span_ns - profiler.total_ns) * per_s
    return _Timing(result, profiler.span_ns, 1e-6 * profiler.span_ns * per_s, stages)


def _simulated_s(scene: Scene, seed: int, result: TrialResult) -> float:
    """Return the simulated time of a trial, with the pull tests [s]."""
    if result.outcome is Outcome.PROGRAM_FAILED:
        raise BenchError(f"{scene.name}, seed {seed}: {result.outcome.value}, {result.reason}")
    if result.duration_s <= 0.0:
        raise BenchError(f"{scene.name}, seed {seed}: ended at once, {result.outcome.value}")
    pulls = sum(step.pull_test_passed is not None for step in result.steps)
    return result.duration_s + pulls * scene.lock.pull_time_s


def calls_per_s(scene: Scene, seed: int) -> float:
    """Return the number of calls of functions in a trial per simulated second; it takes twice the time."""
    counter = _CallCounter()
    try:
        result = run_trial(scene, seed, profiler=counter)
    finally:
        counter.calls.disable()
    return sum(entry.callcount for entry in counter.calls.getstats()) / _simulated_s(scene, seed, result)


class _CallCounter(NullProfiler):
    """A profiler that counts calls of functions from the first stage on."""

    def __init__(self) -> None:
        self.calls = Profile()
        self._counts = False

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        if not self._counts:
            self._counts = True
            self.calls.enable()
        return super().__call__(stage)


def _ms_per_s(scene: Scene, seed: int) -> float:
    return _run_timed(scene, seed).ms_per_s


def peak_mb() -> float:
    """Return the largest memory that this process has taken [10^6 bytes]."""
    if sys.platform == "linux":  # where the resource usage of a process begins with the memory of its parent
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) * 1024e-6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1e-6
