"""The errors of an outdoor global localisation, added to the detections of the overhead camera.

They belong to the simulated world: the robot gets the result and does not learn the errors. An error of a
pose is a tag at another place of the image, so that moving the corners needs no truth.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from msrr_perception.pose.global_pose import FlatTag, fit_se2, rays_to_plane
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import OVERHEAD, Detections, TagDetection, seconds
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.sensors import LocalisationErrorSpec


class LocalisationError:
    """The bias, drift, noise and dropout of the localisation in one trial."""

    def __init__(self, spec: LocalisationErrorSpec, seed: int) -> None:
        """Start with a drift of zero at the first exposure.

        The drift is drawn from the stream ``camera/overhead/localisation``, and noise and dropout of a body
        from a stream with its name behind that, so that the errors of a body do not depend on other bodies.
        """
        self._spec, self._seed = spec, seed
        self._walk = self._stream()
        self._of_body: dict[str, np.random.Generator] = {}
        self._drift = np.zeros(3)
        self._stamp_ns: int | None = None

    def apply(self, detections: Detections, model: OverheadModel, own: str) -> Detections:
        """Return detections of the overhead camera with moved tags, and without those that drop out.

        Exposures have to come in order of time. Tags that belong to no body are not changed. The docking
        unit, ``own``, alone has bias and drift.
        """
        errors, dropped_tags = self._draw(detections.exposure.stamp_ns, model, own)
        tags = tuple(
            _moved(model, tag, errors[tag.tag_id]) if tag.tag_id in errors else tag
            for tag in detections.tags
            if tag.tag_id not in dropped_tags
        )
        return replace(detections, tags=tags)

    def _draw(self, stamp_ns: int, model: OverheadModel, own: str) -> tuple[dict[int, Array], frozenset[int]]:
        """Return the errors (x, y, yaw) in W [m, rad] by tag, each shape (3,), and the tags that drop out."""
        spec = self._spec
        # The number of draws per exposure does not depend on what is detected or how large the errors are.
        walk = self._walk.standard_normal(3)
        elapsed = 0.0 if self._stamp_ns is None else seconds(stamp_ns - self._stamp_ns)
        self._stamp_ns = stamp_ns
        drift = np.array([spec.drift_m, spec.drift_m, math.radians(spec.drift_yaw_deg)])
        self._drift += math.sqrt(elapsed) * drift * walk
        bias = np.array([spec.bias_x_m, spec.bias_y_m, math.radians(spec.bias_yaw_deg)])
        sigma = np.array([spec.noise_m, spec.noise_m, math.radians(spec.noise_yaw_deg)])
        errors, dropped = {}, set()
        for body, tag in model.tag_of.items():
            if body not in self._of_body:
                self._of_body[body] = self._stream(body)
            rng = self._of_body[body]
            noise = sigma * rng.standard_normal(3)
            errors[tag] = noise + bias + self._drift if body == own else noise
            if rng.random() < spec.dropout:
                dropped.add(tag)
        return errors, frozenset(dropped)

    def _stream(self, *body: str) -> np.random.Generator:
        return stream(self._seed, "/".join(("camera", OVERHEAD, "localisation", *body)))


def _moved(model: OverheadModel, detected: TagDetection, error: Array) -> TagDetection:
    """Return the detection of a tag whose body is moved by ``error``, shape (3,), in W [m, rad]."""
    if not error.any():
        return detected
    tag = model.tags[detected.tag_id]
    points = rays_to_plane(model.camera, model.X_WC, detected.corners, tag.height)
    return replace(detected, corners=_pixels(model, tag, points, error))


def _pixels(model: OverheadModel, tag: FlatTag, points_W: Array, error: Array) -> Array:
    X_WB = fit_se2(tag.corners_B[:, :2], points_W)
    X_WE = SE2(*(X_WB.as_array() + error))
    # The residuals of the fitted tag are moved with the corners, so that image noise stays in the image.
    p_W = X_WE.act(X_WB.inverse().act(points_W))
    p_W = np.column_stack([p_W, np.full(len(p_W), tag.height)])
    return model.camera.project(model.X_WC.inverse().act(p_W))
