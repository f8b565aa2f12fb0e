"""Exceptions, and how the binary part makes them."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ._worker import cause_of


@dataclass(frozen=True)
class Place:
    """Where something is wrong: an argument or a key, or a place in a file.

    What is not known is ``None`` or empty.
    """

    path: Path | None = None
    line: int | None = None
    column: int | None = None
    key: str = ""
    value: str = ""
    source: str | None = None


class PetzvalError(Exception):
    """Something that Petzval could not do.

    Exceptions go from process to process by pickle, which makes them of their text alone and then sets their attributes. So every other argument
    of a subclass has a default.

    Attributes:
        message: What is wrong.
        place: Where: an argument, or a file with its line.
        hint: What to do; may be empty.
        kind: ``setting``, ``input``, ``file``, ``failed``, ``panic`` or ``stopped``.
    """

    def __init__(
        self, text: str, *, message: str = "", place: Place | None = None, hint: str = "", kind: str = "failed"
    ) -> None:
        super().__init__(f"{text}\nhint: {hint}" if hint else text)
        self.message = message or text
        self.place = place or Place()
        self.hint = hint
        self.kind = kind


class InputError(PetzvalError, ValueError):
    """An argument, a request or a file is wrong."""

    def __init__(
        self, text: str, *, message: str = "", place: Place | None = None, hint: str = "", kind: str = "setting"
    ) -> None:
        super().__init__(text, message=message, place=place, hint=hint, kind=kind)


def setting(key: str, value: str, message: str, hint: str) -> InputError:
    """The error of an argument that cannot be used."""
    place = Place(key=key, value=value)
    named = f"{key} {value}" if value else key
    return InputError(f"{named}: {message}", message=message, place=place, hint=hint, kind="setting")


class Stopped(PetzvalError):
    """A job was cancelled by its flag.

    Attributes:
        kept: The files and folders that it has written, each of them whole.
        resume: The request with which the same job goes on; ``None`` if it begins again.
        response: What was found until then, if that is of use.
    """

    def __init__(self, text: str, *, stopped: dict[str, Any] | None = None, **known: Any) -> None:
        super().__init__(text, **known)
        what = stopped or {}
        self.kept = [Path(path) for path in what.get("kept", [])]
        self.resume: dict[str, Any] | None = what.get("resume")
        self.response: dict[str, Any] | None = what.get("response")


class PetzvalWarning(UserWarning):
    """Something to know before believing a result."""


@dataclass(frozen=True)
class _Report:
    kind: str
    message: str
    place: dict[str, Any] = field(default_factory=dict)
    hint: str = ""
    stopped: dict[str, Any] | None = None


def _in_python(text: str) -> str:
    """A text with keys of requests as arguments of Python."""
    text = text.replace('"overwrite": true', "overwrite=True")
    return re.sub(r"`accept_changed ([^`]*)`", r'`accept_changed=["\1"]`', text)


def of_report(report: str, text: str, is_input: bool) -> PetzvalError:
    """The exception of an error that the binary part reports as JSON. `text` is the whole error on one line."""
    found = _Report(**json.loads(report)) if report else _Report("failed", text)
    hint = _in_python(found.hint)
    if hint:
        # The text of some errors ends with their hint, which has a line of its own here.
        text = text.replace(f" (hint: {found.hint})", "")
    place = dict(found.place)
    if "path" in place:
        place["path"] = Path(place["path"])
    known: dict[str, Any] = {"message": found.message, "place": Place(**place), "hint": hint, "kind": found.kind}
    if found.stopped is not None:
        return Stopped(text, stopped=found.stopped, **known)
    error = (InputError if is_input else PetzvalError)(text, **known)
    error.__cause__ = cause_of(text)
    return error
