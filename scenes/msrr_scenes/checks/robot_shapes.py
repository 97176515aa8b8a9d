"""Checks of the shapes of a robot, of their friction and of its joints, before PyBullet reads them.

PyBullet answers a mesh that it cannot read with lines of its own on the terminal, or ends the process.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.mesh_points import mesh_points
from msrr_scenes.geometry.solid import DRAWN_PRIMITIVES, hull_or_line, sizes_of
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.geometry.urdf_tree import one_number, urdf_origin

#: Endings of the meshes that are drawn.
_MESHES = (".obj", ".stl")

#: What a ``<contact>`` of a URDF gives by numbers; PyBullet takes a word to be 0.
_CONTACT = (
    "lateral_friction",
    "rolling_friction",
    "spinning_friction",
    "restitution",
    "stiffness",
    "damping",
    "contact_cfm",
    "contact_erp",
)


#: Types of joints that PyBullet does not load without a ``<limit>``, and what they are meant to be instead.
_LIMITED = {"revolute": "continuous", "prismatic": "fixed"}


@lru_cache(maxsize=32)
def shape_problems(geometry: UnitGeometry, arena_m: float) -> tuple[str, ...]:
    """Return what is wrong with the shapes of a unit, in words that name the link.

    The shapes can be read. No robot larger than ``arena_m``, the distance between opposite corners of the
    arena, can be in it.
    """
    return tuple(_problems(geometry, arena_m))


def _problems(geometry: UnitGeometry, arena_m: float) -> Iterator[str]:
    for link in geometry.link_tree.links.values():
        name = geometry.name_in_urdf(link.attrib["name"])
        for shape in (*link.findall("visual"), *link.findall("collision")):
            problem = _problem(name, shape) if shape.tag == "visual" else None
            problem = problem or _too_large(name, shape, arena_m)
            if problem is not None:
                yield problem
        for part in link.findall("contact/*"):
            problem = _contact_problem(link.attrib["name"], name, part)
            if problem is not None:
                yield problem
    for solid in geometry.solids:
        if solid.mesh is not None and len(hull_or_line(solid.outline())) < 3:
            yield (
                f"link {geometry.name_in_urdf(solid.link)!r}: its collision mesh {solid.mesh.name} is a line "
                "seen from above; give it a thickness, because distances are those of areas on the ground"
            )


def _contact_problem(frame: str, link: str, part: Element) -> str | None:
    if part.tag not in _CONTACT:
        return None
    try:
        value = one_number(part, "value") if "value" in part.attrib else -1.0
    except GeometryError as error:
        return f"link {link!r}: <contact>: {error}"
    if value < 0.0:
        found = part.get("value", "none")
        return f"link {link!r}: <contact>: <{part.tag}> needs a value of 0 or above, found {found}"
    if value == 0.0 and part.tag == "lateral_friction" and frame in ("wheel_left", "wheel_right"):
        return (
            f"link {link!r} is a wheel without friction, so that it slips; give its <lateral_friction> a "
            "value above 0, such as 1"
        )
    return None


def _too_large(link: str, holder: Element, arena_m: float) -> str | None:
    shape = holder.find("geometry/*")
    assert shape is not None, "_problem or read_solid has refused it"
    sizes = sizes_of(link, shape)
    if shape.tag != "mesh":
        # A radius is half of what it spans.
        longest = max(sizes) if shape.tag == "box" else max((2.0 * sizes[0], *sizes[1:]))
        mend = "a URDF is in metres"
    else:
        mesh = Path(shape.attrib["filename"])
        try:
            points = mesh_points(mesh)
        except GeometryError as error:
            return f"link {link!r}: {error}"
        longest = float(np.max(np.ptp(points, axis=0) * np.abs(sizes)))
        mend = (
            f'a mesh drawn in millimetres needs scale="0.001 0.001 0.001", found {shape.get("scale", "none")}'
        )
    if longest <= arena_m:
        return None
    what = shape.get("filename", f"<{shape.tag}>").rpartition("/")[2]
    return (
        f"link {link!r}: the <{holder.tag}> {what} is {longest:.3g} m long, and the whole arena is "
        f"{arena_m:.3g} m across; {mend}"
    )


def _problem(link: str, visual: Element) -> str | None:
    try:
        urdf_origin(visual.find("origin"))
    except GeometryError as error:
        return f"link {link!r}: <visual>: {error}"
    shape = visual.find("geometry/*")
    if shape is None:
        return f"link {link!r}: a <visual> without a shape; remove it"
    if shape.tag not in (*DRAWN_PRIMITIVES, "mesh"):
        return f"link {link!r}: unsupported shape <{shape.tag}>; use {', '.join(DRAWN_PRIMITIVES)} or mesh"
    if shape.tag == "mesh" and not shape.get("filename"):
        return f'link {link!r}: a <mesh> without a file; name one by filename="..."'
    mesh = Path(shape.get("filename", ""))
    if shape.tag == "mesh" and (mesh.suffix.lower() not in _MESHES or not mesh.is_file()):
        lacks = "convert it" if mesh.is_file() else "there is no such file"
        return f"link {link!r}: a visual mesh is an OBJ or binary STL file, found {mesh}; {lacks}"
    try:
        sizes_of(link, shape)
    except GeometryError as error:
        return str(error)
    return None


def joint_problems(geometry: UnitGeometry) -> Iterator[str]:
    """Yield what PyBullet cannot simulate of the joints of a unit, in words that name link and joint."""
    for link, joint in geometry.link_tree.joints.items():
        kind = joint.attrib["type"]
        where = f"link {geometry.name_in_urdf(link)!r}: joint {joint.get('name')!r} is {kind}"
        if kind == "floating":
            yield f"{where}, and PyBullet would hold it fast; make it a fixed one, or remove the link"
        elif kind in _LIMITED and joint.find("limit") is None:
            yield (
                f'{where} and has no <limit>; give it one with lower="..." and upper="...", or make it '
                f"{_LIMITED[kind]}"
            )
