"""The draw of what was built, for one trial.

Every error has a random stream of its own, named by part and quantity (``as_built/unit/a/onboard/yaw_deg``):
adding an effect, a unit or a tag changes no other draw.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.as_built.as_built import AsBuilt, BuiltCamera, BuiltDrive, BuiltFloor, BuiltTag, BuiltUnit
from msrr_scenes.as_built.covered_tags import covered_tags
from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion, has_inverse
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import onboard_camera
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.as_built import CameraDeviations, MountDeviations
from msrr_scenes.specs.deviations import Deviation, FrictionDeviation
from msrr_scenes.specs.faults import CameraMisaligned
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec
from msrr_scenes.specs.spec import Spec

#: Least friction of a floor that is drawn at random over the nominal one.
LEAST_FRICTION = 0.1

#: Distance between two joints of the floor [m].
JOINT_SPACING_M = 0.5

#: Number of times at most that the lens of one camera, or the places of the tags of one unit, are drawn;
#: errors that are given stay the same.
_MOST_DRAWS = 50

_NS_PER_MS = 1_000_000


class _Draw:
    """Draws errors by name and keeps them."""

    def __init__(self, seed: int) -> None:
        self.errors: dict[str, float] = {}
        self._seed = seed

    def stream(self, name: str) -> np.random.Generator:
        """Return the generator of an error."""
        return stream(self._seed, f"as_built/{name}")

    def error(self, group: Spec, quantity: str, part: str, again: int = 0) -> float:
        """Return the error of a quantity of a part, in its unit: as given, or drawn; 0 if it has none.

        Its name begins with that of the part; ``again`` is the number of draws that could not be built.
        """
        deviation, name = getattr(group, quantity), f"{part}/{quantity}"
        if deviation.error is None and deviation.sigma == 0.0:
            return 0.0
        source = f"{name}/{again}" if again else name
        error: float = self._drawn(deviation, source) if deviation.error is None else deviation.error
        self.errors[name] = error
        return error

    def _drawn(self, deviation: Deviation, name: str) -> float:
        drawn = deviation.sigma * float(self.stream(name).standard_normal())
        if isinstance(deviation, FrictionDeviation):
            return 100.0 * (max(math.exp(-abs(drawn) / 100.0), LEAST_FRICTION) - 1.0)
        return abs(drawn) if deviation.one_sided else drawn

    def scale(self, group: Spec, quantity: str, part: str) -> float:
        """Return true over nominal value of a quantity whose deviation is in percent."""
        return 1.0 + 0.01 * self.error(group, quantity, part)

    def angle(self, group: Spec, quantity: str, part: str, again: int = 0) -> float:
        """Return the error [rad] of a quantity whose deviation is in degrees."""
        return math.radians(self.error(group, quantity, part, again))

    def mount(self, group: MountDeviations, part: str, again: int = 0) -> SE3 | None:
        """Return the pose of a part in the frame where it should be; None if it is there."""
        place = [self.error(group, quantity, part, again) for quantity in ("x_m", "y_m", "z_m")]
        turn = [self.angle(group, quantity, part, again) for quantity in ("roll_deg", "pitch_deg", "yaw_deg")]
        return SE3.from_xyz_rpy(place, turn) if any((*place, *turn)) else None


def draw_as_built(scene: Scene, seed: int) -> AsBuilt:
    """Draw what was built in the trial of a checked scene that has this seed.

    Quantities that the plant of the scene does not have, such as the floor of a unicycle, stay as designed.
    """
    draw = _Draw(seed)
    spec, overhead = scene.as_built, scene.cameras.overhead
    units = {unit: _unit(scene, unit, draw) for unit in scene.units}
    tags = {
        name: _obstacle_tag(scene, name, draw)
        for name, obstacle in scene.obstacles.items()
        if obstacle.tag_id is not None
    }
    return AsBuilt(
        units=MappingProxyType(units),
        overhead=None if overhead is None else _camera(overhead, spec.overhead, "overhead", draw),
        obstacle_tags=MappingProxyType(tags),
        floor=_floor(scene, draw) if scene.plant == "bullet" else BuiltFloor(),
        errors=MappingProxyType(draw.errors),
    )


def as_designed(scene: Scene) -> AsBuilt:
    """Return everything as designed, but for the faults of the scene."""
    return draw_as_built(scene.model_copy(update={"as_built": type(scene.as_built)()}), 0)


def _unit(scene: Scene, unit: str, draw: _Draw) -> BuiltUnit:
    spec, name = scene.as_built, f"unit/{unit}"
    camera = _camera(scene.cameras.onboard, spec.onboard, onboard_camera(name), draw)
    for fault in scene.faults:
        if isinstance(fault, CameraMisaligned) and fault.unit == unit:
            X_BX = SE3.from_se2(SE2(0.0, 0.0, math.radians(fault.yaw_deg)))
            camera = replace(camera, X_BX=X_BX if camera.X_BX is None else X_BX @ camera.X_BX)
    drive, on_drive = spec.drive, f"{name}/drive"
    weighs = scene.plant == "bullet"
    print_scale = draw.scale(spec.tags, "print_percent", f"{name}/tags")
    return BuiltUnit(
        geometry=_with_true_tags(scene, unit, print_scale, draw),
        camera=camera,
        print_scale=print_scale,
        drive=BuiltDrive(
            radius_scale=(
                draw.scale(drive, "radius_left_percent", on_drive),
                draw.scale(drive, "radius_right_percent", on_drive),
            ),
            track_scale=draw.scale(drive, "track_percent", on_drive),
            lag_s=1e-3 * draw.error(drive, "lag_ms", on_drive),
            dead_zone_radps=draw.error(drive, "dead_zone_radps", on_drive),
            backlash_rad=draw.angle(drive, "backlash_deg", on_drive),
        ),
        mass_scale=draw.scale(spec.body, "mass_percent", f"{name}/body") if weighs else 1.0,
        switch_travel_error_m=draw.error(spec.body, "switch_travel_m", f"{name}/body"),
    )


def _with_true_tags(scene: Scene, unit: str, print_scale: float, draw: _Draw) -> UnitGeometry:
    """Draw the places of the tags of a unit: up to 50 times while the plate of one passes through another.

    What passes so as designed does not count.
    """
    drawn = scene.geometry(unit)
    sizes = print_scale * np.array([scene.tag_size(unit, slot) for slot in drawn.tag_slots])

    def covered(geometry: UnitGeometry) -> NDArray[np.bool_]:
        poses = [geometry.frame(slot) for slot in drawn.tag_slots]
        return covered_tags(poses, sizes, scene.tags.tag_family.plate_ratio)

    for again in range(_MOST_DRAWS):
        built = _moved_tags(scene, drawn, f"unit/{unit}", draw, again)
        found = built is not drawn and covered(built)
        if not np.any(found) or not np.any(found & ~covered(drawn)):
            break
    return built


def _moved_tags(scene: Scene, drawn: UnitGeometry, name: str, draw: _Draw, again: int) -> UnitGeometry:
    """Return the geometry with the tags where they are: brackets first, then every tag on its bracket."""
    spec, moved = scene.as_built, dict[str, SE3]()
    for port in drawn.passive_ports:
        X_MX = draw.mount(spec.bracket, f"{name}/bracket/{port}", again)
        if X_MX is None:
            continue
        slots = drawn.marker_slots(port)
        middle = np.mean([drawn.frame(slot).p for slot in slots], axis=0)
        X_UM = SE3(SE3.from_se2(drawn.dock_frame(port)).R, middle)
        X_moved = X_UM @ X_MX @ X_UM.inverse()
        moved |= {slot: X_moved @ drawn.frame(slot) for slot in slots}
    for slot in drawn.tag_slots:
        X_TX = draw.mount(spec.tags, f"{name}/tags/{slot}", again)
        if X_TX is not None:
            moved[slot] = moved.get(slot, drawn.frame(slot)) @ X_TX
    return replace(drawn, frames={**drawn.frames, **moved}) if moved else drawn


def _obstacle_tag(scene: Scene, name: str, draw: _Draw) -> BuiltTag:
    """Return the tag of an obstacle, which lies flat on the lid."""
    spec, part = scene.as_built.tags, f"obstacle/{name}/tag"
    x, y, yaw = (
        draw.error(spec, "x_m", part),
        draw.error(spec, "y_m", part),
        draw.angle(spec, "yaw_deg", part),
    )
    X_TX = SE3.from_se2(SE2(x, y, yaw)) if any((x, y, yaw)) else None
    return BuiltTag(X_TX, draw.scale(spec, "print_percent", part))


def _camera(told: CameraSpec, spec: CameraDeviations, name: str, draw: _Draw) -> BuiltCamera:
    pinhole = told.pinhole
    x, y = pinhole.offset
    pinhole = replace(
        pinhole,
        focal=draw.scale(spec, "focal_percent", name) * pinhole.focal,
        offset=(x + draw.error(spec, "cx_px", name), y + draw.error(spec, "cy_px", name)),
    )
    return BuiltCamera(
        pinhole=pinhole,
        X_BX=draw.mount(spec, name),
        distortion=_distortion(told.distortion, pinhole, spec, name, draw),
        clock_ahead_ns=round(_NS_PER_MS * draw.error(spec, "clock_ms", name)),
        jitter_ns=round(_NS_PER_MS * draw.error(spec, "jitter_ms", name)),
    )


def _distortion(
    told: Distortion, pinhole: PinholeCamera, spec: CameraDeviations, name: str, draw: _Draw
) -> Distortion:
    """Draw the distortion of a lens: up to 50 times while two points of the scene appear at one pixel.

    No lens does that, but of wide ones the coefficients may: at 140 degrees those of one in five. With
    deviations so large that all 50 do, the last one is returned, and refused by what draws through it.
    """
    for again in range(_MOST_DRAWS):
        errors = {key: draw.error(spec, key, name, again) for key in COEFFICIENTS}
        lens = replace(told, **{key: getattr(told, key) + error for key, error in errors.items()})
        if has_inverse(pinhole, lens):
            break
    return lens


def _floor(scene: Scene, draw: _Draw) -> BuiltFloor:
    spec = scene.as_built.floor
    joint = draw.stream("floor/first_joint").uniform(0.0, JOINT_SPACING_M, 2).tolist()
    return BuiltFloor(
        friction_scale=draw.scale(spec, "friction_percent", "floor"),
        slope=(draw.angle(spec, "slope_x_deg", "floor"), draw.angle(spec, "slope_y_deg", "floor")),
        ridge_m=draw.error(spec, "ridge_m", "floor"),
        first_joint=(joint[0], joint[1]),
    )
