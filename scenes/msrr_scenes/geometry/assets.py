"""Where the files that ship with the project lie, in a checkout and in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from msrr_scenes.errors import SceneError, UnknownNameError

_PACKAGE = Path(__file__).resolve().parents[1]


def urdf_folder() -> Path:
    """Return the folder of the shipped URDFs: inside the package when installed, ``urdf/`` in a checkout."""
    installed = _PACKAGE / "urdf"
    return installed if installed.is_dir() else _PACKAGE.parents[1] / "urdf"


def scene_folder() -> Path:
    """Return the folder of the shipped scene files."""
    return _PACKAGE / "library"


def shipped_scenes() -> tuple[str, ...]:
    """Return the names of the shipped scenes, sorted."""
    return tuple(sorted(p.stem for p in scene_folder().glob("*.yaml")))


def find_scene(name: str) -> Path:
    """Return the file of a scene: a path that exists, or the name of a shipped scene.

    Raises:
        SceneError: A path that does not exist.
        UnknownNameError: A name that is not shipped.
    """
    path = Path(name)
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        if not path.is_file():
            raise SceneError(f"{name}: no such scene file")
        return path
    shipped = scene_folder() / f"{name}.yaml"
    if not shipped.is_file():
        raise UnknownNameError("scene", name, shipped_scenes(), "A file of your own is named by its path.")
    return shipped


def find_urdf(name: str, beside: Path | None = None) -> Path:
    """Return a URDF file: beside the scene file if there is one, else among the shipped ones."""
    for folder in ([beside] if beside else []) + [Path.cwd(), urdf_folder()]:
        path = folder / name
        if path.is_file():
            return path
    raise SceneError(f"no URDF named {name!r} beside the scene, in the working folder or in {urdf_folder()}")
