"""Mass and inertia of links, and of links that are one body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from xml.etree.ElementTree import Element

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.urdf_tree import LinkTree, one_number, urdf_origin

#: Attributes of an ``<inertia>``: the upper triangle of the matrix, row by row.
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True, eq=False)
class Inertial:
    """What an ``<inertial>`` of a URDF says, in the frame of a link.

    Attributes:
        mass: Mass [kg].
        centre: Centre of mass, shape (3,) [m].
        inertia: Inertia about the centre of mass, shape (3, 3) [kg m^2].
    """

    mass: float
    centre: Array
    inertia: Array

    @classmethod
    def of(cls, inertial: Element | None) -> Inertial:
        """Read an ``<inertial>``; None has no mass.

        Raises:
            GeometryError: A value in it is no number.
        """
        if inertial is None:
            return cls(0.0, np.zeros(3), np.zeros((3, 3)))
        X_LI = urdf_origin(inertial.find("origin"))
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        m = 0.0 if mass is None else one_number(mass, "value")
        xx, xy, xz, yy, yz, zz = (0.0 if inertia is None else one_number(inertia, name) for name in INERTIA)
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return cls(m, X_LI.p, X_LI.R @ J @ X_LI.R.T)

    @property
    def moments(self) -> Array:
        """Principal moments of inertia, ascending, shape (3,) [kg m^2]."""
        moments: Array = np.asarray(np.linalg.eigvalsh(self.inertia), dtype=np.float64)
        return moments

    def in_frame(self, X_CL: SE3) -> Inertial:
        """Return the mass expressed in frame C, given that it is expressed in frame L."""
        return Inertial(self.mass, X_CL.act(self.centre), X_CL.R @ self.inertia @ X_CL.R.T)

    def inertia_about(self, point: Array) -> Array:
        """Return the inertia (3, 3) about another point, by the parallel axis theorem."""
        d = self.centre - point
        shifted: Array = self.inertia + self.mass * (d @ d * np.eye(3) - np.outer(d, d))
        return shifted

    def __add__(self, other: Inertial) -> Inertial:
        """Return mass, centre and inertia of two bodies that are one."""
        mass = self.mass + other.mass
        if mass == 0.0:
            return self
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        return Inertial(mass, centre, self.inertia_about(centre) + other.inertia_about(centre))


@lru_cache(maxsize=32)
def whole_inertial(tree: LinkTree) -> Inertial:
    """Return mass, centre and inertia of all links of a unit as one body, in U."""
    whole = Inertial.of(None)
    for name, link in tree.links.items():
        whole += Inertial.of(link.find("inertial")).in_frame(tree.frames[name])
    return whole
