"""The bodies of a scene in colour, drawn by the raster renderer from any camera over a picture of a floor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np

from msrr_bullet.built_poses import PlacedTag, placed_tags
from msrr_bullet.figures.drawing.canvas import Image, bgr
from msrr_bullet.figures.drawing.perspective import Perspective
from msrr_bullet.render.raster.assembly import VisualShape
from msrr_bullet.render.raster.floor_texture import pack_floor
from msrr_bullet.render.raster.kernels.records import FloorTexture
from msrr_bullet.render.raster.mesh import Mesh, box, cylinder, sphere
from msrr_bullet.render.raster.mesh_file import read_mesh
from msrr_bullet.render.raster.rasterizer import Rasterizer
from msrr_bullet.render.raster.texture import texture_of
from msrr_bullet.tag_print import plate_texture
from msrr_bullet.timeline.palette import OBSTACLE, link_colour, unit_colours
from msrr_scenes.arrays import Array
from msrr_scenes.as_built import AsBuilt
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_families import TagFamily

#: Height of a plate over the face that carries it [m], so that the face does not hide it.
_LIFT = 0.0005
#: Where a body is that is not in the world: behind the camera, in its frame [m].
_NOWHERE = np.array([0.0, 0.0, -10.0])


class BodyRenderer:
    """Draws the units and obstacles of a scene in their colours, lit, with their tags, and hiding each other.

    The raster renderer draws in grey. Three of them, one for each primary colour, draw a picture in colour.
    """

    def __init__(self, scene: Scene, built: AsBuilt) -> None:
        """Prepare the shapes of all bodies, as they were built.

        Raises:
            GeometryError: A mesh of a unit cannot be read.
        """
        self._names = (*scene.units, *scene.obstacles)
        shapes = [
            (frame, X_BG, mesh, colour)
            for frame, name in enumerate(self._names)
            for X_BG, mesh, colour in _meshes(scene, built, name)
        ]
        plates = [
            _plate_shape(frame, tag, name in scene.covered_units, scene.tags.tag_family)
            for frame, name in enumerate(self._names)
            for tag in placed_tags(scene, built, name).values()
        ]
        self._primaries = []
        for channel in range(3):
            lit = [VisualShape(f, X, mesh, bgr(colour)[channel] / 255.0) for f, X, mesh, colour in shapes]
            self._primaries.append(Rasterizer(lit + plates, frame_count=len(self._names)))
        points: list[list[Array]] = [[] for _ in self._names]
        for shape in lit + plates:
            points[shape.frame].append(shape.X_MG.act(shape.mesh.vertices))
        self._boxes = [_box_around(np.concatenate(own)) for own in points]

    def draw(self, perspective: Perspective, poses: Mapping[str, SE2], floor: Image) -> Image:
        """Return a picture of the bodies over a picture of the floor, each of shape (height, width, 3), BGR.

        All bodies are in front of the camera. Those without a pose ``X_WB`` are not present.
        """
        away = SE3(perspective.X_WC.R, perspective.X_WC.act(_NOWHERE))
        places = [SE3.from_se2(poses[name]) if name in poses else away for name in self._names]
        frames = np.array([[*X.p, *X.quaternion_xyzw()] for X in places])
        image = floor.copy()
        for name, X_WB, corners_B in zip(self._names, places, self._boxes, strict=True):
            around = Window.around(perspective.pixels(X_WB.act(corners_B)), 1.0) if name in poses else None
            window = None if around is None else around.intersection(perspective.camera.frame)
            if window is not None:
                part = np.s_[window.y : window.y_end, window.x : window.x_end]
                image[part] = self._draw_window(perspective, window, frames, floor[part])
        return image

    def _draw_window(self, perspective: Perspective, window: Window, frames: Array, floor: Image) -> Image:
        """Return what a window shows of all bodies, over a picture of the floor in it."""

        def draw(channel: int, behind: FloorTexture) -> Pixels:
            return self._primaries[channel].draw(perspective.camera, perspective.X_WC, window, frames, behind)

        bodies = np.stack([draw(channel, _BLACK) for channel in range(3)], axis=-1)
        # What a white floor adds to a black one is the share of a pixel in which the floor is seen.
        share = (draw(0, _WHITE).astype(np.float32) - bodies[..., 0]) / np.float32(255.0)
        image: Image = np.minimum(bodies + share[..., None] * floor + 0.5, 255.0).astype(np.uint8)
        return image


def _box_around(points: Array) -> Array:
    """Return the corners, shape (8, 3), of the box along the axes around points, shape (N, 3)."""
    low_and_high = np.stack([points.min(axis=0), points.max(axis=0)])
    return np.array([[x, y, z] for x, y, z in product(*low_and_high.T)])


def _uniform(grey: float) -> FloorTexture:
    return pack_floor([np.full((1, 1), grey, dtype=np.float32)], period=1.0, wall=grey)


_BLACK, _WHITE = _uniform(0.0), _uniform(255.0)


def _meshes(scene: Scene, built: AsBuilt, name: str) -> Iterator[tuple[SE3, Mesh, int]]:
    """Yield the meshes of a body without its tags: pose in B, mesh and colour."""
    if name in scene.units:
        solids, colour = built.units[name].geometry.solids, unit_colours(scene)[name]
    else:
        solids, colour = (scene.obstacles[name].solid,), OBSTACLE
    for solid in solids:
        for mesh in _solid(solid):
            yield solid.X_UG, mesh, link_colour(solid.link, colour)


def _solid(solid: Solid) -> Iterator[Mesh]:
    if solid.kind == "box":
        yield box(np.array(solid.size))
    elif solid.kind == "cylinder":
        yield cylinder(*solid.size)
    elif solid.kind == "sphere":
        yield sphere(*solid.size)
    elif not solid.part:
        assert solid.mesh is not None, "only a mesh is none of the shapes above"
        for part in read_mesh(solid.mesh):
            yield part.mesh.scaled(np.array(solid.size))


def _plate_shape(frame: int, tag: PlacedTag, covered: bool, family: TagFamily) -> VisualShape:
    """Return the plate of a tag, which is blank if the tag is covered."""
    lifted = tag.X_BT @ SE3(p=np.array([0.0, 0.0, -_LIFT]))
    print_ = plate_texture(None if covered else tag.tag_id, family)
    return VisualShape(frame, lifted, _square(family.plate_ratio * tag.size), 1.0, texture_of(print_[..., 0]))


def _square(edge: float) -> Mesh:
    """Return a square [m] that is seen from z < 0, with an image whose upper edge is at -y."""
    corners: Array = tag_corners(edge)
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners, triangles, uv=uv[triangles])
