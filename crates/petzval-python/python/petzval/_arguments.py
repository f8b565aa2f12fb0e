"""Arguments on their way in. Each check names the argument, its value and what is right."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import InputError, Place, setting

Array = NDArray[np.float64]
T = TypeVar("T")


def of_class(name: str, value: Any, kind: type[T] | tuple[type[T], ...], hint: str) -> T:
    """A value of this class, or of one of these.

    Raises:
        InputError: It is of another one.
    """
    if not isinstance(value, kind):
        raise _wrong_type(name, value, hint)
    return value


def text(name: str, value: Any, hint: str = "a text") -> str:
    """A text that UTF-8 can hold."""
    found = of_class(name, value, str, hint)
    try:
        found.encode()
    except UnicodeEncodeError as error:
        raise setting(name, _shown(found), "is no UTF-8", hint) from error
    return found


def flag(name: str, value: Any) -> bool:
    """True or false, also that of NumPy. Numbers and texts are none: ``"no"`` would be true."""
    return bool(of_class(name, value, (bool, np.bool_), "True or False"))


def path_of(name: str, value: Any) -> str:
    """A path.

    Raises:
        InputError: It is none.
    """
    if isinstance(value, str | os.PathLike):
        path = os.fspath(value)
        if isinstance(path, str):
            return text(name, path, "give the file or folder another name")
    raise _wrong_type(name, value, "a path, or the name of something built in, as text or pathlib.Path")


def paths_of(name: str, values: Any) -> list[str]:
    """Paths; one alone stands for a list of it."""
    if isinstance(values, str | os.PathLike):
        return [path_of(name, values)]
    if not isinstance(values, Iterable):
        raise _wrong_type(name, values, "a list of paths")
    return [path_of(f"{name}[{place}]", value) for place, value in enumerate(values)]


def real(name: str, value: Any, hint: str = "a number") -> float:
    """A number, also one of NumPy or a tensor of one element."""
    if isinstance(value, str | bytes | bool | complex):
        raise _wrong_type(name, value, hint)
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise _wrong_type(name, value, hint) from error


def finite(name: str, value: Any) -> float | None:
    """A finite number, or ``None``."""
    return None if value is None else not_infinite(name, value, "give a finite number")


def not_infinite(name: str, value: Any, hint: str) -> float:
    """A finite number."""
    number = real(name, value, hint)
    if not np.isfinite(number):
        raise setting(name, str(value), "is not finite", hint)
    return number


def positive(name: str, value: Any, hint: str) -> float:
    """A finite number above 0."""
    number = not_infinite(name, value, hint)
    if number <= 0.0:
        raise setting(name, str(value), "is not positive", hint)
    return number


def not_negative(name: str, value: Any, hint: str) -> float:
    """A finite number, 0 or above."""
    number = not_infinite(name, value, hint)
    if number < 0.0:
        raise setting(name, str(value), "is negative", hint)
    return number


def shaped(name: str, values: ArrayLike | None, shape: tuple[int, ...]) -> Any:
    """Finite numbers of a known shape as lists, or ``None``."""
    if values is None:
        return None
    array = reals(name, values)
    if array.shape != shape:
        raise setting(name, f"of shape {array.shape}", f"has the shape {array.shape}", f"give {shape}")
    if not np.isfinite(array).all():
        raise setting(name, str(array), "is not finite", "give finite numbers")
    return array.tolist()


def count(name: str, value: Any, hint: str = "a whole number, 0 or above") -> int:
    """A whole number, 0 to 2^63 - 1, also one of NumPy."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise _wrong_type(name, value, hint)
    if not 0 <= value < 2**63:
        raise setting(name, str(value), "is negative" if value < 0 else "is too large", hint)
    return int(value)


def pair(name: str, value: Any) -> tuple[int, int]:
    """Rows and columns: two whole numbers, 0 or above."""
    if isinstance(value, (tuple, list, np.ndarray)) and len(value) == 2:
        return count(name, value[0]), count(name, value[1])
    raise setting(name, _shown(value), "not two whole numbers", "rows and columns")


def array_of(name: str, values: Any, kind: Any) -> NDArray[Any]:
    """Real numbers as an array of this type.

    Raises:
        InputError: Some are masked, or they are no real numbers.
    """
    array = _numbers(name, values, "give numbers")
    # A number beyond the type is infinite, which is refused by name where it counts.
    with np.errstate(over="ignore"):
        return array.astype(kind, copy=False)


def check_unmasked(name: str, values: Any) -> None:
    """Fails if some values are masked: as a plain array they would count again.

    Raises:
        InputError: They are.
    """
    masked = int(np.sum(values.mask)) if isinstance(values, np.ma.MaskedArray) else 0
    if masked > 0:
        raise setting(name, f"with {masked} masked values", "masks some of its values", "fill them in, such as by filled(0.0), or leave them out")


def reals(name: str, values: ArrayLike, *axes: str) -> Array:
    """Numbers as an array of these axes, or of any. For one axis a single number will do.

    Raises:
        InputError: They are no real numbers, or have other axes.
    """
    hint = f"give numbers, [{', '.join(axes)}]" if axes else "give numbers"
    array = _numbers(name, values, hint)
    if array.ndim == 0 and len(axes) == 1:
        array = array.reshape(1)
    if axes and array.ndim != len(axes):
        raise setting(name, f"of shape {array.shape}", f"has {array.ndim} axes", hint)
    return array.astype(np.float64, copy=False)


def made_by(core: Any, kind: type[T], how: str) -> T:
    """The binary part of an object, which is made by functions and not by its class.

    Raises:
        InputError: It is something else, such as a path.
    """
    return of_class(kind.__name__, core, kind, f"make it by {how}")


def not_written(file: Path, error: OSError | ValueError) -> InputError:
    """The error of a file that cannot be written."""
    message = getattr(error, "strerror", None) or str(error)
    place = Place(path=file, key="path")
    return InputError(f"{file}: {message}", message=message, place=place, hint="name a file that can be written", kind="file")


@contextmanager
def placed(name: str, path: str, hint: str) -> Iterator[None]:
    """Gives an error of a named file or built-in thing its place and a hint, if it has none."""
    try:
        yield
    except InputError as error:
        if error.place == Place():
            error.place = Place(path=Path(path), key=name, value=path)
        if not error.hint:
            error.hint, error.args = hint, (f"{error}\nhint: {hint}",)
        raise


def json_of(name: str, value: Any, hint: str) -> str:
    """A value as JSON for the binary part; paths, and numbers and arrays of NumPy, are as JSON has them.

    Raises:
        InputError: JSON cannot hold something in it.
    """
    try:
        return json.dumps(value, default=_plain, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        # The words of the library for NaN and infinity are about JSON.
        why = "it holds a number that is not finite" if "JSON compliant" in str(error) else str(error)
        raise setting(name, "", why, hint) from error


def _plain(value: Any) -> Any:
    """Paths, and numbers and arrays of NumPy, as JSON has them."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    for method in ("tolist", "item"):
        if hasattr(value, method):
            return getattr(value, method)()
    raise TypeError(f"{type(value).__name__} cannot stand in it")


def _numbers(name: str, values: Any, hint: str) -> NDArray[Any]:
    """Real numbers as an array of their own type."""
    check_unmasked(name, values)
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, RuntimeError) as error:
        raise _wrong_type(name, values, hint) from error
    if array.dtype.kind not in "fiu" and array.size > 0:
        raise setting(name, f"of type {array.dtype}", "holds no real numbers", hint)
    return array


def _shown(value: Any) -> str:
    shown = ascii(value) if isinstance(value, str) and not value.isprintable() else repr(value)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."


def _wrong_type(name: str, value: Any, hint: str) -> InputError:
    return setting(name, _shown(value), f"is of the type {type(value).__name__}", hint)
