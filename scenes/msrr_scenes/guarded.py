"""Guards around objects of classes that a scene names by import path: calls are watched, results checked."""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from msrr_scenes.errors import ProgramFailedError, StoppedError

#: Checks what a member gave: called with its result and the arguments of the call. It returns the result to
#: pass on, or raises ValueError with what the result is and what was expected.
Check = Callable[..., Any]

#: Longest description of an error, and longest reason, that is passed on [characters].
_LONGEST = 300

_MISSING = object()


def no_result(_: object, *__: object) -> None:
    """Check of a method that returns nothing; whatever it does return is dropped."""


def of_the_same_kind(result: object, *_: object) -> object:
    """Check of a method that returns another object of the same protocol, which is guarded as well."""
    return result


def numpy_errors() -> AbstractContextManager[object]:
    """Return a block at whose end NumPy's errors are treated as before, whatever a class has made of them."""
    import numpy as np  # not with the module, which the help of a command loads as well

    return np.errstate()


class Guarded:
    """An object of a user's class, of which the rest of the program sees nothing but a protocol.

    An exception in the class, or a result that its protocol does not allow, becomes a
    :class:`ProgramFailedError` that names the class, the method, the file and the line. An optional member
    that the class does not have is missing here too.
    """

    __slots__ = ("_checks", "_inner", "_kind", "_name")

    def __init__(self, kind: str, name: str, inner: object, checks: Mapping[str, Check]) -> None:
        """Guard an object, with the check of each member of its protocol.

        Messages have the kind of the extension point, ``detector``, ``renderer`` ..., and the import path of
        the class as the name.
        """
        self._kind, self._name, self._inner, self._checks = kind, name, inner, checks

    def __getattr__(self, member: str) -> Any:
        if member.startswith("_") or member not in self._checks:
            raise AttributeError(member)
        if inspect.getattr_static(self._inner, member, _MISSING) is _MISSING:
            raise AttributeError(member)
        found = self._watched(member, getattr, self._inner, member)
        if not callable(found):
            return self._checked(member, found)

        def call(*args: Any, **kwargs: Any) -> Any:
            return self._checked(member, self._watched(member, found, *args, **kwargs), *args)

        return call

    def _watched(self, member: str, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        try:
            with numpy_errors():
                return function(*args, **kwargs)
        except (KeyboardInterrupt, StoppedError):
            raise
        except BaseException as error:
            raise failure(self._kind, self._name, type(self._inner), member, error) from error

    def _checked(self, member: str, result: Any, *args: Any) -> Any:
        check = self._checks[member]
        try:
            if check is of_the_same_kind:
                if result is self._inner:
                    return self
                self._check_kind(result)
                return Guarded(self._kind, self._name, result, self._checks)
            return check(result, *args)
        except ValueError as error:
            place = _definition(type(self._inner), member)
            raise ProgramFailedError(
                f"{self._kind} {self._name!r}, {place}: {member} returned {error}"
            ) from None
        except (KeyboardInterrupt, StoppedError):
            raise
        except BaseException as error:  # such as one in the result's own methods
            raise failure(self._kind, self._name, type(self._inner), member, error) from error

    def _check_kind(self, result: object) -> None:
        members = [name for name, check in self._checks.items() if check is not of_the_same_kind]
        if any(inspect.getattr_static(result, name, _MISSING) is _MISSING for name in members):
            wrong(result, f"a {self._kind} with {', '.join(members)}")


def unguarded(built: object) -> object:
    """Return the object of a user's class itself, for use outside of a trial."""
    return built._inner if isinstance(built, Guarded) else built


def called_in(frame: FrameType | None) -> str | None:
    """Return which guarded object was called in the innermost frame or around it, and where; None if none."""
    inner: list[tuple[str | None, int | None]] = []
    while frame is not None:
        if frame.f_code is Guarded._watched.__code__:
            guard = frame.f_locals["self"]
            own_file = file_of(type(guard._inner))
            own = [place for place in inner if place[0] == own_file] or inner
            return f"{guard._kind} {guard._name!r}, {_place(*own[0])}" if own else None
        inner.append((frame.f_code.co_filename, frame.f_lineno))
        frame = frame.f_back
    return None


def failure(kind: str, name: str, cls: type, member: str, error: BaseException) -> ProgramFailedError:
    """Return the error that names the place in a user's class at which ``error`` was raised."""
    if isinstance(error, ProgramFailedError):
        return error  # from another guarded object, and already named
    trace = error.__traceback__
    called = trace is None or trace.tb_next is not None  # else it was the call itself that does not fit
    place = raised_at(error, file_of(cls)) if called else _definition(cls, member)
    text = in_one_line(error)
    if not place.startswith(_file_name(cls)):  # in what the class inherits, or calls
        place, text = _definition(cls, member), f"{text}, at {place}"
    return ProgramFailedError(f"{kind} {name!r}, {place}: {member} raised {text}")


def wrong(result: object, expected: str) -> NoReturn:
    """Refuse a result.

    Raises:
        ValueError: The result in a few words, and what was expected.
    """
    raise ValueError(f"{plain_text(repr(result), 80)}; expected {expected}")


def in_one_line(error: BaseException) -> str:
    """Return type and message of an exception in one line, the same in every process."""
    if isinstance(error, SyntaxError):  # without the folder of its file
        return plain_text(f"{type(error).__name__}: {error.msg}")
    return plain_text("".join(traceback.format_exception_only(error)))


def raised_at(error: BaseException, own_file: str | None) -> str:
    """Return file and line of the innermost frame in ``own_file``, else of the innermost frame of all.

    A mistake of syntax is where it stands: no frame of that file exists.
    """
    if isinstance(error, SyntaxError) and error.filename is not None:
        return _place(error.filename, error.lineno)
    frames = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    known = [place for place in frames if not place[0].startswith("<frozen")]  # those of the import itself
    inside = [place for place in known if own_file is not None and place[0].endswith(own_file)] or known
    return _place(*inside[-1]) if inside else _place(own_file, None)


def _definition(cls: type, member: str) -> str:
    """Return file and line of a method or property, else of its class, also if it inherits the method."""
    found: Any = inspect.getattr_static(cls, member, None)
    function = found.fget if isinstance(found, property) else getattr(found, "__func__", found)
    code = getattr(function, "__code__", None)
    if code is not None and code.co_filename.endswith(_file_name(cls)):
        return _place(code.co_filename, code.co_firstlineno)
    try:
        return _place(file_of(cls), inspect.getsourcelines(cls)[1])
    except (OSError, TypeError):  # no source
        return _place(file_of(cls), None)


def file_of(cls: type) -> str | None:
    """Return the file that a class is defined in; None if it is built in."""
    return getattr(sys.modules.get(cls.__module__), "__file__", None)


def _file_name(cls: type) -> str:
    """Return the name of the file that a class is defined in; empty if it is built in."""
    return Path(file_of(cls) or "").name


def _place(file: str | None, line: int | None) -> str:
    """Return a place without its folder, so that logs do not depend on where a program was run."""
    name = Path(file).name if file is not None else "built in"
    return name if line is None else f"{name} line {line}"


def plain_text(text: str, longest: int = _LONGEST) -> str:
    """Return a text in one line that can be written, without addresses, which differ between processes.

    What no terminal prints, such as a control character that it would obey, is written as an escape.
    """
    text = re.sub(r"0x[0-9a-fA-F]{6,}", "0x...", " ".join(text.split()))
    text = "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."
