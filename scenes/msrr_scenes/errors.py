"""The exceptions that this project raises on purpose, all under one root.

An exception means misuse (a bad scene, an unknown name, a missing file). A docking that fails is not an
exception: it is an :class:`msrr_scenes.outcome.Outcome`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping


class MsrrError(Exception):
    """The root of all errors raised by msrr packages; its text names the place and the mend."""


class StoppedError(BaseException):
    """Ends the work from outside, as a signal or a limit does: no failure of what was being called.

    It and KeyboardInterrupt pass through a class of a user's own; what else such a class raises is its own.
    """


class SceneError(MsrrError):
    """A scene that cannot be used as written."""


class PlacementError(SceneError):
    """A scene in which no start is found for one seed; there may be one for others."""


class ChangedFileError(MsrrError):
    """A file that a scene names was written while it was in use; what was run with it counts for nothing."""


class ProgramFailedError(MsrrError):
    """The program of a unit cannot go on: a class that the scene names failed, or gave an impossible result.

    In a trial it is not misuse that ends the work, but the outcome ``program_failed``.
    """


class ParameterError(SceneError):
    """Parameters that an implementation does not take.

    Attributes:
        faults: What is wrong with each, by its dotted name; the empty name stands for all of them.
    """

    def __init__(self, faults: Mapping[str, str]) -> None:
        super().__init__(faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(f"{name}: {text}" if name else text for name, text in self.faults.items())


class MissingPackageError(MsrrError):
    """An optional package that an implementation needs is not installed."""


class GeometryError(MsrrError):
    """A unit description (URDF) that lacks a named frame or contradicts itself."""


def nearest(name: object, valid: Iterable[str], likeness: float = 0.6) -> str:
    """Return ``; did you mean 'x'?`` for the valid name x most like ``name``, or a full stop.

    ``likeness`` is the share of their letters that have to be the same, in the same order.
    """
    near = difflib.get_close_matches(str(name), list(valid), n=1, cutoff=likeness)
    return f"; did you mean {near[0]!r}?" if near else "."


#: Mend of a decimal comma, which separates entries in YAML.
DECIMAL_POINT = "; a decimal fraction has a point, as in 0.5"


def nearest_key(key: object, valid: Iterable[str], likeness: float = 0.6) -> str:
    """Return what :func:`nearest` does, of ``x`` that it is ``x_m``, and of a number the mend.

    A number is a key where a decimal comma separates it, such as the 3 of ``{x_m: 0,3}``.
    """
    if str(key).isdecimal():
        return f"{DECIMAL_POINT}."
    keys = list(valid)
    with_unit = [each for each in keys if each.startswith(f"{key}_")]
    if with_unit:
        return nearest(min(with_unit, key=len), with_unit)
    return nearest(key, keys, likeness)


class UnknownNameError(MsrrError):
    """A name that belongs to no registered or importable implementation."""

    def __init__(self, kind: str, name: str, valid: Iterable[str], hint: str = "", key: str = "") -> None:
        """Compose the message about a name that was meant to be a ``kind``: ``detector``, ``scene`` ...

        ``hint`` is a sentence about what else could be given, and ``key`` the dotted key of a scene that has
        the name, if one has.
        """
        names = sorted(valid)
        text = f"unknown {kind} {name!r}{nearest(name, names)} Known: {', '.join(names) or 'none'}. {hint}"
        super().__init__(f"{key}: {text}".removeprefix(": ").rstrip())

    def __reduce__(self) -> tuple[Callable[..., BaseException], tuple[type[BaseException], str]]:
        # An exception is unpickled, in the process that asked for the trial, from its text alone.
        return BaseException.__new__, (type(self), str(self))
