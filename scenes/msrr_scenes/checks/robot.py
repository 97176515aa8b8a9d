"""Checks of how a robot is drawn: masses, the sides of pins and holes, and where tags and camera look."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.checks.drive import drive_problems
from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.checks.robot_shapes import joint_problems, shape_problems
from msrr_scenes.checks.standing import standing_problems
from msrr_scenes.checks.tags import covered_tags
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.inertial import Inertial
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.geometry.urdf_tree import LinkTree
from msrr_scenes.specs.scene import Scene

#: Least cosine between the direction that a tag faces and that of its port. At 85 deg a tag is seen at a
#: twelfth of its width, so nothing reads it from in front of the port.
_LEAST_FACING = math.cos(math.radians(85.0))

#: Least cosine between two directions that are meant to be one.
_LEAST_ALONG = math.cos(math.radians(45.0))

#: Rounding of a place that a URDF and a scene give together [m].
_ROUNDING_M = 1e-6

#: Relative rounding of moments of inertia.
_ROUNDING = 1e-9

#: Directions along x, y and z of U, and against them.
_DIRECTIONS = (("forward", "backward"), ("to the left", "to the right"), ("up", "down"))


class _Mistake(NamedTuple):
    """A mistake in the drawing of a robot, and the frame that it is found at; none for all of the URDF."""

    text: str
    frame: str = ""


def robot_problems(scene: Scene, unit: str) -> Iterator[Problem]:
    """Yield mistakes in the drawing of a unit whose geometry can be read."""
    geometry = scene.geometry(unit)
    # Without contact and pixels there is no world in PyBullet, and nothing asks for a mass.
    weighs = scene.plant == "bullet" or scene.perception == "images"
    masses = (_without_mass(geometry) or _impossible_inertia(geometry)) if weighs else ()
    (x0, x1), (y0, y1) = scene.arena.x_m, scene.arena.y_m
    shapes = map(_Mistake, shape_problems(geometry, math.hypot(x1 - x0, y1 - y0))) if weighs else ()
    joints = map(_Mistake, joint_problems(geometry)) if weighs else ()
    found = [*masses, *shapes, *joints, *_passive_ports(geometry)]
    found = found or [_Mistake(*covered) for covered in covered_tags(scene, unit)]
    if scene.plant == "bullet" and not found:
        found += map(_Mistake, (*standing_problems(geometry), *drive_problems(scene, unit)))
    if scene.cameras.overhead is not None:
        found += _top(geometry)
    for port in _docking_ports(scene, unit):
        found += _backward(geometry, port) or [
            *_pins(geometry, port),
            *_camera(geometry, port, scene.cameras.onboard.lens.half_fov),
        ]
    for mistake in found:
        yield Problem(_key(scene, unit, mistake.frame), f"{geometry.urdf.name}: {mistake.text}")


def _docking_ports(scene: Scene, unit: str) -> tuple[str, ...]:
    """Return the active ports by which a unit docks."""
    ports = [dock.port for dock in (*scene.docks, *scene.assembled_docks) if dock.unit == unit]
    return tuple(dict.fromkeys(("front", *ports) if scene.shape is not None else ports))


def _key(scene: Scene, unit: str, frame: str) -> KeyPath:
    """Return the key that says where a frame of a unit is."""
    spec, port = scene.units[unit], frame.removeprefix("port_").partition("_marker_")[0]
    if frame in spec.frames:
        return ("units", unit, "frames", frame)
    if port in spec.markers and "_marker_" in frame:
        return ("units", unit, "markers", port)
    return ("units", unit, "urdf")


@lru_cache(maxsize=32)
def _without_mass(geometry: UnitGeometry) -> tuple[_Mistake, ...]:
    """Find links that PyBullet would make up a mass for, and bodies that it would take to be fixed.

    A link behind a fixed joint is welded to the one that carries it and adds its own mass, or none. One that
    stays apart, as wheels, pins and casters do, would get 1 kg and inertias of 1 kg m^2, and a body whose
    links have no mass together would never move.
    """
    tree = geometry.link_tree
    carried = defaultdict[str, float](float)
    for name, link in tree.links.items():
        carried[_body(tree, name)] += _mass(link)
    missing = [
        name
        for name, link in tree.links.items()
        if carried.get(name, 1.0) <= 0.0
        or ((link.find("collision") is not None or name in geometry.pins) and not _has_inertial(link))
    ]
    if not missing:
        return ()
    text = (
        f"no <inertial> with a mass above 0 and an <inertia>: "
        f"{', '.join(map(geometry.name_in_urdf, missing))}. Every link with a collision shape needs one; "
        "PyBullet would make up 1 kg for a wheel, a caster or a pin"
    )
    return (_Mistake(text),)


@lru_cache(maxsize=32)
def _impossible_inertia(geometry: UnitGeometry) -> tuple[_Mistake, ...]:
    """Find bodies with an inertia that none can have; PyBullet would take it to be zero."""
    tree = geometry.link_tree
    bodies = defaultdict[str, list[str]](list)
    for name in tree.links:
        bodies[_body(tree, name)].append(name)
    for names in bodies.values():
        each: dict[str, Inertial] = {}
        whole = Inertial.of(None)
        for name in names:
            try:
                each[name] = Inertial.of(tree.links[name].find("inertial"))
            except GeometryError as error:
                return (_Mistake(f"link {geometry.name_in_urdf(name)!r}: <inertial>: {error}"),)
            whole += each[name].in_frame(tree.pose(name))
        if whole.mass > 0.0 and not _is_possible(whole):
            # One that is impossible by itself is to blame, or else a body of links that have no inertia.
            wrong = next((n for n in names if each[n].mass > 0.0 and not _is_possible(each[n])), names[0])
            moments = ", ".join(f"{moment:.3g}" for moment in each[wrong].moments)
            return (
                _Mistake(
                    f"link {geometry.name_in_urdf(wrong)!r} has an <inertia> that no body has: its principal "
                    f"moments are {moments} kg m^2. Each of them is above 0, and less than the sum of the "
                    "other two"
                ),
            )
    return ()


def _is_possible(inertial: Inertial) -> bool:
    least, middle, greatest = inertial.moments.tolist()
    return bool(least > 0.0 and greatest < (least + middle) * (1.0 - _ROUNDING))


def _body(tree: LinkTree, name: str) -> str:
    """Return the link at the root of the rigid body that a link is part of."""
    for link in tree.chain(name):
        if link not in tree.joints or tree.joints[link].get("type") != "fixed":
            return link
    raise AssertionError("the root link has no joint")


def _has_inertial(link: Element) -> bool:
    return _mass(link) > 0.0 and link.find("inertial/inertia") is not None


def _mass(link: Element) -> float:
    """Return the mass of a link [kg]; 0 if it is not a number."""
    mass = link.find("inertial/mass")
    try:
        value = 0.0 if mass is None else float(mass.get("value", "0"))
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0


def _passive_ports(geometry: UnitGeometry) -> Iterator[_Mistake]:
    """Find tags that look into the robot or past the port, and holes of which left is right."""
    for port in geometry.passive_ports:
        out = geometry.frame(f"port_{port}").R[:, 0]
        facing = {slot: -geometry.frame(slot).R[:, 2] for slot in geometry.marker_slots(port)}
        turned = [slot for slot, direction in facing.items() if direction @ out < _LEAST_FACING]
        if turned:
            who = f"tag {turned[0]} does" if len(turned) == 1 else f"tags {', '.join(turned)} do"
            yield _Mistake(
                f"{who} not face out of the port, but {_direction(facing[turned[0]])}; x of port_{port} "
                f"points {_direction(out)}. x of a port points out of its face, and z of a tag into the tag: "
                f"seen in port_{port}, a tag that faces out of it has roll_deg: -90, yaw_deg: 90",
                turned[0],
            )
            continue  # a port that is turned has its holes the wrong way round as well
        left, right = (f"port_{port}_hole_{side}" for side in ("left", "right"))
        y = _sides(geometry, SE3.from_se2(geometry.dock_frame(port)), left, right)
        if y is not None and y[0] <= y[1]:
            yield _Mistake(
                f"{left} is at y = {y[0]:.4f} m and {right} at {y[1]:.4f} m in the dock frame of the port: "
                "left is the left of the robot that docks, which looks into the port; swap the two",
                left,
            )


def _backward(geometry: UnitGeometry, port: str) -> list[_Mistake]:
    """Find a port that faces away from the pins and from what the camera looks at: it is turned, not they."""
    X_UP = geometry.frame(f"port_{port}")
    y = _sides(geometry, X_UP, "pin_left", "pin_right")
    if y is None or y[0] > y[1] or geometry.frame("camera").R[:, 0] @ X_UP.R[:, 0] > -_LEAST_ALONG:
        return []
    text = (
        f"port_{port} faces {_direction(X_UP.R[:, 0])}, away from what the camera looks at, and has pin_left "
        "on its right: x of a port points out of its face, so turn it about z by yaw_deg: 180"
    )
    return [_Mistake(text, f"port_{port}")]


def _pins(geometry: UnitGeometry, port: str) -> Iterator[_Mistake]:
    """Find pins of which left is right, pins without a shape, and pins that do not stand out of the face."""
    X_UP = geometry.frame(f"port_{port}")
    y = _sides(geometry, X_UP, "pin_left", "pin_right")
    if y is not None and y[0] <= y[1]:
        yield _Mistake(
            f"pin_left is at y = {y[0]:.4f} m of port_{port} and pin_right at {y[1]:.4f} m; left is the left "
            "of the robot itself, so swap the two",
            "pin_left",
        )
    X_PU = X_UP.inverse()
    for pin in ("pin_left", "pin_right"):
        points = [X_PU.act(solid.points()) for solid in geometry.solids if solid.link == pin]
        if pin in geometry.pins and not points:
            yield _Mistake(f"{pin} has no collision shape; it is its shapes that enter the hole", pin)
        tip = max((float(p[:, 0].max()) for p in points), default=math.inf)
        if tip <= _ROUNDING_M:
            yield _Mistake(
                f"{pin} does not stand out of the face: it ends {1e3 * abs(tip):.1f} mm behind port_{port}. "
                f"port_{port} belongs to the face that the pins stand on, not to their tips",
                f"port_{port}",
            )


def _camera(geometry: UnitGeometry, port: str, half_fov: float) -> Iterator[_Mistake]:
    """Find a camera below the floor, or one that does not have in its image what is straight ahead."""
    X_UC, R_UP = geometry.frame("camera"), geometry.frame(f"port_{port}").R
    axis, height = X_UC.R[:, 0], float(X_UC.p[2])
    if height <= 0.0:
        yield _Mistake(
            f"the camera is {-1e3 * height:.1f} mm below the floor, which it does not see through", "camera"
        )
    x, y, _ = R_UP.T @ axis
    if x > _ROUNDING_M and abs(math.atan2(y, x)) < half_fov:
        return
    yield _Mistake(
        f"the camera looks {_direction(axis)}, and port_{port}, by which this robot docks, faces "
        f"{_direction(R_UP[:, 0])}. Is it the optical frame, with z along the optical axis? The frame camera "
        "has x along that axis, and z up in the image: seen in an optical frame, it has pitch_deg: -90, "
        "yaw_deg: 90",
        "camera",
    )


def _top(geometry: UnitGeometry) -> Iterator[_Mistake]:
    """Find a tag on top that does not face the overhead camera."""
    facing = -geometry.frames["tag_top"].R[:, 2] if "tag_top" in geometry.frames else None
    if facing is not None and facing[2] < _LEAST_FACING:
        yield _Mistake(
            f"tag tag_top does not face up, but {_direction(facing)}. z of a tag points into the tag: in a "
            "link with z up it has roll_deg: 180",
            "tag_top",
        )


def _sides(geometry: UnitGeometry, X_UF: SE3, *links: str) -> tuple[float, ...] | None:
    """Return where the middles of links are to the left of a frame F [m]; None if one is missing."""
    if any(link not in geometry.frames for link in links):
        return None
    X_FU = X_UF.inverse()
    return tuple(float(X_FU.act(_middle(geometry, link))[1]) for link in links)


def _middle(geometry: UnitGeometry, link: str) -> Array:
    """Return the middle of the shapes of a link in U, shape (3,) [m]; its origin if it has none."""
    points = [solid.points() for solid in geometry.solids if solid.link == link]
    return np.concatenate(points).mean(axis=0) if points else geometry.frames[link].p


def _direction(vector: Array) -> str:
    """Return the direction of a vector in U, shape (3,), in words."""
    axis = int(np.abs(vector).argmax())
    return _DIRECTIONS[axis][int(vector[axis] < 0.0)]
