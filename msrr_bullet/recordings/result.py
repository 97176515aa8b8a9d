"""The figures of a recording: what was seen of the target, and how sure the estimates are."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

from pydantic import BaseModel, Field

from msrr_bullet.recordings.perceiver import PerceivedInstant
from msrr_bullet.trial.versions import trial_versions
from msrr_perception.estimation.calibration_errors import EstimatedCalibrationError
from msrr_scenes.messages import PoseEstimate, seconds
from msrr_scenes.specs.scene import Scene
from msrr_scenes.wording import counted

#: Number of errors of calibration that a message names.
_NAMED = 3

#: Share of the frames with the target that may disagree with the estimate before it is said.
_FEW = 0.05


class Sigma(BaseModel, frozen=True):
    """Standard deviations of an estimate.

    Attributes:
        position_m: Of the position, in its worst direction [m].
        yaw_rad: Of the heading [rad].
    """

    position_m: float
    yaw_rad: float


class LearnedError(BaseModel, frozen=True):
    """What the recording tells of an error of calibration: of the true value minus that of the target file.

    Attributes:
        quantity: Group and name in ``as_built`` of the target file, such as ``onboard.pitch_deg``; it ends in
            the unit of all numbers here.
        tag: Id of the tag whose mount is meant; None for what is no mount of a tag.
        tolerance: Standard deviation by the target file.
        error: What is known of the error.
        sigma: Standard deviation of that.
        deviation: The error over the tolerance.
        contradicts: Whether the tolerance does not allow this error.
    """

    quantity: str
    tag: int | None
    tolerance: float
    error: float
    sigma: float
    deviation: float
    contradicts: bool

    @classmethod
    def of(cls, known: EstimatedCalibrationError) -> LearnedError:
        """Return what a filter knows as a part of a result."""
        return cls(
            quantity=known.quantity.name,
            tag=known.quantity.tag,
            tolerance=known.tolerance,
            error=known.error,
            sigma=known.sigma,
            deviation=known.deviation,
            contradicts=known.contradicts,
        )

    def text(self) -> str:
        """Return it in words."""
        of_tag = "" if self.tag is None else f" of tag {self.tag}"
        known = f"{self.error:+z.3g} ± {self.sigma:.1g}, tolerance {self.tolerance:.3g}"
        return f"{self.quantity}{of_tag} {known}"


class RecordingResult(BaseModel, frozen=True):
    """The result of perception on a recording, in SI units and radians. There is no truth to compare with.

    Attributes:
        recording: What was recorded, in words.
        target: Name of the target.
        odometry: Whether the recording tells how the wheels turned.
        assumptions: What was taken for granted because the recording does not say it.
        start_ns: Time on the clock of the recording that is 0 in the log.
        duration_s: Time from the first to the last instant [s].
        frames: Number of frames.
        unusable: Number of those that could not be read.
        cut_off: Whether it was not read to its end: it is damaged from some point on, or a class of the
            user's own failed there.
        with_target: Number of frames in which tags of the target were found.
        used: Number of frames whose tags agreed with earlier ones and the wheels, or were the first.
        tags: Number of frames in which each tag was found, by id; others than the target's included.
        target_tags: Ids of the tags of the target.
        instants: Number of instants for which estimates were wanted.
        estimates: Number of instants with an estimate.
        line_of_sight: Number of instants by where the line of sight came from.
        median_sigma: Median of the standard deviations of all estimates; None without one.
        last_pose: Last estimate in the dock frame: x, y [m], yaw [rad]; None without one.
        last_sigma: Its standard deviations.
        last_unseen_s: Its time since the last frame that corrected it [s].
        without_odometry: Spans of time [s] with frames and without odometry, though there is some at other
            times: the robot was taken to stand there.
        calibration: What the estimator has learned of the errors of calibration, those first that are the
            farthest beyond their tolerance; empty without an estimate, or with an estimator that learns none.
        versions: Installed versions.
    """

    recording: str
    target: str
    odometry: bool
    assumptions: tuple[str, ...]
    start_ns: int
    duration_s: float
    frames: int
    unusable: int
    cut_off: bool
    with_target: int
    used: int
    tags: dict[int, int]
    target_tags: tuple[int, ...]
    instants: int
    estimates: int
    line_of_sight: dict[str, int]
    median_sigma: Sigma | None
    last_pose: tuple[float, float, float] | None
    last_sigma: Sigma | None
    last_unseen_s: float | None
    without_odometry: tuple[tuple[float, float], ...]
    calibration: tuple[LearnedError, ...]
    versions: dict[str, str] = Field(default_factory=trial_versions)

    def to_json(self) -> str:
        """Return the result as indented JSON."""
        return self.model_dump_json(indent=2) + "\n"

    def warnings(self) -> tuple[str, ...]:
        """Return in words what of the target file, or of the wheels, the recording does not agree with."""
        texts = self._gaps(), self._disagreement(), self._contradiction()
        return tuple(text for text in texts if text is not None)

    def _gaps(self) -> str | None:
        if not self.without_odometry:
            return None
        spans = [f"{start:.1f} to {end:.1f} s" for start, end in self.without_odometry[:_NAMED]]
        more = len(self.without_odometry) - _NAMED
        named = ", ".join([*spans, *([f"{more} more"] if more > 0 else [])])
        return (
            f"no odometry from {named}: the robot was taken to stand there; if it did not, estimates are "
            "wrong by more than they say: leave that part out, or all odometry by --odometry none"
        )

    def _disagreement(self) -> str | None:
        unused = self.with_target - self.used
        if unused <= _FEW * self.with_target:
            return None
        causes = (
            "calibration and flat floor of the target file, and by corners as precise as the detector tells; "
            "a camera that is carried by hand, or is faster than speed_mps and turn_rate_radps of the robot, "
            "does not move so"
        )
        if self.odometry:
            causes = (
                "the wheels of the recording, by calibration and flat floor of the target file, and by "
                "corners as precise as the detector tells; if --odometry none uses these frames, order, sign "
                "or unit of the wheels are wrong"
            )
        what = "tags of the target do not agree with the estimate"
        return f"in {counted(unused, 'frame')} {what}, which goes by {causes}"

    def _contradiction(self) -> str | None:
        wrong = [known for known in self.calibration if known.contradicts]
        if not wrong:
            return None
        named = "; ".join(known.text() for known in wrong[:_NAMED])
        more = f"; and {len(wrong) - _NAMED} more" if len(wrong) > _NAMED else ""
        follow = ". Mend the first one, for the others may follow from it" if len(wrong) > 1 else ""
        if self.odometry and any(known.quantity.startswith("drive.") for known in wrong):
            follow += ". Wheels in the wrong order, or that turn the other way, can look like this"
        return f"the recording contradicts the target file (true minus told value): {named}{more}{follow}"


@dataclass
class Tally:
    """Counts while a recording is read.

    What it counts is as in :class:`RecordingResult`.
    """

    scene: Scene
    target_tags: frozenset[int]
    unusable: int = 0
    cut_off: bool = False
    _read: int = 0
    _with_target: int = 0
    _used: int = 0
    _tags: Counter[int] = field(default_factory=Counter)
    _sights: Counter[str] = field(default_factory=Counter)
    _sigmas: list[Sigma] = field(default_factory=list)
    _last: PoseEstimate | None = None
    _times_ns: list[int] = field(default_factory=list)

    def add(self, instant: PerceivedInstant) -> None:
        """Count an instant."""
        self._times_ns = [*self._times_ns[:1], instant.stamp_ns]
        self._sights[instant.los.status.value] += 1
        if instant.estimate is not None:
            self._last = instant.estimate
            self._sigmas.append(sigma_of(instant.estimate))
        found = instant.arrived
        if found is None:
            return
        self._read += 1
        self._tags.update(tag.tag_id for tag in found.tags)
        if self.target_tags.isdisjoint(tag.tag_id for tag in found.tags):
            return
        self._with_target += 1
        self._used += instant.agrees

    def result(
        self,
        recording: str,
        start_ns: int,
        odometry: bool,
        assumptions: tuple[str, ...],
        learned: tuple[EstimatedCalibrationError, ...],
        without_wheels: Sequence[tuple[int, int]],
    ) -> RecordingResult:
        """Return the figures so far; ``without_wheels`` are spans of time [ns]."""
        last, sigmas = self._last, self._sigmas
        middle = None
        if sigmas:
            middle = Sigma(
                position_m=median(s.position_m for s in sigmas), yaw_rad=median(s.yaw_rad for s in sigmas)
            )
        times = self._times_ns or [0]
        return RecordingResult(
            recording=recording,
            target=self.scene.name,
            odometry=odometry,
            assumptions=assumptions,
            start_ns=start_ns,
            duration_s=seconds(times[-1] - times[0]),
            frames=self._read + self.unusable,
            unusable=self.unusable,
            cut_off=self.cut_off,
            with_target=self._with_target,
            used=self._used,
            tags=dict(sorted(self._tags.items())),
            target_tags=tuple(sorted(self.target_tags)),
            instants=self._sights.total(),
            estimates=len(sigmas),
            line_of_sight=dict(sorted(self._sights.items())),
            median_sigma=middle,
            last_pose=None if last is None else (last.X_DU.x, last.X_DU.y, last.X_DU.yaw),
            last_sigma=None if last is None else sigmas[-1],
            last_unseen_s=None if last is None else seconds(last.stamp_ns - last.last_seen_ns),
            without_odometry=tuple((seconds(start), seconds(end)) for start, end in without_wheels),
            calibration=tuple(
                LearnedError.of(known) for known in sorted(learned, key=lambda e: -abs(e.deviation))
            ),
        )


def sigma_of(estimate: PoseEstimate) -> Sigma:
    """Return the standard deviations of an estimate."""
    (xx, xy, _), (_, yy, _), (_, _, turn) = estimate.covariance.tolist()
    largest = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
    # A variance may be negative by rounding.
    return Sigma(position_m=math.sqrt(max(largest, 0.0)), yaw_rad=math.sqrt(max(turn, 0.0)))
