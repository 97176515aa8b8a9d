"""A unit as the physics engine knows it, and how it gets there."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pybullet

from msrr_bullet.simulation.urdf_welding import read_urdf, weld
from msrr_scenes.errors import GeometryError, UnknownNameError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry

#: Link index by which PyBullet names a body's root link.
ROOT = -1


@dataclass(frozen=True, eq=False)
class UnitBody:
    """A unit in the world.

    Attributes:
        body: PyBullet's id.
        links: Index of every link that the engine knows (:mod:`msrr_bullet.simulation.urdf_welding` welds
            most of them); the root link has :data:`ROOT`.
        geometry: Read from the unit's URDF.
        X_IU: Frame U seen from the root's *inertial* frame, which is what PyBullet calls the base pose.
        wheels: Indices of the left and the right wheel's joint.
    """

    body: int
    links: Mapping[str, int]
    geometry: UnitGeometry
    X_IU: SE3
    wheels: tuple[int, int]

    @cached_property
    def origin(self) -> tuple[float, float, float]:
        """Origin of U seen from the root's inertial frame [m]."""
        x, y, z = self.X_IU.p.tolist()
        return x, y, z

    @cached_property
    def forward(self) -> tuple[float, float, float]:
        """Axis x of U seen from the root's inertial frame."""
        x, y, z = self.X_IU.R[:, 0].tolist()
        return x, y, z

    def link(self, name: str) -> int:
        """Return the index of a link; an unknown name lists the ones that exist."""
        try:
            return self.links[name]
        except KeyError:
            raise UnknownNameError("link", name, self.links) from None


def load_unit(client: int, geometry: UnitGeometry, copy: Path | None = None) -> UnitBody:
    """Load a unit into the world's origin.

    Args:
        client: PyBullet client.
        geometry: The unit's, as read from its URDF.
        copy: A welded copy of that URDF (:mod:`msrr_bullet.simulation.urdf_welding`) with looks of its own;
            None for a bare one.

    Raises:
        GeometryError: PyBullet cannot load the URDF.
    """
    body = _load_bare(geometry, client) if copy is None else _load(copy, client)
    root = pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()
    links = {root: ROOT}
    for joint in range(pybullet.getNumJoints(body, physicsClientId=client)):
        links[pybullet.getJointInfo(body, joint, physicsClientId=client)[12].decode()] = joint
    info = pybullet.getDynamicsInfo(body, ROOT, physicsClientId=client)
    X_RI = SE3.from_quaternion_xyzw(info[3], info[4])
    X_IU = X_RI.inverse() @ geometry.frame(root).inverse()
    return UnitBody(body, links, geometry, X_IU, (links["wheel_left"], links["wheel_right"]))


def _load_bare(geometry: UnitGeometry, client: int) -> int:
    tree = read_urdf(geometry.urdf)
    weld(tree, geometry.mechanism)
    with tempfile.TemporaryDirectory(prefix="msrr-") as folder:
        path = Path(folder) / geometry.urdf.name
        tree.write(path, encoding="utf-8", xml_declaration=True)
        return _load(path, client)


def _load(urdf: Path, client: int) -> int:
    try:
        body: int = pybullet.loadURDF(
            str(urdf), useFixedBase=False, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
        )
    except pybullet.error as error:
        raise GeometryError(f"{urdf}: PyBullet cannot load this URDF ({error})") from None
    return body
