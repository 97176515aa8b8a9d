"""What an outdoor global localisation gets wrong, put on top of what the overhead camera really sees.

It lives beside the plant because it is part of the simulated world: the robot gets its result and never
learns of it. It needs no truth: a pose in error is a tag in another place of the image, so the corners are
moved.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from msrr_perception.pose.global_pose import FlatTag, fit_se2, rays_to_plane
from msrr_perception.pose.overhead_model import OVERHEAD, OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, TagDetection, seconds
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.sensors import LocalisationErrorSpec


class LocalisationError:
    """Bias, drift, noise and dropout of one trial."""

    def __init__(self, spec: LocalisationErrorSpec, seed: int) -> None:
        """Set up; the drift starts at zero with the first exposure.

        Args:
            spec: How large the errors are.
            seed: The trial's seed; the errors are drawn from the stream ``camera/overhead/localisation``.
        """
        self._spec = spec
        self._rng = stream(seed, f"camera/{OVERHEAD}/localisation")
        self._drift = np.zeros(3)
        self._stamp_ns: int | None = None

    def apply(self, detections: Detections, model: OverheadModel) -> Detections:
        """Return what localisation delivers of an overhead exposure: tags moved, and some left out.

        Exposures have to come in the order of their time. Tags that belong to nobody stay as they are.

        Args:
            detections: What was seen.
            model: Camera, tags, and which unit is the docking one: the one with bias and drift.
        """
        errors, dropped = self._draw(detections.exposure.stamp_ns, model)
        tags = tuple(
            _moved(model, tag, errors[tag.tag_id]) if tag.tag_id in errors else tag
            for tag in detections.tags
            if tag.tag_id not in dropped
        )
        return replace(detections, tags=tags)

    def _draw(self, stamp_ns: int, model: OverheadModel) -> tuple[dict[int, Array], frozenset[int]]:
        """Return the error (x, y, yaw) of every tag's body in W [m, rad], and the tags that drop out."""
        spec = self._spec
        bodies = tuple(sorted(model.tags))
        # The same number of draws per exposure, whatever is seen and however large the errors are.
        walk = self._rng.standard_normal(3)
        noise = self._rng.standard_normal((len(bodies), 3))
        luck = self._rng.random(len(bodies))
        elapsed = 0.0 if self._stamp_ns is None else seconds(stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        drift = np.array([spec.drift_m, spec.drift_m, math.radians(spec.drift_yaw_deg)])
        self._drift += math.sqrt(elapsed) * drift * walk
        bias = np.array([spec.bias_x_m, spec.bias_y_m, math.radians(spec.bias_yaw_deg)])
        sigma = np.array([spec.noise_m, spec.noise_m, math.radians(spec.noise_yaw_deg)])
        errors = dict(zip(bodies, sigma * noise, strict=True))
        own = model.tag_of[model.own]
        errors[own] = errors[own] + bias + self._drift
        lost = luck < spec.dropout
        return errors, frozenset(i for i, gone in zip(bodies, lost, strict=True) if gone)


def _moved(model: OverheadModel, seen: TagDetection, error: Array) -> TagDetection:
    """Return the detection of a body that stands off by ``error`` from where this one was seen."""
    if not error.any():
        return seen
    tag = model.tags[seen.tag_id]
    points, _ = rays_to_plane(model.camera, model.X_WC, seen.corners, tag.height)
    return replace(seen, corners=_pixels(model, tag, points, error))


def _pixels(model: OverheadModel, tag: FlatTag, points_W: Array, error: Array) -> Array:
    X_WB = fit_se2(tag.corners_B[:, :2], points_W)
    X_WE = SE2(*(X_WB.as_array() + error))
    # What the corners are off from the fitted tag goes with them, so that image noise stays in the image.
    p_W = X_WE.act(X_WB.inverse().act(points_W))
    p_W = np.column_stack([p_W, np.full(len(p_W), tag.height)])
    return model.camera.project(model.X_WC.inverse().act(p_W))
