"""Reading scene files: YAML to a checked :class:`Scene`, with errors that name file, line, key and mend."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

from pydantic import ValidationError

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.assets import find_scene
from msrr_scenes.loading.checks import problems_in
from msrr_scenes.loading.marked_yaml import Marked, apply_overrides, parse_document
from msrr_scenes.loading.problems import Problem, dotted
from msrr_scenes.loading.validation_errors import explain
from msrr_scenes.specs.scene import Scene

#: How many problems one message lists before it only counts the rest.
MAX_LISTED = 8

_NONE: Mapping[str, str] = MappingProxyType({})


def load_scene(name_or_path: str | Path, overrides: Mapping[str, str] = _NONE) -> Scene:
    """Read and check a scene.

    Args:
        name_or_path: Name of a shipped scene, or path of a scene file.
        overrides: Dotted keys and their values as YAML text, ``{"cameras.onboard.noise_grey": "8"}``; list
            items by index (``plan.0.to``). They are written into the file's content before it is checked.

    Raises:
        SceneError: Anything that makes the scene unusable, in one message: file and line, key, what was
            expected, the nearest valid key.
        UnknownNameError: No shipped scene of that name.
    """
    path = find_scene(str(name_or_path))
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: not UTF-8 text: {error.reason} at byte {error.start}") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    document = parse_document(text, str(path))
    apply_overrides(document, overrides)
    if "source" in document.data:
        raise SceneError(f"{document.origin(('source',))}: source: unknown key; it is set by the program")
    document.data.setdefault("name", path.stem)
    scene = _validate(document, path)
    _refuse(document, problems_in(scene))
    return scene


def check_scene(scene: Scene) -> None:
    """Check a scene that was built in Python across its fields, as :func:`load_scene` does for a file.

    Raises:
        SceneError: All problems found, in one message.
    """
    _refuse(Marked({}), problems_in(scene))


def scene_hash(scene: Scene) -> str:
    """Return a digest of everything in a scene that can change a trial: all its values, URDFs and meshes.

    The description and the place of the file do not count.
    """
    values = scene.model_dump(mode="json", exclude={"description", "source"})
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps(values, sort_keys=True, separators=(",", ":")).encode())
    for unit in sorted(scene.units):
        for file in _files_of(scene.geometry(unit).urdf):
            digest.update(hashlib.blake2b(file.read_bytes()).digest())
    return digest.hexdigest()


def _files_of(urdf: Path) -> list[Path]:
    """Return the URDF and the files it names, in the order of naming."""
    named = [e.attrib["filename"] for e in ElementTree.parse(urdf).iter() if "filename" in e.attrib]
    return [urdf, *(p for p in (urdf.parent / name for name in dict.fromkeys(named)) if p.is_file())]


def _validate(document: Marked, path: Path) -> Scene:
    try:
        scene = Scene.model_validate(document.data)
    except ValidationError as error:
        found = [explain(e, document) for e in error.errors(include_url=False)]
        _refuse(document, [problem for problem in found if problem is not None])
        raise AssertionError("a validation error explains itself") from error
    return scene.model_copy(update={"source": path.resolve()})


def _refuse(document: Marked, problems: list[Problem]) -> None:
    if not problems:
        return
    unique = list(dict.fromkeys(problems))
    unique.sort(key=lambda p: p.rank)  # stable: causes before what follows from them
    lines = [f"{document.origin(p.path)}: {dotted(p.path) or 'scene'}: {p.text}" for p in unique[:MAX_LISTED]]
    if len(unique) > MAX_LISTED:
        lines.append(f"... and {len(unique) - MAX_LISTED} more")
    raise SceneError("\n".join(lines))
