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
    return {name: image for name, image in _named_images(library) if image.is_file()}


def _named_images(library: Path) -> Iterator[tuple[str, Path]]:
    name = ""
    for words in obj_lines(library) if library.is_file() else ():
        if words[0] == "newmtl":
            name = " ".join(words[1:])
        elif words[0] == "map_Kd":
            yield name, library.parent / words[-1]


def image_beside(obj: Path) -> Path | None:
    """Return the image of a mesh without a material library: the one of its name; None without one."""
    return next((path for path in _beside(obj) if path.is_file()), None)


def _beside(obj: Path) -> list[Path]:
    return [obj.with_suffix(ending) for ending in _IMAGES]


def looked_for(obj: Path) -> list[Path]:
    """Return the files that tell how an OBJ file looks, whether they are there or not, in order of naming."""
    libraries = [material_library(obj, words) for words in obj_lines(obj) if words[0] == "mtllib"]
    if not libraries:
        return _beside(obj)
    images = [[image for _, image in _named_images(library)] for library in libraries]
    return [file for library, named in zip(libraries, images, strict=True) for file in (library, *named)]
