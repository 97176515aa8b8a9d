"""The tags on the units and obstacles of a scene, as visual shapes in a folder that belongs to one trial."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from msrr_bullet.built_poses import obstacle_tag_pose
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.built_urdf import build
from msrr_bullet.simulation.tag_plates import load_tag_plate, set_texture, write_plate
from msrr_bullet.simulation.urdf_welding import weld, write_welded
from msrr_scenes.as_built import AsBuilt, as_drawn
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import read_unit
from msrr_scenes.specs.faults import MarkerHidden
from msrr_scenes.specs.scene import Scene


class TagVisuals:
    """Adds tags to the visual shapes of units and obstacles.

    The folder holds meshes, textures and URDFs; it has to exist for as long as the world.
    """

    def __init__(self, scene: Scene, folder: Path, built: AsBuilt | None = None) -> None:
        """Use the tags of ``scene``; units with the fault ``marker_hidden`` get blank plates.

        Args:
            scene: A checked scene.
            folder: Existing folder for the files.
            built: True sizes and places of the tags; None if all are as drawn.
        """
        self._scene, self._family = scene, scene.tags.tag_family
        self._built = built or as_drawn(scene)
        self._folder = folder
        self._hidden = {f.unit for f in scene.faults if isinstance(f, MarkerHidden)}

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
            shown = None if unit in self._hidden else tag_id
            size = built.print_scale * scene.tag_size(unit, slot)
            mesh, _ = write_plate(self._folder, f"{unit}_{slot}", size, shown, self._family)
            _add_visual(links[slot], mesh)
            plates[slot] = self._family.plate_ratio * size
        build(tree, read_unit(geometry.urdf, geometry.frame_map), built, plates)
        weld(tree, geometry.pins)
        path = self._folder / f"{unit}.urdf"
        write_welded(tree, path)
        return path

    def add_to_unit(self, client: int, body: int, unit: str) -> None:
        """Set the textures of the plates of a body that was loaded from the file of :meth:`unit_urdf`.

        Raises:
            GeometryError: The body has no plate for a tag, because it was loaded from another file.
        """
        plates: dict[str, tuple[int, int]] = {}
        shapes: Counter[int] = Counter()
        for shape in pybullet.getVisualShapeData(body, physicsClientId=client):
            link, mesh = shape[1], shape[4].decode()
            plates[mesh] = (link, shapes[link])
            shapes[link] += 1
        for slot in self._scene.tag_ids(unit):
            file = self._folder / f"{unit}_{slot}.obj"
            plate = plates.get(str(file.resolve()))
            if plate is None:
                raise GeometryError(f"body {body} of unit {unit!r} has no plate for {slot!r}")
            set_texture(client, body, *plate, file.with_suffix(".png"))

    def add_to_obstacle(self, client: int, obstacle: str, X_WO: SE2) -> None:
        """Put the tag of an obstacle, if it has one, on the lid of the obstacle that stands at ``X_WO``."""
        spec = self._scene.obstacles[obstacle]
        if spec.tag_id is not None:
            built = self._built.obstacle_tags[obstacle]
            X_WT = SE3.from_se2(X_WO) @ obstacle_tag_pose(spec.height_m, built)
            size = built.print_scale * spec.tag_m
            load_tag_plate(client, self._folder, spec.tag_id, size, X_WT, self._family)


def _add_visual(link: Element, mesh: Path) -> None:
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(SubElement(visual, "geometry"), "mesh", filename=str(mesh.resolve()))
    material = SubElement(visual, "material", name=f"plate_{mesh.stem}")
    SubElement(material, "color", rgba="1 1 1 1")
