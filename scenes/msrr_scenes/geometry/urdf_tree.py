"""The links of a URDF and their poses, with all joints at zero."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3

#: Attributes xyz and rpy of an ``<origin>`` of a URDF; None if there is none.
_Origin = tuple[str, str] | None


def urdf_origin(element: Element | None) -> SE3:
    """Return the pose in an ``<origin>`` of a URDF; the identity for None.

    Raises:
        GeometryError: It has something else than three finite numbers.
    """
    return _pose(_origin(element))


def _origin(element: Element | None) -> _Origin:
    return None if element is None else (element.get("xyz", "0 0 0"), element.get("rpy", "0 0 0"))


# Units are alike, and so are trials: nearly all origins have been read before, and been carried over before.
@lru_cache(maxsize=4096)
def _pose(origin: _Origin) -> SE3:
    if origin is None:
        return SE3()
    xyz, rpy = (
        _floats("origin", key, text, 3, "three numbers")
        for key, text in zip(("xyz", "rpy"), origin, strict=True)
    )
    return SE3.from_xyz_rpy(xyz, rpy)


def xyz_of(element: Element) -> Array:
    """Return the attribute ``xyz`` of an element of a URDF, shape (3,); zeros if it is not there.

    Raises:
        GeometryError: It has something else than three finite numbers.
    """
    return np.array(_floats(element.tag, "xyz", element.get("xyz", "0 0 0"), 3, "three numbers"))


def one_number(element: Element, key: str) -> float:
    """Return the number of an attribute of a URDF; 0 if it is not there.

    Raises:
        GeometryError: It has something else than one finite number.
    """
    return _floats(element.tag, key, element.get(key, "0"), 1, "a number")[0]


def _floats(tag: str, key: str, text: str, count: int, wanted: str) -> list[float]:
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise GeometryError(f"the {key} of <{tag}> has to be {wanted}, found {text!r}")
    return numbers


def set_origin(element: Element, X: SE3) -> None:
    """Set the pose of a joint, a shape or an inertia of a URDF."""
    _put_origin(element, *_written(X))


def carry_over(element: Element, joint: Element) -> None:
    """Express the pose of a joint or a shape of a URDF in the link that carries its own link by ``joint``."""
    _put_origin(element, *_carried(_origin(joint.find("origin")), _origin(element.find("origin"))))


@lru_cache(maxsize=4096)
def _carried(joint: _Origin, part: _Origin) -> tuple[str, str]:
    return _written(_pose(joint) @ _pose(part))


def _written(X: SE3) -> tuple[str, str]:
    xyz, rpy = (" ".join(map(repr, part.tolist())) for part in (X.p, X.rpy()))
    return xyz, rpy


def _put_origin(element: Element, xyz: str, rpy: str) -> None:
    for old in element.findall("origin"):
        element.remove(old)
    element.insert(0, Element("origin", xyz=xyz, rpy=rpy))


class LinkTree:
    """Links of a URDF by name, their poses with all joints at zero, and joints by names of their children."""

    def __init__(self, path: Path, root: Element) -> None:
        """Read the joints.

        Raises:
            GeometryError: A joint lacks a parent or a child, or its origin is malformed.
        """
        self.path = path
        self.links = {e.attrib["name"]: e for e in root.findall("link")}
        self.joints: dict[str, Element] = {}
        self._parent: dict[str, tuple[str, SE3]] = {}
        for joint in root.findall("joint"):
            up, down = joint.find("parent"), joint.find("child")
            if up is None or down is None:
                raise GeometryError(f"{path}: joint {joint.get('name')!r} lacks a parent or a child")
            child = down.attrib["link"]
            self._parent[child] = (up.attrib["link"], urdf_origin(joint.find("origin")))
            self.joints[child] = joint

    def chain(self, name: str) -> list[str]:
        """Return a link and all that carry it, up to the root.

        Raises:
            GeometryError: The links form no tree.
        """
        chain = [name]
        while chain[-1] in self._parent:
            above = self._parent[chain[-1]][0]
            if above in chain or above not in self.links:
                raise GeometryError(f"{self.path}: the links do not form a tree at {above!r}")
            chain.append(above)
        return chain

    def pose(self, name: str) -> SE3:
        """Return the pose of a link in the root link."""
        X = SE3()
        for link in self.chain(name)[:-1]:
            X = self._parent[link][1] @ X
        return X

    @cached_property
    def frames(self) -> dict[str, SE3]:
        """``X_UF`` of every link F, given that there is a link ``axle``."""
        X_AR = self.pose("axle").inverse()
        return {name: X_AR @ self.pose(name) for name in self.links}
