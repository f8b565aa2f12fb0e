"""Objects of a user's classes for a design: how they are made and called, and the loop of a process that does so.

Petzval starts such a process with the text of this file, so that it needs NumPy alone. A message has 16 bytes (``PTZG``, the length of its header as
``uint32``, that of its body as ``uint64``), a header in JSON, and a body: arrays of ``float32`` in the shapes of the header, then bytes. All numbers are
little-endian. `petzval.guest` says what a class must have.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import math
import os
import struct
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

PROTOCOL = 1
_MAGIC = b"PTZG"
_FRAME = struct.Struct("<4sIQ")
_METHODS = {"network": ("forward", "backward", "step", "save", "load"), "task": ("loss", "score")}

_last: tuple[str, BaseException] | None = None


class _Unusable(Exception):
    """A class that cannot be used."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


class _Answer(Exception):
    """A method gave back what it may not."""


class _Guest:
    """An object with its class."""

    def __init__(self, made: Any, class_name: str) -> None:
        self.made = made
        self.class_name = class_name


def make(header: str) -> tuple[str, _Guest | None]:
    """Makes an object of ``{"class", "role", "arguments"}``. Returns the answer, and the object if there is one."""
    request = json.loads(header)
    class_name: str = request["class"]
    try:
        made = _found(class_name, request["role"])(**request["arguments"])
        about = {"scores": _scores(made, class_name)} if request["role"] == "task" else None
    except _Unusable as error:
        return _error("unusable", str(error), hint=error.hint), None
    except BaseException as error:  # Whatever the user's code raises is reported.
        return _raised("unusable", error, class_name), None
    return json.dumps({"value": about}), _Guest(made, class_name)


def call(
    guest: _Guest, header: str, arrays: list[NDArray[np.float32]], blob: bytes
) -> tuple[str, list[NDArray[np.float32]], bytes]:
    """Calls ``{"method", "number"}`` of an object. Returns the answer, its arrays, and its bytes."""
    request = json.loads(header)
    try:
        value, found, saved = _called(guest.made, request["method"], request.get("number"), arrays, blob)
    except _Answer as error:
        return _error("answer", str(error)), [], b""
    except BaseException as error:  # Whatever the user's code raises is reported.
        return _raised("raised", error, guest.class_name), [], b""
    return json.dumps({"value": value}), found, saved


def cause_of(text: str) -> BaseException | None:
    """The exception of a user's class that this text reports, if it is the last one of this process."""
    global _last
    last, _last = _last, None
    return last[1] if last is not None and last[0] in text else None


def _found(class_name: str, role: str) -> Any:
    """The class of a name, with the methods of a role."""
    module_name, _, name = class_name.partition(":")
    _refuse_run_folders(module_name)
    try:
        found: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module_name}.".startswith(f"{error.name}."):
            raise
        raise _Unusable(
            f"`{class_name}`: Python finds no module `{error.name}`",
            "run Petzval in the folder of the module, or name that folder in PYTHONPATH",
        ) from None
    known = [each for each, value in vars(found).items() if isinstance(value, type) and not each.startswith("_")]
    for part in name.split("."):
        found = getattr(found, part, None)
    if not isinstance(found, type):
        raise _Unusable(f"`{class_name}`: the module has no such class", f"its classes are {', '.join(known) or 'none'}")
    missing = [method for method in _METHODS[role] if not callable(getattr(found, method, None))]
    if missing:
        raise _Unusable(
            f"`{class_name}` lacks {', '.join(f'`{method}`' for method in missing)}",
            f"a {role} has the methods {', '.join(_METHODS[role])}; petzval.guest describes them",
        )
    return found


def is_in_run_folder(path: Path) -> bool:
    """Whether a path lies in the folder of a run. What comes with a run is data, and never code."""
    return any((above / "run.json").is_file() and (above / "config.toml").is_file() for above in (path, *path.parents))


def _refuse_run_folders(module_name: str) -> None:
    top = module_name.partition(".")[0]
    if top in sys.modules:
        places = [getattr(sys.modules[top], "__file__", None), *getattr(sys.modules[top], "__path__", ())]
    else:
        spec = importlib.util.find_spec(top)
        places = [] if spec is None else [spec.origin, *(spec.submodule_search_locations or ())]
    for place in filter(None, places):
        if is_in_run_folder(Path(place).absolute()):
            raise _Unusable(
                f"the module `{top}` lies in the folder of a run: {place}", "classes are never taken from there: move it"
            )


def _scores(made: Any, class_name: str) -> dict[str, dict[str, Any]]:
    scores = getattr(made, "scores", None)
    if not isinstance(scores, Mapping) or not all(isinstance(score, Mapping) for score in scores.values()):
        raise _Unusable(
            f"`{class_name}` describes no `scores`",
            'write scores = {"edge_error": {"higher_is_better": False, "definition": "..."}}, or {} for none',
        )
    return {str(name): dict(score) for name, score in scores.items()}


def _called(
    made: Any, method: str, number: float | None, arrays: list[NDArray[np.float32]], blob: bytes
) -> tuple[Any, list[NDArray[np.float32]], bytes]:
    function = getattr(made, method)
    if method in ("forward", "backward"):
        return None, [_array(function(arrays[0]))], b""
    if method == "step":
        function(number)
        return None, [], b""
    if method == "load":
        function(blob)
        return None, [], b""
    if method == "save":
        saved = function()
        if not isinstance(saved, (bytes, bytearray, memoryview)):
            raise _Answer(f"gives {type(saved).__name__}, not bytes")
        return None, [], bytes(saved)
    given = function(*arrays)
    if method == "loss":
        if not isinstance(given, tuple) or len(given) != 2:
            raise _Answer(f"gives {type(given).__name__}, not the loss and its cotangent by the pictures")
        return _number(given[0]), [_array(given[1])], b""
    if not isinstance(given, Mapping):
        raise _Answer(f"gives {type(given).__name__}, not a dictionary of numbers")
    return {str(name): _number(value) for name, value in given.items()}, [], b""


def _array(given: Any) -> NDArray[np.float32]:
    if given is None:
        raise _Answer("gives NoneType, not an array of real numbers")
    try:
        array = np.asarray(given)
        # Texts and truth values would become numbers that nobody meant.
        if array.dtype.kind in "USObcmM":
            raise TypeError(f"they are of type {array.dtype}")
        with np.errstate(over="ignore"):
            return np.ascontiguousarray(array, dtype=np.float32)
    except (TypeError, ValueError, RuntimeError) as error:
        raise _Answer(f"gives {type(given).__name__}, not an array of real numbers: {error}") from None


def _number(given: Any) -> float | str:
    """A number as JSON has it; one that is not finite as text."""
    try:
        if isinstance(given, str | bytes):
            raise TypeError("a text")
        # A tensor that requires a gradient would warn.
        number = float(given.detach() if hasattr(given, "detach") else given)
    except (TypeError, ValueError):
        raise _Answer(f"gives {type(given).__name__} in place of a number") from None
    return number if math.isfinite(number) else str(number)


def _error(kind: str, message: str, *, hint: str = "", trace: str = "") -> str:
    return json.dumps({"error": {"kind": kind, "message": message, "hint": hint, "traceback": trace}})


def _raised(kind: str, error: BaseException, class_name: str) -> str:
    """An exception of the user's code, with the place of that code."""
    global _last
    here = _raised.__code__.co_filename
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename == here:
        trace = trace.tb_next
    module = sys.modules.get(class_name.partition(":")[0])
    home = str(Path(getattr(module, "__file__", None) or here).parent)
    frames = [frame for frame in traceback.extract_tb(trace) if not frame.filename.startswith("<frozen")]
    # The innermost place in the folder of the class says more than one in a library below it.
    mine = [frame for frame in frames if str(Path(frame.filename).parent) == home] or frames
    said = " ".join(traceback.format_exception_only(type(error), error)[-1].split())
    if isinstance(error, SyntaxError) and error.filename is not None:
        place = f"{Path(error.filename).name}:{error.lineno}"
    elif mine:
        place = f"{Path(mine[-1].filename).name}:{mine[-1].lineno}"
    else:
        place = f"`{class_name}`"
    message = f"{place}: {said}"
    _last = (message, error.with_traceback(trace))
    text = "".join(traceback.format_exception(type(error), error, trace))
    return _error(kind, message, hint="correct the class, or its options in the experiment", trace=text)


def _read(stream: BinaryIO, count: int) -> bytearray | None:
    """So many bytes; ``None`` at the end of the stream."""
    read = bytearray(count)
    view, done = memoryview(read), 0
    while done < count:
        more = stream.readinto(view[done:])  # type: ignore[attr-defined]
        if not more:
            return None
        done += more
    return read


def _receive(stream: BinaryIO) -> tuple[dict[str, Any], list[NDArray[np.float32]], bytes] | None:
    frame = _read(stream, _FRAME.size)
    if frame is None:
        return None
    magic, header_length, body_length = _FRAME.unpack(frame)
    if magic != _MAGIC:
        raise SystemExit("the channel to Petzval is damaged")
    text, body = _read(stream, header_length), _read(stream, body_length)
    if text is None or body is None:
        return None
    header: dict[str, Any] = json.loads(text)
    arrays, at = [], 0
    for shape in header["shapes"]:
        count = math.prod(shape)
        arrays.append(np.frombuffer(body, "<f4", count, at).astype(np.float32, copy=False).reshape(shape))
        at += 4 * count
    return header, arrays, bytes(body[at:])


def _send(stream: BinaryIO, answer: str, arrays: list[NDArray[np.float32]], blob: bytes) -> None:
    header = json.loads(answer) | {"shapes": [array.shape for array in arrays], "bytes": len(blob)}
    text = json.dumps(header).encode()
    parts = [array.astype("<f4", copy=False).tobytes() for array in arrays] + [blob]
    stream.write(_FRAME.pack(_MAGIC, len(text), sum(map(len, parts))))
    stream.write(text)
    for part in parts:
        stream.write(part)
    stream.flush()


def _serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Makes, calls and forgets objects until the channel ends."""
    _send(answers, json.dumps({"value": {"protocol": PROTOCOL, "python": sys.version.split()[0]}}), [], b"")
    guests: dict[int, _Guest] = {}
    while (request := _receive(requests)) is not None:
        header, arrays, blob = request
        text = json.dumps(header)
        if header["verb"] == "make":
            answer, guest = make(text)
            if guest is not None:
                guests[header["id"]] = guest
            _send(answers, answer, [], b"")
        elif header["verb"] == "call":
            _send(answers, *call(guests[header["id"]], text, arrays, blob))
        else:
            guests.pop(header["id"], None)


def main() -> None:
    """The process: requests come from standard input, answers go to standard output. What classes print goes to standard error."""
    requests, answers = os.fdopen(os.dup(0), "rb", 0), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    if sys.stdout is not None:
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    # Modules of the folder in which Petzval runs come last, so that none stands before a library.
    here = Path.cwd()
    sys.path[:] = [place for place in sys.path if place]
    if str(here) not in sys.path and not is_in_run_folder(here):
        sys.path.append(str(here))
    _serve(requests, answers)
