"""Arguments on their way in. Each check names the argument, its value and what is right."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import InputError, setting

Array = NDArray[np.float64]
T = TypeVar("T")


def path_of(name: str, value: Any) -> str:
    """A path.

    Raises:
        InputError: It is none.
    """
    if isinstance(value, str | os.PathLike):
        path = os.fspath(value)
        if isinstance(path, str):
            try:
                path.encode()
            except UnicodeEncodeError as error:
                raise setting(name, repr(path), "is no UTF-8", "give the file or folder another name") from error
            return path
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
    if value is None:
        return None
    number = real(name, value)
    if not np.isfinite(number):
        raise setting(name, str(value), "is not finite", "give a finite number")
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


def array_of(name: str, values: Any, kind: Any) -> NDArray[Any]:
    """Values as an array of this type.

    Raises:
        InputError: Some are masked.
    """
    check_unmasked(name, values)
    return np.asarray(values, dtype=kind)


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
    check_unmasked(name, values)
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise _wrong_type(name, values, hint) from error
    if array.dtype.kind not in "fiu" and array.size > 0:
        raise setting(name, f"of type {array.dtype}", "holds no real numbers", hint)
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
    if not isinstance(core, kind):
        raise _wrong_type(kind.__name__, core, f"make it by {how}")
    return core


def _wrong_type(name: str, value: Any, hint: str) -> InputError:
    shown = repr(value)
    shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
    return setting(name, shown, f"is of the type {type(value).__name__}", hint)
