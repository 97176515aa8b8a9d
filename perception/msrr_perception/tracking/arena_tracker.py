"""Tracks of all bodies that the overhead camera sees, each for itself, by sight alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.tracking.body_track import BodyTrack, Motion, TrackNoise
from msrr_perception.tracking.seen_pose import SeenPose, SeenPoses
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, OVERHEAD, Detections, GlobalPose, ObstacleEstimate
from msrr_scenes.specs.vehicle import LimitsSpec

# The trackers of all units in a mission are given the same measurements. Tracks never change, so that what
# one tracker has computed serves the others.


@lru_cache(maxsize=64)
def _noise(limits: LimitsSpec, clock_s: float) -> TrackNoise:
    """Return the same object for the same values."""
    return TrackNoise(limits, clock_s=clock_s)


@lru_cache(maxsize=256)
def _track_after(track: BodyTrack | None, seen: SeenPose, noise: TrackNoise) -> BodyTrack:
    """Return the track after a measurement, a new one if there was none."""
    return track.after(seen, noise) if track else BodyTrack.at_rest(seen)


@lru_cache(maxsize=256)
def _pose(track: BodyTrack, stamp_ns: int, noise: TrackNoise) -> GlobalPose:
    """Return the pose of a body at an instant."""
    return track.pose(stamp_ns, noise)


class ArenaTracker:
    """Estimates where bodies are and how they move, from what the overhead camera measures.

    Attributes:
        model: Overhead camera and catalogue of tags.
        noise: Assumed motion of the bodies, and the gate for measurements.
    """

    def __init__(self, model: OverheadModel, standing_period_s: float = 0.0) -> None:
        """Create a tracker that knows nothing yet.

        The pose of a body that stands is given anew with period ``standing_period_s``; with 0 whenever it is
        asked for.
        """
        self.model = model
        self.noise = _noise(model.limits, model.errors.clock_s)
        self._standing_period_ns = round(standing_period_s * NS_PER_S)
        self._localizer = model.localizer()
        self._tracks: dict[str, BodyTrack] = {}

    def reset(self) -> None:
        """Forget every body."""
        self._tracks = {}

    def locate(self, message: Detections | GlobalPose) -> SeenPoses:
        """Return what a message of the overhead camera shows.

        Args:
            message: Detections, of which those of other cameras show nothing; or a pose as parametric
                perception measures it, whose random error is drawn anew each time.
        """
        if isinstance(message, GlobalPose):
            return SeenPoses(message.stamp_ns, (self._seen(message, np.zeros((3, 3))),))
        located = self._localizer.locate(message) if message.exposure.camera == OVERHEAD else ()
        seen = (
            self._seen(
                replace(pose, covariance=frozen(pose.covariance + self.model.noise)),
                self._localizer.lasting_share[pose.name] * pose.covariance,
            )
            for pose in located
        )
        return SeenPoses(message.exposure.stamp_ns, tuple(seen))

    def _seen(self, pose: GlobalPose, lasting: Array) -> SeenPose:
        return SeenPose(pose, lasting, self.model.errors_of(pose))

    def add(self, seen: SeenPose) -> None:
        """Add a measured pose."""
        self._tracks[seen.pose.name] = _track_after(self._tracks.get(seen.pose.name), seen, self.noise)

    def knows(self, name: str) -> bool:
        """Return whether a body has been seen."""
        return name in self._tracks

    def poses(self, stamp_ns: int) -> dict[str, GlobalPose]:
        """Return the pose of every body that has been seen, at an instant.

        The pose of a body that stands is as old as its time stamp says: at most the period with which it is
        given anew, and the same object meanwhile.
        """
        period, tracks = self._standing_period_ns, self._tracks.items()
        standing_ns = stamp_ns - stamp_ns % period if period else stamp_ns
        return {
            name: _pose(track, standing_ns if track.motion is Motion.STANDS else stamp_ns, self.noise)
            for name, track in tracks
        }

    def moving(self) -> set[str]:
        """Return the bodies that drive, or were pushed and have not been seen to stand since."""
        return {name for name, track in self._tracks.items() if track.motion is not Motion.STANDS}

    def seen_ns(self, name: str) -> int:
        """Return the time of the exposure in which a body was seen last."""
        return self._tracks[name].seen.pose.stamp_ns

    def seen_at(self, name: str) -> SE2:
        """Return where a body was in the exposure in which it was seen last, as measured."""
        return self._tracks[name].seen.pose.X_WB

    def latest(self, name: str) -> GlobalPose:
        """Return the pose of a body at the time of the exposure in which it was seen last."""
        track = self._tracks[name]
        return track.pose(track.seen.pose.stamp_ns, self.noise)

    def obstacles(self, poses: Mapping[str, GlobalPose]) -> tuple[ObstacleEstimate, ...]:
        """Return the obstacles among ``poses``, which :meth:`poses` has returned."""
        return tuple(
            ObstacleEstimate(name, self.seen_ns(name), body.X_WB, body.covariance, radius, body.shared)
            for name, radius in self.model.obstacle_radius.items()
            if (body := poses.get(name)) is not None
        )
