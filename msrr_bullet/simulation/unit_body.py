"""A unit as a PyBullet body, and the loading of its URDF."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.built_urdf import build
from msrr_bullet.simulation.urdf_welding import weld, write_welded
from msrr_scenes.as_built import BuiltUnit
from msrr_scenes.errors import GeometryError, UnknownNameError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry, read_unit
from msrr_scenes.geometry.wheels import WHEEL_LINKS
from msrr_scenes.temporary_files import room_for_temporary_files

#: Link index by which PyBullet names a body's root link.
ROOT = -1


@dataclass(frozen=True, eq=False)
class UnitBody:
    """A unit in the world.

    Attributes:
        body: Body id of PyBullet.
        links: Index of every link that remains after welding (:mod:`msrr_bullet.simulation.urdf_welding`);
            that of the root link is :data:`ROOT`.
        geometry: Geometry of the URDF, with the true frames of the tags.
        X_IU: Pose of frame U in the inertial frame of the root, whose pose PyBullet calls the base pose.
        wheels: Indices of the joints of the left and the right wheel.
    """

    body: int
    links: Mapping[str, int]
    geometry: UnitGeometry
    X_IU: SE3
    wheels: tuple[int, int]

    @cached_property
    def origin(self) -> tuple[float, float, float]:
        """Origin of U in the inertial frame of the root [m]."""
        x, y, z = self.X_IU.p.tolist()
        return x, y, z

    @cached_property
    def forward(self) -> tuple[float, float, float]:
        """Axis x of U in the inertial frame of the root."""
        x, y, z = self.X_IU.R[:, 0].tolist()
        return x, y, z

    def link(self, name: str) -> int:
        """Return the index of a link; an unknown name lists the links."""
        try:
            return self.links[name]
        except KeyError:
            raise UnknownNameError("link", name, self.links) from None


def load_unit(
    client: int, geometry: UnitGeometry, welded: Path | None = None, built: BuiltUnit | None = None
) -> UnitBody:
    """Load a unit at the origin of the world.

    ``welded`` is a copy of the URDF by :mod:`msrr_bullet.simulation.urdf_welding`; None makes a temporary
    one. ``built`` is what is not as designed, which ``welded`` has been given already; None if all is.

    Raises:
        GeometryError: PyBullet cannot load the URDF.
    """
    body = _weld_and_load(geometry, client, built) if welded is None else _load(welded, client, geometry.urdf)
    root = pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()
    links = {root: ROOT}
    for joint in range(pybullet.getNumJoints(body, physicsClientId=client)):
        about = pybullet.getJointInfo(body, joint, physicsClientId=client)
        links[about[12].decode()] = joint
        if about[2] != pybullet.JOINT_FIXED and about[12].decode() not in WHEEL_LINKS:
            # PyBullet brakes every joint. Wheels have motors of their own; the wheel of a caster has none.
            pybullet.setJointMotorControl2(
                body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
            )
    info = pybullet.getDynamicsInfo(body, ROOT, physicsClientId=client)
    X_RI = SE3.from_quaternion_xyzw(info[3], info[4])
    X_IU = X_RI.inverse() @ geometry.frame(root).inverse()
    true = geometry if built is None else built.geometry
    return UnitBody(body, links, true, X_IU, (links[WHEEL_LINKS[0]], links[WHEEL_LINKS[1]]))


@room_for_temporary_files()
def _weld_and_load(geometry: UnitGeometry, client: int, built: BuiltUnit | None) -> int:
    tree = geometry.tree()
    if built is not None:
        build(tree, read_unit(geometry.urdf, geometry.frame_map), built)
    weld(tree, geometry.pins)
    with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
        path = Path(folder) / geometry.urdf.name
        write_welded(tree, path)
        return _load(path, client, geometry.urdf)


def _load(urdf: Path, client: int, drawn: Path) -> int:
    # Without the second flag cylinders are prisms of 32 sides, and larger by a margin of 1 mm.
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER
    try:
        body: int = pybullet.loadURDF(str(urdf), useFixedBase=False, flags=flags, physicsClientId=client)
    except pybullet.error as error:
        raise GeometryError(f"{drawn}: PyBullet cannot load this URDF ({error})") from None
    return body
