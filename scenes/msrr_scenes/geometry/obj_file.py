"""The files that a Wavefront OBJ file names: its material libraries, and the images of their materials."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

#: Endings of the image that is looked for beside a mesh, under the mesh's own name.
_IMAGES = (".png", ".jpg", ".bmp")


def obj_lines(path: Path) -> Iterator[list[str]]:
    """Yield the words of every line of an OBJ or MTL file that has any, without comments."""
    text = path.read_text(errors="replace").replace("\\\n", " ")
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if words:
            yield words


def material_library(obj: Path, words: list[str]) -> Path:
    """Return the file that a line ``mtllib`` of an OBJ file names."""
    return obj.parent / " ".join(words[1:])


def material_images(library: Path) -> dict[str, Path]:
    """Return the diffuse image of each material, as far as its file exists (as in PyBullet)."""
    images: dict[str, Path] = {}
    name = ""
    if library.is_file():
        for words in obj_lines(library):
            if words[0] == "newmtl":
                name = " ".join(words[1:])
            elif words[0] == "map_Kd" and (image := library.parent / words[-1]).is_file():
                images[name] = image
    return images


def image_beside(obj: Path) -> Path | None:
    """Return the image of a mesh without a material library: the one of its name; None without one."""
    return next((path for ending in _IMAGES if (path := obj.with_suffix(ending)).is_file()), None)


def named_by_obj(obj: Path) -> list[Path]:
    """Return the files that exist of those that tell how an OBJ file looks, in the order of naming."""
    libraries = [material_library(obj, words) for words in obj_lines(obj) if words[0] == "mtllib"]
    if not libraries:
        beside = image_beside(obj)
        return [] if beside is None else [beside]
    found = [file for library in libraries for file in (library, *material_images(library).values())]
    return [file for file in dict.fromkeys(found) if file.is_file()]
