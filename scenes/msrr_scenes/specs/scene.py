"""A scene: everything that, together with a seed, determines a trial."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from msrr_scenes.geometry.assets import find_urdf
from msrr_scenes.geometry.unit_geometry import UnitGeometry, read_unit
from msrr_scenes.specs.bodies import TAGS_PER_UNIT, ObstacleSpec, UnitSpec
from msrr_scenes.specs.faults import Fault
from msrr_scenes.specs.los_geometry import LosSpec
from msrr_scenes.specs.plan import ControlSpec, DockingSpec, DockStep, JudgeSpec, Perception, Plant
from msrr_scenes.specs.sensors import CamerasSpec, OdometrySpec, ParametricSpec, TagsSpec
from msrr_scenes.specs.spec import Finite, Name, Positive, Spec
from msrr_scenes.specs.vehicle import LimitsSpec, LinkSpec, LockSpec, WheelMotorSpec


class ArenaSpec(Spec):
    """The floor within which everything stays."""

    x_m: tuple[Finite, Finite] = (-2.0, 2.0)
    y_m: tuple[Finite, Finite] = (-1.5, 1.5)


class Scene(Spec):
    """A validated scene. Build one with :func:`msrr_scenes.loading.load.load_scene`."""

    name: str
    description: str = ""
    plant: Plant = "bullet"
    perception: Perception = "images"
    physics_hz: Positive = 240.0
    time_limit_s: Positive = 60.0
    arena: ArenaSpec = ArenaSpec()
    units: dict[Name, UnitSpec] = Field(min_length=1)
    obstacles: dict[Name, ObstacleSpec] = Field(default_factory=dict)
    tags: TagsSpec = TagsSpec()
    cameras: CamerasSpec = CamerasSpec()
    odometry: OdometrySpec = OdometrySpec()
    parametric: ParametricSpec = ParametricSpec()
    limits: LimitsSpec = Field(default_factory=lambda: LimitsSpec.model_validate({}))
    motors: WheelMotorSpec = WheelMotorSpec()
    link: LinkSpec = LinkSpec()
    lock: LockSpec = LockSpec()
    los: LosSpec = LosSpec()
    control: ControlSpec = ControlSpec()
    docking: DockingSpec = DockingSpec()
    judge: JudgeSpec = JudgeSpec()
    plan: tuple[DockStep, ...] = Field(min_length=1)
    faults: tuple[Fault, ...] = ()
    source: Path | None = Field(default=None, exclude=True, description="file the scene was read from")

    def geometry(self, unit: str) -> UnitGeometry:
        """Return the geometry of a unit, read from its URDF."""
        beside = self.source.parent if self.source else None
        return read_unit(find_urdf(self.units[unit].urdf, beside))

    def tag_ids(self, unit: str) -> dict[str, int]:
        """Return the tag id of every tag slot (link name) of a unit."""
        spec = self.units[unit]
        slots = self.geometry(unit).tag_slots
        ids = {slot: TAGS_PER_UNIT * spec.number + i for i, slot in enumerate(slots)}
        return {**ids, **spec.tag_ids}

    def tag_size(self, slot: str) -> float:
        """Return the edge [m] of the black square of the tag on link ``slot``."""
        if slot == "tag_top":
            return self.tags.top_m
        return self.tags.mast_m if slot.endswith("_middle") else self.tags.side_m
