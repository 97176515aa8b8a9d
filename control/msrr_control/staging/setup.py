"""The fixed facts of the long-distance phase of a docking step, and their check."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from msrr_control.planning.free_space import Bounds, Disc
from msrr_control.planning.route import ARENA_BORDER, ArenaMap
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ArenaEstimate, GlobalPose, ObstacleEstimate
from msrr_scenes.specs.bodies import ArenaSpec
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LimitsSpec

#: Error of the distance between two bodies for which the margins of the routes have room [m]: robots that are
#: built with care know it to 10 to 13 mm (two standard deviations).
_EXPECTED_ERROR_M = 0.015


@dataclass(frozen=True, slots=True)
class AssemblySetup:
    """The fixed facts of one way, from the units' geometry, the scene and the plan.

    Attributes:
        unit: Name of the unit that drives.
        target: Name of the unit it docks to; None if it drives without a target.
        offset: l, distance of the active port's face ahead of the axle [m].
        half_width: Half the width of the docking unit [m].
        X_TD: Dock frame of the target port in the target's frame U; None without a target.
        unit_radius: Radius of the circle about every unit's footprint, by name [m].
        obstacle_radius: Radius of the circle about every obstacle's footprint, by name [m].
        arena: Bounds of the arena.
        in_view: Bounds of the positions at which the overhead camera sees the whole top tag of the unit
            (x low, x high, y low, y high) [m]; None without an overhead camera or a top tag.
        limits: What the drive can do.
        rate_hz: Control rate.
        sigmas: Number of standard deviations by which the collision monitor takes bodies to be nearer.
        approach_m: Smallest distance between the faces from which the port is approached: an attempt that
            failed begins again there [m].
        place_sigma: Largest standard deviations of the unit's place in W along x and y [m], by the
            tolerances of the overhead camera.
    """

    unit: str
    target: str | None
    offset: float
    half_width: float
    X_TD: SE2 | None
    unit_radius: Mapping[str, float]
    obstacle_radius: Mapping[str, float]
    arena: ArenaSpec
    in_view: Bounds | None
    limits: LimitsSpec
    rate_hz: float
    sigmas: float
    approach_m: float
    place_sigma: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, scene: Scene, step: DockStep) -> AssemblySetup:
        """Read the facts of a step of the plan from the scene and the units' URDFs."""
        setup = cls.without_target(scene, step.unit, step.port)
        return replace(setup, target=step.target_unit, X_TD=scene.dock_frame(step))

    @classmethod
    def without_target(cls, scene: Scene, unit: str, port: str) -> AssemblySetup:
        """Read the facts of a unit that drives without a target; ``port`` is its active port."""
        geometry = scene.geometry(unit)
        return cls(
            unit=unit,
            target=None,
            offset=geometry.control_offset(port),
            half_width=float(np.abs(geometry.footprint[:, 1]).max()),
            X_TD=None,
            unit_radius={u: scene.geometry(u).circumradius for u in scene.units},
            obstacle_radius={name: o.radius_m for name, o in scene.obstacles.items()},
            arena=scene.arena,
            in_view=_bounds_in_view(scene, unit),
            limits=scene.limits,
            rate_hz=scene.control.rate_hz,
            sigmas=scene.control.guard.sigmas,
            approach_m=scene.docking.retreat_m,
        )

    @property
    def box(self) -> Bounds:
        """Bounds of the arena as far as the unit is seen there: x low, x high, y low, y high [m]."""
        x0, x1, y0, y1 = (*self.arena.x_m, *self.arena.y_m)
        if self.in_view is None:
            return x0, x1, y0, y1
        u0, u1, v0, v1 = self.in_view
        return max(x0, u0), min(x1, u1), max(y0, v0), min(y1, v1)

    def box_for(self, border_m: float) -> Bounds:
        """Return bounds by which a unit stays in the arena and in view: x low, x high, y low, y high [m].

        Errors of the overhead camera shift where a unit is seen in the arena, and not where it is in the
        picture: only the border of the arena is moved inwards, where the unit's place is known less well than
        routes have room for. Routes keep ``border_m`` from these bounds.
        """
        x, y = (max(self.sigmas * sigma - border_m, 0.0) for sigma in self.place_sigma)
        (x0, x1), (y0, y1) = self.arena.x_m, self.arena.y_m
        u0, u1, v0, v1 = self.box
        return max(u0, x0 + x), min(u1, x1 - x), max(v0, y0 + y), min(v1, y1 - y)

    @property
    def border(self) -> str:
        """What :attr:`box` is, in words."""
        if self.box == (*self.arena.x_m, *self.arena.y_m):
            return ARENA_BORDER
        return "the border of what the overhead camera sees of the arena (cameras.overhead.height_m)"

    def map_of(self, estimate: ArenaEstimate) -> ArenaMap:
        """Return the map in which routes are planned and driven; without a target it leads nowhere.

        Bodies that are badly known are larger there, or the collision monitor would hold the unit on its
        route.
        """
        target, X_WU = estimate.target, estimate.own.X_WB
        units = tuple(
            Disc(unit.name, unit.X_WB.x, unit.X_WB.y, self._radius_in_map(estimate, unit))
            for unit in (target, *estimate.others)
            if unit is not None
        )
        obstacles = tuple(replace(o, radius=self._radius_in_map(estimate, o)) for o in estimate.obstacles)
        X_WD = X_WU if target is None or self.X_TD is None else target.X_WB @ self.X_TD
        return ArenaMap(X_WU, X_WD, units, obstacles)

    def _radius_in_map(self, estimate: ArenaEstimate, body: GlobalPose | ObstacleEstimate) -> float:
        """Return the radius of a body [m], and what it is worse known than the routes have room for."""
        radius = body.radius if isinstance(body, ObstacleEstimate) else self.unit_radius[body.name]
        sigma = estimate.sigma_between(body, self.unit_radius[self.unit], radius)
        return radius + max(self.sigmas * sigma - _EXPECTED_ERROR_M, 0.0)

    def check(self, cruise_mps: float, widest_obstacle_m: float, border_m: float) -> None:
        """Refuse facts that cannot work wherever units and obstacles stand.

        A path has the speed ``cruise_mps``, can lead around obstacles of the radius ``widest_obstacle_m``,
        and keeps the controlled point ``border_m`` from the border of the arena.

        Raises:
            SceneError: The facts cannot work; the message says what would have to change.
        """
        if not self.offset > 0.0:
            raise SceneError(f"the active port has to lie ahead of the axle; its offset is {self.offset} m")
        if cruise_mps > 0.75 * self.limits.v_max_mps:
            raise SceneError(
                f"control.assembly.params.pace.cruise_mps: {cruise_mps:g} leaves nothing to catch up with; "
                f"at most three quarters of limits.v_max_mps, {0.75 * self.limits.v_max_mps:g}"
            )
        for name, radius in self.obstacle_radius.items():
            if radius > widest_obstacle_m:
                raise SceneError(
                    f"obstacles.{name}: its radius is {radius:.2f} m about its footprint; paths lead around "
                    f"circles of at most {widest_obstacle_m:.2f} m. Make it of several smaller obstacles"
                )
        x0, x1, y0, y1 = self.box
        if min(x1 - x0, y1 - y0) < 2.0 * (border_m + self.half_width):
            raise SceneError(
                f"arena: as far as the overhead camera sees the top tag of {self.unit!r}, it is "
                f"{x1 - x0:.2f} m by {y1 - y0:.2f} m; a unit that keeps {border_m:.2f} m from its border "
                "cannot move in it. Enlarge the arena, or raise cameras.overhead.height_m"
            )


def _bounds_in_view(scene: Scene, unit: str) -> Bounds | None:
    """Return where the axle of a unit may be so that its top tag, white border included, is in view."""
    camera, geometry = scene.cameras.overhead, scene.geometry(unit)
    if camera is None or "tag_top" not in geometry.tag_slots:
        return None
    p_UT = geometry.frame("tag_top").p
    # The plate is larger than the tag, and it may be turned in any direction.
    ratio = scene.tags.tag_family.plate_ratio
    reach = math.hypot(p_UT[0], p_UT[1]) + ratio * math.sqrt(0.5) * scene.tag_size(unit, "tag_top")
    lens, ideal = camera.lens, camera.pinhole
    per_pixel = (camera.height_m - float(p_UT[2])) / ideal.focal
    left, right, top, bottom = lens.inner_bounds  # image right is x of the world, image down is -y
    return (
        camera.x_m + per_pixel * (left - ideal.cx) + reach,
        camera.x_m + per_pixel * (right - ideal.cx) - reach,
        camera.y_m - per_pixel * (bottom - ideal.cy) + reach,
        camera.y_m - per_pixel * (top - ideal.cy) - reach,
    )
