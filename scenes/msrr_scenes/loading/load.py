"""Scene files: found by name, read from YAML, checked, and turned into a :class:`Scene`."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar
from xml.etree import ElementTree

from pydantic import ValidationError

from msrr_scenes.checks.contradictions import contradictions, overrides_without_effect
from msrr_scenes.checks.problems import KeyPath, Problem, dotted
from msrr_scenes.errors import MsrrError, SceneError, UnknownNameError
from msrr_scenes.file_cache import FileCache
from msrr_scenes.geometry.obj_file import looked_for
from msrr_scenes.geometry.unit_geometry import library_folder
from msrr_scenes.geometry.urdf_file import elements_with_files, named_file
from msrr_scenes.loading.embedded_files import embed_calibrations, embed_maps
from msrr_scenes.loading.overrides import apply_overrides, override_text
from msrr_scenes.loading.validation_errors import explain
from msrr_scenes.loading.yaml_document import YamlDocument, parse_document, read_text
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Spec

#: How many problems one message lists before it only counts the rest.
MAX_LISTED = 8

#: Folder of the shipped scene files.
LIBRARY = library_folder()

#: What a document specifies.
_Kind = TypeVar("_Kind", bound=Spec)

_NONE: Mapping[str, object] = MappingProxyType({})


def shipped_scenes() -> tuple[str, ...]:
    """Return the names of the shipped scenes, sorted."""
    return tuple(sorted(path.stem for path in LIBRARY.glob("*.yaml")))


def find_scene(name_or_path: str) -> Path:
    """Return the file of a scene, given by its path or by the name of a shipped scene.

    Raises:
        SceneError: There is no file at the path.
        UnknownNameError: No shipped scene has this name.
    """
    path = Path(name_or_path)
    if name_or_path in shipped_scenes():
        return LIBRARY / f"{name_or_path}.yaml"
    try:
        if path.suffix in (".yaml", ".yml") or len(path.parts) > 1 or path.exists():
            if path.is_dir():
                raise SceneError(f"{name_or_path}: a folder; name a scene file in it")
            if not path.is_file():
                other = os.path.lexists(path)  # a pipe, a device, or a link that leads nowhere
                raise SceneError(f"{name_or_path}: {'not a regular file' if other else 'no such scene file'}")
            return path
        meant = f", such as {name_or_path}.yaml" if Path(f"{name_or_path}.yaml").is_file() else ""
    except OSError as error:  # such as a name that is too long, or a folder that may not be entered
        raise SceneError(f"{name_or_path}: cannot be read: {error.strerror}") from None
    hint = f"A file of your own is named by its path{meant}."
    raise UnknownNameError("scene", name_or_path, shipped_scenes(), hint)


def load_scene(
    name_or_path: str | Path,
    overrides: Mapping[str, object] = _NONE,
    *,
    told_as: str | Mapping[str, str] = "override",
) -> Scene:
    """Read and check a scene.

    Args:
        name_or_path: Name of a shipped scene, or path of a scene file.
        overrides: Dotted keys and their values, as YAML text or as values of Python:
            ``{"cameras.onboard.noise_grey": 8, "as_built": "careful"}``; list items by index
            (``plan.0.to``). They replace the file's values before these are checked.
        told_as: What messages call an override: the command line names its option ``--set``. A mapping
            has a name for each key.

    Raises:
        SceneError: The scene is unusable; one message lists every problem with file, line and column, key,
            what was expected, and the nearest valid key.
        UnknownNameError: No shipped scene has this name.
    """
    if not isinstance(overrides, Mapping) or not all(isinstance(key, str) for key in overrides):
        raise SceneError(f"{name_or_path}: expected overrides as a dict of dotted keys, found {overrides!r}")
    path = find_scene(str(name_or_path))
    document = deepcopy(_parsed(path))
    texts = {key: override_text(key, value) for key, value in overrides.items()}
    apply_overrides(document, texts, told_as)
    if "source" in document.data:
        raise SceneError(f"{document.origin(('source',))}: source: unknown key; it is set by the program")
    document.data.setdefault("name", plain_name(path.stem))
    embed_calibrations(document, path.parent)
    embed_maps(document, path.parent)
    scene = validated(Scene, document).read_from(path.resolve(), document.origins)
    refuse(document, [*contradictions(scene), *overrides_without_effect(scene, overrides)])
    _note_as_good(scene_hash(scene))
    return scene


#: Digests of scenes without contradictions, the newest last, and the largest number of them. A digest covers
#: all that contradictions follow from, and to look for them takes a tenth of a second on a slow machine.
_GOOD: dict[str, None] = {}
_MOST_GOOD = 10_000


def _note_as_good(digest: str) -> None:
    _GOOD[digest] = None
    while len(_GOOD) > _MOST_GOOD:
        _GOOD.pop(next(iter(_GOOD)), None)


def read_document(path: Path) -> YamlDocument:
    """Read a file of YAML.

    Raises:
        SceneError: The file cannot be read, or is none.
    """
    return parse_document(read_text(path), str(path))


#: Scene files, of which a variation loads one with each of its values.
_parsed = FileCache(lambda path: (read_document(path), [path]), most=8)


def check_scene(scene: Scene) -> None:
    """Check a scene that was built in Python for contradictions, as :func:`load_scene` does for a file.

    One that was checked before, by either function, is not checked again while its files stay as they are.

    Raises:
        SceneError: The scene is unusable; one message lists every problem.
        TypeError: It is no scene, but the name of one, for example.
    """
    _expect_scene(scene)
    try:
        digest = scene_hash(scene)
    except (MsrrError, OSError, ElementTree.ParseError):  # of a URDF, which the checks explain
        digest = None
    if digest is None or digest not in _GOOD:
        refuse(_places(scene), contradictions(scene))
        _note_as_good(scene_hash(scene))


def placed(scene: Scene, message: str) -> str:
    """Return a message about a scene with the place of each line.

    That is the place of the dotted key that the line begins with, before a colon, or the file.
    """
    places, lines = _places(scene), list[str]()
    for line in message.splitlines():
        key, colon, _ = line.partition(": ")
        path = tuple(int(part) if part.isdecimal() else part for part in key.split("."))
        known = colon and path[0] in Scene.model_fields
        lines.append(f"{places.origin(path) if known else scene.source or places.origin(())}: {line}")
    return "\n".join(lines)


def _places(scene: Scene) -> YamlDocument:
    """Return the places of the values of a scene, but not these."""
    return YamlDocument({}, dict(scene.origins) or {(): str(scene.source or scene.name)})


def scene_hash(scene: Scene) -> str:
    """Return a digest of everything in a scene that can change a trial: values, URDFs, meshes, textures.

    The description and the path of the file do not count. The order of units, obstacles and places does: in
    that order bodies are simulated, and units speak and are planned for.

    Raises:
        TypeError: It is no scene, but the name of one, for example.
    """
    _expect_scene(scene)
    values = scene.model_dump(mode="json", exclude={"description", "source"})
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps(values, separators=(",", ":")).encode())
    urdfs = [scene.geometry(unit).urdf for unit in sorted(scene.units)]
    of_files = {urdf: _digests_of_files(urdf) for urdf in set(urdfs)}  # most units share one URDF
    for urdf in urdfs:
        digest.update(of_files[urdf])
    return digest.hexdigest()


def _read_digests(urdf: Path) -> tuple[bytes, list[Path]]:
    """Return the digests of the files of a URDF, and where files were looked for."""
    files = _files_of(urdf)
    found = (hashlib.blake2b(file.read_bytes()).digest() for file in files if file.is_file())
    return b"".join(found), files


#: Digests of the files of URDFs: a sweep asks for those of one robot many thousand times.
_digests_of_files = FileCache(_read_digests, most=64)


def _expect_scene(scene: object) -> None:
    if not isinstance(scene, Scene):
        raise TypeError(f"expected a scene, as load_scene returns it, found {type(scene).__name__}")


def plain_name(stem: str) -> str:
    """Return a name of a scene like that of its file, which may hold any characters."""
    return re.sub(r"^[.-]|[^A-Za-z0-9._-]", "_", stem[:64])


def _files_of(urdf: Path) -> list[Path]:
    """Return the URDF, its meshes and textures, and those that its meshes name, in the order of naming.

    Files that do not exist are among them.
    """
    named = [e.attrib["filename"] for e in elements_with_files(ElementTree.parse(urdf).getroot())]
    files = [named_file(urdf, name) for name in dict.fromkeys(named)]
    meshes = [p for p in files if p.suffix.lower() == ".obj" and p.is_file()]
    return [urdf, *files, *(p for mesh in meshes for p in dict.fromkeys(looked_for(mesh)))]


def validated(kind: type[_Kind], document: YamlDocument) -> _Kind:
    """Return what a document specifies.

    Raises:
        SceneError: Something in it is wrong; one message lists every problem with place and key.
    """
    try:
        return kind.model_validate(document.data)
    except ValidationError as error:
        found = [explain(e, document, kind) for e in error.errors(include_url=False)]
        refuse(document, [problem for problem in found if problem is not None])
        raise AssertionError("a validation error explains itself") from error


def refuse(document: YamlDocument, problems: list[Problem]) -> None:
    """Raise a :class:`SceneError` that lists problems of a document with their places; none is fine."""
    if not problems:
        return
    alike: dict[tuple[KeyPath, str], list[Problem]] = {}
    for problem in sorted(dict.fromkeys(problems), key=lambda p: p.rank):  # stable: causes come first
        alike.setdefault((_of_any_unit(problem.path), problem.text), []).append(problem)
    lines = []
    for first, *others in list(alike.values())[:MAX_LISTED]:
        place = dotted(first.path) or "the file"
        if others:
            place += f" and {dotted(others[0].path) if len(others) == 1 else f'{len(others)} more units'}"
        lines.append(f"{document.origin(first.path)}: {place}: {first.text}")
    if len(alike) > MAX_LISTED:
        lines.append(f"... and {len(alike) - MAX_LISTED} more")
    raise SceneError("\n".join(lines))


def _of_any_unit(path: KeyPath) -> KeyPath:
    """Return the path of a description that many units share, without the unit; any other path as it is."""
    return ("units", *path[2:]) if path[:1] == ("units",) and path[2:3] in (("urdf",), ("frames",)) else path
