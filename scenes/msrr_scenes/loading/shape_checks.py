"""Checks of the shapes of a robot that cameras see, before PyBullet reads them.

PyBullet answers a mesh that it cannot read with lines of its own on the terminal, or ends the process.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.solid import PRIMITIVES, sizes_of
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.geometry.urdf_tree import urdf_origin

#: Endings of the meshes that are drawn.
_MESHES = (".obj", ".stl")


@lru_cache(maxsize=32)
def visual_problems(geometry: UnitGeometry) -> tuple[str, ...]:
    """Return what is wrong with the visual shapes of a unit, in words that name the link."""
    return tuple(_problems(geometry))


def _problems(geometry: UnitGeometry) -> Iterator[str]:
    named = {frame.name: frame.link for frame in geometry.frame_map}
    for link in geometry.tree().getroot().findall("link"):
        name = link.attrib["name"]
        for visual in link.findall("visual"):
            problem = _problem(named.get(name, name), visual)
            if problem is not None:
                yield problem


def _problem(link: str, visual: Element) -> str | None:
    try:
        urdf_origin(visual.find("origin"))
    except GeometryError as error:
        return f"link {link!r}: <visual>: {error}"
    shape = visual.find("geometry/*")
    if shape is None:
        return f"link {link!r}: a <visual> without a shape; remove it"
    if shape.tag == "capsule":
        return None
    if shape.tag not in (*PRIMITIVES, "mesh"):
        return f"link {link!r}: unsupported shape <{shape.tag}>; use {', '.join(PRIMITIVES)} or mesh"
    mesh = Path(shape.get("filename", ""))
    if shape.tag == "mesh" and (mesh.suffix.lower() not in _MESHES or not mesh.is_file()):
        lacks = "convert it" if mesh.is_file() else "there is no such file"
        return f"link {link!r}: a visual mesh is an OBJ or STL file, found {mesh}; {lacks}"
    try:
        sizes_of(link, shape)
    except GeometryError as error:
        return str(error)
    return None
