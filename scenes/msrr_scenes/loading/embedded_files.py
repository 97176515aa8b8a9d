"""Files that a document names are replaced by what they say, so that a log needs none of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from msrr_scenes.checks.problems import KeyPath, dotted
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.calibration_file import read_calibration
from msrr_scenes.loading.tag_map_file import read_tag_map
from msrr_scenes.loading.yaml_document import YamlDocument
from msrr_scenes.specs.spec import Spec

#: What a file says that a document names.
_File = TypeVar("_File", bound=Spec)


def embed_calibrations(document: YamlDocument, beside: Path) -> None:
    """Replace the names of calibration files of the cameras of a scene by what they say.

    Raises:
        SceneError: A file is neither beside the scene nor in the working folder, or is no calibration.
    """
    cameras = document.data.get("cameras")
    for name in cameras if isinstance(cameras, dict) else ():
        embed_file(document, ("cameras", name, "calibration"), beside, read_calibration)


def embed_file(document: YamlDocument, path: KeyPath, beside: Path, read: Callable[[Path], Spec]) -> None:
    """Replace the name of a file in a document by what the file says.

    The document may have something else at the path, or nothing. Its folder, ``beside``, is searched before
    the working folder.

    Raises:
        SceneError: The file is in neither folder, or cannot be used.
    """
    holder: Any = document.data
    for key in path[:-1]:
        holder = holder.get(key) if isinstance(holder, dict) else None
    named = holder.get(path[-1]) if isinstance(holder, dict) else None
    if isinstance(named, str):
        holder[path[-1]] = _embedded(document, path, named, beside, read).model_dump()


def embed_maps(document: YamlDocument, beside: Path) -> None:
    """Replace the names of maps of markers by what they say of places.

    Raises:
        SceneError: A file is neither beside the scene nor in the working folder, or is no map.
    """
    units = document.data.get("units")
    for unit, spec in units.items() if isinstance(units, dict) else ():
        markers = spec.get("markers") if isinstance(spec, dict) else None
        if not isinstance(markers, dict):
            continue
        for port, marker in markers.items():
            if isinstance(marker, str):
                markers[port] = {"map": marker}
            named = markers[port].get("map") if isinstance(markers[port], dict) else None
            if isinstance(named, str):
                found = _embedded(document, ("units", unit, "markers", port), named, beside, read_tag_map)
                # What a scene does not use must not change its digest.
                unused = {"tags": {"__all__": {"covariance", "pictures"}}}
                markers[port]["map"] = found.model_dump(exclude=unused)


def _embedded(
    document: YamlDocument, key: KeyPath, named: str, beside: Path, read: Callable[[Path], _File]
) -> _File:
    """Return what a file says that a scene names."""
    place = f"{document.origin(key)}: {dotted(key)}"
    try:
        file = next((path for path in (beside / named, Path(named)) if path.is_file()), None)
    except OSError as error:  # such as a name that is too long, or a folder that may not be entered
        raise SceneError(f"{place}: {named[:80]!r} cannot be read: {error.strerror}") from None
    if file is None:
        raise SceneError(f"{place}: no file {named!r} beside the file or in the working folder")
    try:
        return read(file)
    except SceneError as error:
        raise SceneError(f"{place}: {error}") from None
