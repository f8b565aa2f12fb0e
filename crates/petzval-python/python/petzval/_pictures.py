"""Pictures on their way in."""

from __future__ import annotations

import base64
import html
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import check_unmasked, path_of
from ._errors import InputError, setting
from ._watch import watch

__all__ = ["Picture", "read_picture"]

Picture = str | os.PathLike[str] | ArrayLike
"""A picture: a path (PNG, JPEG, TIFF, WebP, BMP; OpenEXR and Radiance HDR in linear light), or an array ``[y, x, 3]`` of red, green and blue.

Bytes (``uint8``) are sRGB-encoded, 255 is white. Floats are linear light, 1 is white, and may exceed 1.
"""

Given = str | NDArray[np.uint8] | NDArray[np.float32]
"""A picture as the binary part takes it."""

_RIGHT = "a path, or an array [y, x, 3]: uint8 is sRGB-encoded, floats are linear light where 1 is white"


def given(picture: Picture, name: str = "picture") -> Given:
    """A checked picture.

    Raises:
        InputError: An array has another shape or type, is empty, or holds a number that is negative or not finite.
    """
    if isinstance(picture, str | os.PathLike):
        return path_of(name, picture)
    array = _array(name, picture, _RIGHT)
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise _wrong(name, f"of shape {list(array.shape)}", "is no picture")
    if array.dtype == np.uint8:
        return array
    light = light_of(name, array)
    light_is_wrong = ~(np.isfinite(light) & (light >= 0))
    if light_is_wrong.any():
        at = np.unravel_index(int(np.argmax(light_is_wrong)), light.shape)
        raise _wrong(f"{name}[{at[0]}, {at[1]}, {at[2]}]", str(array[at]), "is no light")
    return light


def light_of(name: str, picture: ArrayLike, hint: str = _RIGHT) -> NDArray[np.float32]:
    """Linear light of an array of any shape: ``uint8`` is decoded, floats are light already.

    Raises:
        InputError: It is of another type: what number would be white?
    """
    array = _array(name, picture, hint)
    if array.dtype == np.uint8:
        decoded: NDArray[np.float32] = _DECODED[array]
        return decoded
    if array.dtype.kind != "f":
        raise setting(name, f"of type {array.dtype}", "is no picture", hint)
    # A number beyond the type is infinite, which is refused by name.
    with np.errstate(over="ignore"):
        return array.astype(np.float32, copy=False)


def _array(name: str, picture: ArrayLike, hint: str) -> NDArray[Any]:
    check_unmasked(name, picture)
    try:
        return np.asarray(picture)
    except (ValueError, TypeError, RuntimeError) as error:
        raise setting(name, type(picture).__name__, "is no picture", hint) from error


def _decoded() -> NDArray[np.float32]:
    """The light of each byte, by the sRGB curve of IEC 61966-2-1."""
    encoded = np.arange(256) / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)


_DECODED = _decoded()


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """Reads a picture file into linear light, ``[y, x, 3]``, 1 is white.

    Integer samples are taken as sRGB-encoded, floating-point ones as linear. Alpha is laid over black; EXIF's orientation is obeyed.

    Raises:
        InputError: The file cannot be read.
    """
    with watch() as watching:
        return _petzval.read_picture(path_of("path", path), watching)


def figure(picture: NDArray[np.uint8], caption: str) -> str:
    """A picture ``[y, x, 3]``, sRGB-encoded, as HTML: at most 800 pixels a side, by leaving some out."""
    step = -(-max(picture.shape[:2]) // 800)
    png = bytes(_petzval.picture_png(np.ascontiguousarray(picture[::step, ::step])))
    data = base64.b64encode(png).decode("ascii")
    text = html.escape(caption)
    return f'<figure><img alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption></figure>'


def _wrong(key: str, value: str, message: str) -> InputError:
    return setting(key, value, message, _RIGHT)
