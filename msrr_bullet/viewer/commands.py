"""Commands to meshcat's page: msgpack messages, one for each change of the scene.

Meshcat's own Python client starts a server that listens on every interface and outlives its parent, and its
``static_html`` needs that server. The page of meshcat accepts the same bytes from any websocket, or from data
in the page itself. This project therefore uses meshcat's geometry and page, and transports the bytes itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import numpy as np
import umsgpack
from meshcat.geometry import Geometry, Material, Mesh, Object
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3


@dataclass(frozen=True, slots=True)
class Command:
    """One change of the scene in the page.

    A later command with the same key, the name of what changes, replaces an earlier one.
    """

    key: str
    data: bytes


def viewer_script() -> str:
    """Return the script of meshcat's page, which is all the code that a page needs."""
    return (files("meshcat") / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")


def _rename(value: Any, names: dict[str, str]) -> Any:
    if isinstance(value, dict):
        return {key: _rename(entry, names) for key, entry in value.items()}
    if isinstance(value, list):
        return [_rename(entry, names) for entry in value]
    return names.get(value, value) if isinstance(value, str) else value


def _uuids(value: Any) -> list[str]:
    if isinstance(value, dict):
        own = [value["uuid"]] if "uuid" in value else []
        return own + [uuid for entry in value.values() for uuid in _uuids(entry)]
    return [uuid for entry in value for uuid in _uuids(entry)] if isinstance(value, list) else []


def set_object(path: str, geometry: Geometry, material: Material, kind: type[Object] = Mesh) -> Command:
    """Place a shape at a node of the scene tree.

    Meshcat identifies the parts of a shape by random numbers. They are replaced by numbers derived from
    ``path``, so that the same trial gives the same page.
    """
    lowered = kind(geometry, material).lower()
    names = {uuid: f"{path}#{i}" for i, uuid in enumerate(dict.fromkeys(_uuids(lowered)))}
    message = {"type": "set_object", "path": path, "object": _rename(lowered, names)}
    return Command(f"object {path}", umsgpack.packb(message))


def set_transform(path: str, X: SE3, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> Command:
    """Set the pose of a node in its parent, and its scale along its own axes."""
    matrix: Array = X.matrix() @ np.diag([*scale, 1.0])
    message = {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}
    return Command(f"transform {path}", umsgpack.packb(message))


def set_property(path: str, name: str, value: bool | float | Sequence[float]) -> Command:
    """Set a property of a node, such as ``visible``."""
    listed = value if isinstance(value, (bool, float)) else [float(v) for v in value]
    message = {"type": "set_property", "path": path, "property": name, "value": listed}
    return Command(f"property {path} {name}", umsgpack.packb(message))


@dataclass(frozen=True, slots=True, eq=False)
class NodeState:
    """Pose, visibility and scale of a node at one instant."""

    X: SE3 = field(default_factory=SE3)
    visible: bool = True
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


HIDDEN = NodeState(visible=False)


def place(path: str, old: NodeState | None, new: NodeState) -> Iterator[Command]:
    """Yield the commands that take a node from its old state, if it has one, to a new one."""
    if old is None or old.visible != new.visible:
        yield set_property(path, "visible", new.visible)
    moved = (  # the place of a hidden node was never sent
        old is None
        or not old.visible
        or not (np.array_equal(old.X.p, new.X.p) and np.array_equal(old.X.R, new.X.R))
        or old.scale != new.scale
    )
    if moved and new.visible:
        yield set_transform(path, new.X, new.scale)


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeTrack:
    """One animated property of one node: ``values`` (N, k) at ``times`` (N,) [s]."""

    path: str
    name: str
    kind: str
    times: Array
    values: NDArray[np.float64] | NDArray[np.bool_]

    def thinned(self) -> KeyframeTrack:
        """Return the track without the keys between two equal neighbours."""
        if len(self.times) < 3:
            return self
        same = (self.values[1:] == self.values[:-1]).reshape(len(self.times) - 1, -1).all(axis=1)
        keep = np.ones(len(self.times), dtype=np.bool_)
        keep[1:-1] = ~(same[:-1] & same[1:])
        return KeyframeTrack(self.path, self.name, self.kind, self.times[keep], self.values[keep])


def set_animation(tracks: Sequence[KeyframeTrack]) -> Command:
    """Set the animation of the page from its tracks."""
    clips: dict[str, list[dict[str, Any]]] = {}
    for track in tracks:
        clips.setdefault(track.path, []).append(
            {
                "name": f".{track.name}",
                "type": track.kind,
                "times": track.times.tolist(),
                "values": track.values.ravel().tolist(),
            }
        )
    # At one frame per second the times of the keys are in seconds.
    animations = [
        {"path": path, "clip": {"fps": 1, "name": "trial", "tracks": entries}}
        for path, entries in clips.items()
    ]
    message = {"type": "set_animation", "animations": animations, "options": {"play": True}, "path": ""}
    # Single precision is finer than any screen, and halves the largest part of a page.
    return Command("animation", umsgpack.packb(message, force_float_precision="single"))
