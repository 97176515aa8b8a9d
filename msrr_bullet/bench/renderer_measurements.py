"""Measurements of renderers on the same views: TinyRenderer with one and more samples, and raster.

Time is processor time of this process, so that other programs on the machine disturb the ratios as little as
possible.
"""

from __future__ import annotations

import math
import time

import numpy as np
from pydantic import BaseModel

from msrr_bullet.bench.renderer_scenes import (
    CANDIDATES,
    REFERENCE,
    add_clutter,
    build_candidate,
    build_candidates,
    empty_client,
    facing_units,
    random_view,
)
from msrr_bullet.render import Renderer
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.pose.joint_pose import joint_pose
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import Pixels
from msrr_scenes.random_streams import stream, stream_key

#: Largest difference of a pixel that counts as equal [grey levels].
PIXEL_TOLERANCE = 40

#: Time after which a picture is not drawn again [s].
_PATIENCE_S = 0.3

#: Id and size [m] of the tag whose corners are detected.
_TAG, _TAG_M = 7, 0.05


class CostRow(BaseModel, frozen=True):
    """Time of one picture.

    Attributes:
        view: Camera, window and distance.
        ms: Processor time by renderer [ms].
    """

    view: str
    ms: dict[str, float]

    @property
    def ratio(self) -> float:
        """TinyRenderer's time at one sample per pixel over the raster renderer's."""
        return self.ms["tiny 1x"] / self.ms["raster"]


class CornerRow(BaseModel, frozen=True):
    """Detected against projected tag corners, without noise, over views with any roll.

    Attributes:
        renderer: Label of the renderer.
        found: Views in which the tag was found.
        views: All views.
        bias_px: Mean signed error in x and in y [px].
        rms_px: Root mean square error per coordinate [px].
    """

    renderer: str
    found: int
    views: int
    bias_px: tuple[float, float]
    rms_px: float


class RangeRow(BaseModel, frozen=True):
    """Detection and pose at one distance, with the scene's noise and blur.

    Attributes:
        renderer: Label of the renderer.
        distance_m: Distance between the faces.
        frames: Number of frames.
        detection_rate: Share of the target port's tags that were found.
        lateral_mm: RMS error across the docking axis of the joint pose of one frame [mm]; nan without a pose.
        yaw_deg: RMS error of that pose's heading [deg].
    """

    renderer: str
    distance_m: float
    frames: int
    detection_rate: float
    lateral_mm: float
    yaw_deg: float


class PixelRow(BaseModel, frozen=True):
    """The raster renderer against TinyRenderer at 8 x 8 samples, over scenes of clutter.

    Attributes:
        scenes: Number of scenes.
        pixels: Number of pixels that were compared.
        worst: Largest difference [grey levels].
        off: Pixels that differ by more than :data:`PIXEL_TOLERANCE`.
        mean: Mean absolute difference [grey levels].
    """

    scenes: int
    pixels: int
    worst: int
    off: int
    mean: float


def measure_costs(repeats: int) -> tuple[CostRow, ...]:
    """Time windows and frames of the onboard camera at three distances, and of the overhead camera."""
    rows = []
    for distance in (0.2, 0.4, 0.7):
        with facing_units(SE2(-0.1 - distance, 0.01, 0.02)) as (scene, world):
            camera = scene.cameras.onboard.pinhole
            X_WC = optical_pose(world.link_pose("a", "camera"))
            marker = SE3.from_se2(world.pose("b") @ scene.geometry("b").dock_frame("rear"), 0.14)
            u, v = (round(float(a)) for a in camera.project(X_WC.inverse().act(marker.p)))
            window = Window(u - 64, v - 64, 128, 128)
            for what, view in (("128 x 128 px", window), ("640 x 480 frame", camera.frame)):
                rows.append(
                    CostRow(
                        view=f"onboard, {what}, marker at {distance} m",
                        ms=_times(world.client, camera, X_WC, view, repeats),
                    )
                )
    with facing_units(SE2(-0.8, 0.0, 0.0)) as (_, world):
        camera = PinholeCamera.from_hfov(1280, 960, math.radians(67.0))
        X_WC = SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 3.0]))
        rows.append(
            CostRow(
                view="overhead, 1280 x 960 frame",
                ms=_times(world.client, camera, X_WC, camera.frame, repeats),
            )
        )
    return tuple(rows)


def _times(client: int, camera: PinholeCamera, X_WC: SE3, window: Window, repeats: int) -> dict[str, float]:
    times = {}
    for label, renderer in build_candidates(client).items():
        renderer.render(camera, X_WC, window)  # compiles, reads meshes, allocates memory
        spent: list[float] = []
        while len(spent) < repeats and sum(spent) < _PATIENCE_S:
            # A camera that has not moved may be given the picture that was drawn before.
            X_WC = X_WC @ SE3(np.eye(3), np.array([1e-5, 0.0, 0.0]))
            start = time.process_time()
            renderer.render(camera, X_WC, window)
            spent.append(time.process_time() - start)
        times[label] = 1e3 * min(spent)
    return times


def measure_corners(views: int, seed: int) -> tuple[CornerRow, ...]:
    """Compare detected corners of a tag at 0.15 to 0.6 m, tilted and rolled, with the exact projection."""
    camera = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
    X_WC = SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 2.0]))
    rng = stream(seed, "bench/corners")
    detector = PupilDetector()
    with empty_client() as (client, folder):
        body = load_tag_plate(client, folder, _TAG, _TAG_M, SE3())
        renderers = build_candidates(client)
        errors: dict[str, list[np.ndarray]] = {label: [] for label in renderers}
        for _ in range(views):
            z = rng.uniform(0.15, 0.6)
            X_CT = SE3.from_xyz_rpy(
                [*(z * rng.uniform(-0.4, 0.4, 2)), z],
                [*rng.uniform(-0.7, 0.7, 2), rng.uniform(-math.pi, math.pi)],
            )
            X_WT = X_WC @ X_CT
            pybullet.resetBasePositionAndOrientation(
                body, X_WT.p.tolist(), X_WT.quaternion_xyzw().tolist(), physicsClientId=client
            )
            exact = camera.project(X_CT.act(tag_corners(_TAG_M)))
            window = Window.around(exact, 12)
            for label, renderer in renderers.items():
                found = detector.detect(renderer.render(camera, X_WC, window), window)
                errors[label] += [t.corners - exact for t in found if t.tag_id == _TAG]
    return tuple(_corner_row(label, np.array(e), views) for label, e in errors.items())


def _corner_row(label: str, errors: np.ndarray, views: int) -> CornerRow:
    flat = errors.reshape(-1, 2)
    bias = flat.mean(axis=0) if len(flat) else np.full(2, math.nan)
    return CornerRow(
        renderer=label,
        found=len(errors),
        views=views,
        bias_px=(float(bias[0]), float(bias[1])),
        rms_px=float(np.sqrt((flat**2).mean())) if len(flat) else math.nan,
    )


def measure_poses(distance_m: float, frames: int, seed: int) -> tuple[RangeRow, ...]:
    """Measure detection and pose of the rear port from ``distance_m``, up to 10 % aside and 10 deg askew."""
    rng = stream(seed, f"bench/range/{distance_m}")
    starts = [
        SE2(-0.1 - distance_m, distance_m * rng.uniform(-0.1, 0.1), math.radians(rng.uniform(-10.0, 10.0)))
        for _ in range(frames)
    ]
    with facing_units(starts[0]) as (scene, world):
        target = TargetModel.from_scene(scene, scene.docks[0])
        spec = scene.cameras.onboard
        sensor = ImageNoise(stream_key(seed, "bench/range/noise"), spec.blur_px, spec.noise_grey)
        X_WD = world.pose("b") @ scene.geometry("b").dock_frame("rear")
        renderers = build_candidates(world.client)
        detector = PupilDetector()
        found = dict.fromkeys(renderers, 0)
        errors: dict[str, list[tuple[float, float]]] = {label: [] for label in renderers}
        for frame, X_DU in enumerate(starts):
            world.place("a", X_WD @ X_DU, (0.0, 0.0))
            X_WC = optical_pose(world.link_pose("a", "camera"))
            for label, renderer in renderers.items():
                pixels, window = _exposure(renderer, target, X_DU, X_WC, sensor, frame)
                tags = detector.detect(pixels, window)
                found[label] += len({t.tag_id for t in tags} & set(target.port_tags))
                pose = joint_pose(target, tags)
                if pose is not None:
                    error = X_DU.inverse() @ pose.X_DU
                    errors[label].append((pose.X_DU.y - X_DU.y, error.yaw))
    expected = frames * len(target.port_tags)
    rows = []
    for label in renderers:
        e = np.array(errors[label]).reshape(-1, 2)
        rms = np.sqrt((e**2).mean(axis=0)) if len(e) else np.full(2, math.nan)
        rows.append(
            RangeRow(
                renderer=label,
                distance_m=distance_m,
                frames=frames,
                detection_rate=found[label] / expected,
                lateral_mm=1e3 * float(rms[0]),
                yaw_deg=math.degrees(float(rms[1])),
            )
        )
    return tuple(rows)


def _exposure(
    renderer: Renderer, target: TargetModel, X_DU: SE2, X_WC: SE3, sensor: ImageNoise, frame: int
) -> tuple[Pixels, Window]:
    """Return the part of the frame that holds the target's port, with noise and blur, and its window."""
    X_CD = (SE3.from_se2(X_DU) @ target.X_UC).inverse()
    corners = np.concatenate([target.corners_D[t] for t in target.port_tags])
    around = Window.around(target.camera.project(X_CD.act(corners)), 24)
    window = around.intersection(target.camera.frame) or target.camera.frame
    ideal = renderer.render(target.camera, X_WC, window.padded(sensor.margin))
    return sensor.read_out(ideal, window, frame), window


def compare_pixels(seeds: range) -> PixelRow:
    """Compare the raster renderer with TinyRenderer at 8 x 8 samples, one scene of clutter per seed."""
    camera = PinholeCamera.from_hfov(320, 240, math.radians(75.0))
    differences = []
    for seed in seeds:
        rng = stream(seed, "bench/clutter")
        with empty_client() as (client, folder):
            add_clutter(client, rng, folder)
            X_WC = random_view(rng)
            raster, reference = (
                build_candidate(client, *spec).render(camera, X_WC, camera.frame).astype(np.int16)
                for spec in (CANDIDATES["raster"], REFERENCE)
            )
        differences.append(np.abs(raster - reference))
    d = np.array(differences)
    return PixelRow(
        scenes=len(seeds),
        pixels=d.size,
        worst=int(d.max()),
        off=int((d > PIXEL_TOLERANCE).sum()),
        mean=float(d.mean()),
    )
