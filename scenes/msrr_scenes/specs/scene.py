"""A scene: everything that, together with a seed, determines a trial."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from pydantic import Field, PrivateAttr, model_validator

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.measured_markers import with_markers
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import UnitGeometry, find_urdf, read_unit
from msrr_scenes.html import html_table
from msrr_scenes.specs.as_built import GRADES, AsBuiltSpec, Grade, graded_odometry, graded_optics
from msrr_scenes.specs.bodies import MAX_UNITS, TAGS_PER_UNIT, ArenaSpec, ObstacleSpec, TagsSpec, UnitSpec
from msrr_scenes.specs.control import ControlSpec, DockingSpec, JudgeSpec, LosSpec, Perception, Plant
from msrr_scenes.specs.faults import Fault, MarkerHidden
from msrr_scenes.specs.mission import AssembledPair, RadioSpec, Shapes
from msrr_scenes.specs.plan import DockStep, PlanStep, in_order
from msrr_scenes.specs.sensors import (
    CameraSpec,
    CamerasSpec,
    OdometrySpec,
    ParametricSpec,
)
from msrr_scenes.specs.spec import Duration, Name, PoseSpec, Spec, Text, between
from msrr_scenes.specs.vehicle import LimitsSpec, LinkSpec, LockSpec, WheelMotorSpec

AnySpec = TypeVar("AnySpec", bound=Spec)


@dataclass(frozen=True)
class _Origins:
    """The places of the values of a scene, which make it no other scene."""

    places: Mapping[tuple[str | int, ...], str] = field(compare=False)


class Scene(Spec):
    """A validated scene. Build one with :func:`msrr_scenes.load_scene`."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9._-]{0,63}$")]
    """Name of the scene; by default that of its file. It names run folders, so it is no path."""
    description: Text = ""
    """What the scene shows, in words."""
    plant: Plant = "bullet"
    """Plant: ``bullet`` with contact, or ideal unicycles."""
    perception: Perception = "images"
    """Perception: rendered images, or true poses with errors."""
    physics_hz: Annotated[float, between(30.0, 2000.0)] = 240.0
    """Physics ticks per second [Hz].

    At 30 Hz and the usual speed in front of a port a unit moves by half a pin in a tick. Bullet advises
    240 Hz; with ticks below half a millisecond a trial is slower than the robot.
    """
    time_limit_s: Duration = 60.0
    """Time after which a trial ends with the outcome ``timeout`` [s]."""
    arena: ArenaSpec = ArenaSpec()
    """Floor in which all bodies start, and which no unit may leave with its axle."""
    units: dict[Name, UnitSpec] = Field(min_length=1, max_length=MAX_UNITS)
    """Units by name; the tag family has room for 50."""
    obstacles: dict[Name, ObstacleSpec] = Field(default_factory=dict, max_length=100)
    """Obstacles by name; a hundred are more than the usual arena has room for."""
    tags: TagsSpec = TagsSpec()
    """Family and sizes of the tags on the units."""
    cameras: CamerasSpec = CamerasSpec()
    """Overhead and onboard cameras."""
    odometry: OdometrySpec = OdometrySpec()
    """Wheel encoders."""
    parametric: ParametricSpec = ParametricSpec()
    """Errors of perception without pixels."""
    limits: LimitsSpec = Field(default_factory=lambda: LimitsSpec.model_validate({}))
    """Limits of the drive."""
    motors: WheelMotorSpec = WheelMotorSpec()
    """Wheel motors."""
    link: LinkSpec = LinkSpec()
    """Command link to the wheels."""
    lock: LockSpec = LockSpec()
    """Lock and pull test."""
    los: LosSpec = LosSpec()
    """Line-of-sight target and cone."""
    control: ControlSpec = ControlSpec()
    """Laws, estimator and detector."""
    docking: DockingSpec = DockingSpec()
    """Attempts, times and distances of the phase machine."""
    judge: JudgeSpec = JudgeSpec()
    """Criteria of the judge."""
    plan: tuple[PlanStep, ...] = Field(default=(), max_length=MAX_UNITS)
    """Steps in the order in which they are carried out; empty where a shape is given."""
    shape: Shapes = None
    """Shape that the units are to build, wherever it fits, or a list of shapes, each built from the one
    before; a base station leads them."""
    assembled: tuple[AssembledPair, ...] = Field(default=(), max_length=MAX_UNITS)
    """Units that are locked together when the trial begins; a base station leads them."""
    radio: RadioSpec | None = None
    """Radio between the units and a base station that leads them; without a shape, undock or move steps, and
    without this key, every unit is on its own."""
    one_by_one: bool = False
    """Whether a base station lets only one unit move at a time, for comparison."""
    as_built: AsBuiltSpec = AsBuiltSpec()
    """What is not as this scene says: tolerances, which robots may know, and true errors; by its grade alone,
    ``as_built: careful``."""
    faults: tuple[Fault, ...] = Field(default=(), max_length=100)
    """Deliberate faults."""
    source: Path | None = Field(default=None, exclude=True)
    """File that the scene was read from; set by the program."""

    _origins: _Origins = PrivateAttr(default_factory=lambda: _Origins({}))

    @model_validator(mode="before")
    @classmethod
    def _grade_data_sheets(cls, data: Any) -> Any:
        """Give the sensors the data sheets of the grade of the workmanship, where a scene gives no others."""
        built = data.get("as_built") if isinstance(data, dict) else None
        grade = built.get("grade") if isinstance(built, dict) else built
        if not isinstance(grade, str) or grade not in GRADES:
            return data
        given, odometry = data.get("cameras", {}), data.get("odometry", {})
        optics = graded_optics(cast(Grade, grade))
        if not optics or not isinstance(given, dict) or not isinstance(odometry, dict):
            return data
        cameras = {"onboard": {}, **given}
        for name, camera in cameras.items():
            if isinstance(camera, dict):
                cameras[name] = {**optics, **camera}
        return {**data, "cameras": cameras, "odometry": {**graded_odometry(cast(Grade, grade)), **odometry}}

    @property
    def origins(self) -> Mapping[tuple[str | int, ...], str]:
        """Place of each value that was written: file, line and column, or the option; by the path of keys."""
        return self._origins.places

    def read_from(self, source: Path | None, origins: Mapping[tuple[str | int, ...], str]) -> Scene:
        """Return the scene with its file, and with the places of the values that were written."""
        scene = self.model_copy(update={"source": source})
        scene._origins = _Origins(origins)
        return scene

    @property
    def docks(self) -> tuple[DockStep, ...]:
        """The steps of the plan in which a unit docks."""
        return tuple(step for step in self.plan if isinstance(step, DockStep))

    @property
    def docks_in_order(self) -> tuple[DockStep, ...]:
        """The same steps in the order in which they are carried out, each after those that it names."""
        return tuple(self.docks[index] for index in in_order(self.docks))

    def docks_before(self, step: DockStep) -> list[DockStep]:
        """Return the docks of the plan that are closed when a step of it begins."""
        order = self.docks_in_order
        return list(order[: order.index(step)])

    @property
    def holders(self) -> Mapping[str, str]:
        """Port ``<unit>.<port>`` that each unit is locked to when the trial begins."""
        return {pair.active.partition(".")[0]: pair.passive for pair in self.assembled}

    @property
    def assembled_docks(self) -> tuple[DockStep, ...]:
        """The docks that are closed when the trial begins, each as the step that would have closed it."""
        parts = ((*pair.active.partition("."), pair.passive) for pair in self.assembled)
        return tuple(DockStep(unit=unit, port=port, to=to) for unit, _, port, to in parts)

    @property
    def possible_docks(self) -> tuple[DockStep, ...]:
        """What may dock in a trial; of units that build a shape one of each pair that differs."""
        if self.shape is None:
            return (*self.docks, *self.assembled_docks)
        geometries = {unit: self.geometry(unit) for unit in self.units}
        alike: dict[tuple[UnitGeometry, UnitGeometry], tuple[str, str]] = {}
        for pair in permutations(geometries, 2):
            alike.setdefault((geometries[pair[0]], geometries[pair[1]]), pair)
        return tuple(
            DockStep(unit=unit, to=f"{target}.{port}")
            for (_, geometry), (unit, target) in alike.items()
            for port in geometry.passive_ports
        )

    def told(self) -> Scene:
        """Return the scene as robots and base station are told it: without true errors and without faults.

        Of a global localisation they are told the noise alone, and not when the radio will be silent.
        """
        updates: dict[str, Any] = {"as_built": self.as_built.told(), "faults": ()}
        overhead = self.cameras.overhead
        if overhead is not None:
            told = overhead.model_copy(update={"localisation": overhead.localisation.told()})
            updates["cameras"] = self.cameras.model_copy(update={"overhead": told})
        if self.radio is not None:
            updates["radio"] = self.radio.model_copy(update={"silences": ()})
        return self.model_copy(update=updates)

    def with_camera(self, name: str, spec: CameraSpec) -> Scene:
        """Return the scene with another data sheet of the camera ``onboard`` or ``overhead``."""
        return self.model_copy(update={"cameras": self.cameras.model_copy(update={name: spec})})

    def at_grade(self, grade: Grade) -> Scene:
        """Return the scene at another grade of the workmanship, with its data sheets, without given errors.

        Noise, blur, tone curve, exposure time and scale errors of encoders that are not those of the scene's
        own grade stay.
        """
        cameras = {
            name: _regraded(spec, graded_optics, self.as_built.grade, grade)
            for name, spec in self.cameras
            if isinstance(spec, CameraSpec)
        }
        updates = {
            "as_built": AsBuiltSpec.model_validate(grade),
            "cameras": self.cameras.model_copy(update=cameras),
            "odometry": _regraded(self.odometry, graded_odometry, self.as_built.grade, grade),
        }
        return self.model_copy(update=updates)

    def _repr_html_(self) -> str:
        """Return the scene as a notebook shows it."""
        poses = {name: self.start_pose(name) for name in (*self.units, *self.obstacles)}
        kinds = {name: spec.urdf for name, spec in self.units.items()}
        kinds |= {name: spec.shape for name, spec in self.obstacles.items()}
        bodies = [
            (name, kinds[name], f"({pose.x_m:g}, {pose.y_m:g}) m, {pose.yaw_deg:g} deg in {pose.frame}")
            for name, pose in poses.items()
        ]
        tasks = [(f"step {i}", str(step), "") for i, step in enumerate(self.plan)]
        tasks += [("shape", str(shape), "") for shape in self.shape or ()]
        title = f"{self.name} ({self.plant}, {self.perception}, {self.as_built}): {self.description}"
        return html_table(title, [*bodies, *tasks])

    def start_pose(self, body: str) -> PoseSpec:
        """Return the start pose of a unit or an obstacle: that of an assembled unit is its seat."""
        if body in self.holders:
            return PoseSpec(frame=self.holders[body])
        placed = self.units.get(body) or self.obstacles[body]
        return placed.pose

    def shape_key(self, index: int) -> tuple[str | int, ...]:
        """Return the path of keys to a shape, as the scene file gives one or a list of them."""
        shapes = self.shape or ()
        listed = (index,) if len(shapes) > 1 else ()
        return ("shape", *listed, shapes[index].key)

    @property
    def coordinated(self) -> bool:
        """Whether a base station leads the units."""
        others = any(not isinstance(step, DockStep) for step in self.plan)
        return self.radio is not None or self.shape is not None or bool(self.assembled) or others

    def geometry(self, unit: str) -> UnitGeometry:
        """Return the geometry of a unit: that of its URDF, with its markers where they were measured.

        Raises:
            SceneError: There is no such URDF, or the map of a marker lacks one of its tags.
        """
        drawn, markers = self._drawn(unit), self.units[unit].markers
        anchored = {port: marker for port, marker in markers.items() if marker.dock is None}
        if not anchored:
            return drawn
        ids = self.tag_ids(unit)
        measured = []
        for port, marker in anchored.items():
            slots, anchor = drawn.marker_slots(port), f"port_{port}_marker_{marker.anchor}"
            if anchor not in slots or any(ids[slot] not in marker.map.tags for slot in slots):
                raise SceneError(f"unit {unit!r}: the map of the marker of port {port!r} lacks a tag of it")
            tags = [(slot, marker.map.tags[ids[slot]]) for slot in slots]
            poses = tuple((slot, tag.position_m, tag.quaternion_xyzw) for slot, tag in tags)
            measured.append((anchor, poses))
        return with_markers(drawn, tuple(measured))

    def dock_frame(self, step: DockStep) -> SE2:
        """Return the frame D of the port that a step docks to, in the frame of its target T: ``X_TD``."""
        return self.geometry(step.target_unit).dock_frame(step.target_port)

    def _drawn(self, unit: str) -> UnitGeometry:
        beside, spec = self.source.parent if self.source else None, self.units[unit]
        return read_unit(find_urdf(spec.urdf, beside), spec.frame_map)

    def tag_ids(self, unit: str) -> dict[str, int]:
        """Return the tag id of every tag slot (link name) of a unit."""
        spec, slots = self.units[unit], self._drawn(unit).tag_slots
        mapped = spec.mapped_tag_ids()
        drawn = [slot for slot in slots if slot not in mapped]
        numbered = {slot: TAGS_PER_UNIT * spec.number + i for i, slot in enumerate(drawn)}
        known = {**numbered, **mapped}
        return {**{slot: known[slot] for slot in slots}, **spec.tag_ids}

    @property
    def covered_units(self) -> frozenset[str]:
        """Units whose tags are covered by the fault ``marker_hidden``."""
        return frozenset(fault.unit for fault in self.faults if isinstance(fault, MarkerHidden))

    def tag_size(self, unit: str, slot: str) -> float:
        """Return the edge [m] of the black square of the tag on link ``slot`` of a unit."""
        return self.units[unit].tag_size(slot, self.tags)


def _regraded(
    spec: AnySpec, graded: Callable[[Grade], dict[str, float]], own: Grade, other: Grade
) -> AnySpec:
    """Return a data sheet whose values are those of another grade where they are those of its own.

    Args:
        spec: The data sheet.
        graded: Function that returns the values of a grade; those that it leaves out are the defaults.
        own: Grade that the values are of.
        other: The other grade.
    """
    defaults = {key: type(spec).model_fields[key].default for key in graded("careful")}
    before, after = ({**defaults, **graded(grade)} for grade in (own, other))
    return spec.model_copy(update={k: after[k] for k in defaults if getattr(spec, k) == before[k]})
