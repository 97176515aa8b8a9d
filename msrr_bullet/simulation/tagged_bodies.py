"""The tags on the units and obstacles of a scene, as visual shapes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from msrr_bullet.built_poses import placed_tags
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.built_urdf import build
from msrr_bullet.simulation.tag_plates import (
    load_tag_plate,
    plate_folder,
    plate_scale,
    set_texture,
    write_plate,
)
from msrr_bullet.simulation.urdf_welding import weld, write_welded
from msrr_scenes.as_built import AsBuilt, as_designed
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import read_unit
from msrr_scenes.specs.scene import Scene
from msrr_scenes.temporary_files import room_for_temporary_files


class TagVisuals:
    """Adds tags to the visual shapes of units and obstacles.

    The folder holds the URDFs of one trial, until they are loaded.
    """

    def __init__(
        self, scene: Scene, folder: Path, built: AsBuilt | None = None, *, pybullet_draws: bool = True
    ) -> None:
        """Use the tags of ``scene``; units with the fault ``marker_hidden`` get blank plates.

        The folder for the files exists. ``built`` has the true sizes and places of the tags; None if all are
        as designed. ``pybullet_draws`` is whether PyBullet is given the textures. The raster renderer needs
        none of its textures: it reads the image that lies beside the mesh of a plate.
        """
        self._scene, self._family = scene, scene.tags.tag_family
        self._built = built or as_designed(scene)
        self._folder = folder.resolve()
        self._pybullet_draws = pybullet_draws
        self._covered = scene.covered_units

    @room_for_temporary_files()
    def unit_urdf(self, unit: str) -> Path:
        """Write a welded copy of the URDF of a unit with plates for all tags, and return the path.

        Raises:
            GeometryError: A tag slot has no link in the URDF.
        """
        scene, geometry, built = self._scene, self._scene.geometry(unit), self._built.units[unit]
        tree = geometry.tree()
        links = {e.attrib["name"]: e for e in tree.getroot().findall("link")}
        plates: dict[str, float] = {}
        for slot, tag_id in scene.tag_ids(unit).items():
            if slot not in links:
                raise GeometryError(
                    f"{geometry.urdf}: no link for tag {tag_id} at {slot!r}; tag links: {geometry.tag_slots}"
                )
            shown = self._shown(unit, tag_id)
            size = built.print_scale * scene.tag_size(unit, slot)
            mesh, _ = write_plate(plate_folder(), shown, self._family)
            _add_visual(links[slot], mesh, plate_scale(size, self._family))
            plates[slot] = self._family.plate_ratio * size
        build(tree, read_unit(geometry.urdf, geometry.frame_map), built, plates)
        weld(tree, geometry.pins)
        path = self._folder / f"{unit}.urdf"
        write_welded(tree, path)
        return path

    def _shown(self, unit: str, tag_id: int) -> int | None:
        """Return the tag that a plate of a unit shows; None for a blank one."""
        return None if unit in self._covered else tag_id

    def add_to_unit(self, client: int, body: int, unit: str) -> None:
        """Set the textures of the plates of a body that was loaded from the file of :meth:`unit_urdf`.

        Raises:
            GeometryError: The body has no plate for a tag, because it was loaded from another file.
        """
        if not self._pybullet_draws:
            return
        plates: dict[str, list[tuple[int, int]]] = {}  # a unit whose marker is hidden has blank ones alone
        shapes: Counter[int] = Counter()
        for shape in pybullet.getVisualShapeData(body, physicsClientId=client):
            link, mesh = shape[1], shape[4].decode()
            plates.setdefault(mesh, []).append((link, shapes[link]))
            shapes[link] += 1
        for slot, tag_id in self._scene.tag_ids(unit).items():
            file, texture = write_plate(plate_folder(), self._shown(unit, tag_id), self._family)
            if not plates.get(str(file)):
                raise GeometryError(f"body {body} of unit {unit!r} has no plate for {slot!r}")
            set_texture(client, body, *plates[str(file)].pop(), texture)

    def add_to_obstacle(self, client: int, obstacle: str, X_WO: SE2) -> None:
        """Put the tag of an obstacle, if it has one, on the lid of the obstacle that stands at ``X_WO``."""
        for tag in placed_tags(self._scene, self._built, obstacle).values():
            X_WT = SE3.from_se2(X_WO) @ tag.X_BT
            load_tag_plate(
                client,
                plate_folder(),
                tag.tag_id,
                tag.size,
                X_WT,
                self._family,
                textured=self._pybullet_draws,
            )


def _add_visual(link: Element, mesh: Path, scale: tuple[float, float, float]) -> None:
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(SubElement(visual, "geometry"), "mesh", filename=str(mesh), scale=" ".join(map(repr, scale)))
    material = SubElement(visual, "material", name=f"plate_{mesh.stem}")
    SubElement(material, "color", rgba="1 1 1 1")
