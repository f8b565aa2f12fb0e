"""Pictures on their way in."""

from __future__ import annotations

import base64
import html
import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import check_unmasked
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
        return os.fspath(picture)
    check_unmasked(name, picture)
    try:
        array = np.asarray(picture)
    except (ValueError, TypeError) as error:
        raise _wrong(name, type(picture).__name__, "is no picture") from error
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise _wrong(name, f"of shape {list(array.shape)}", "is no picture")
    if array.dtype == np.uint8:
        return array
    if array.dtype.kind != "f":
        raise _wrong(name, f"of type {array.dtype}", "is no picture")
    with np.errstate(over="ignore"):
        light = array.astype(np.float32, copy=False)
    light_is_wrong = ~(np.isfinite(light) & (light >= 0))
    if light_is_wrong.any():
        at = np.unravel_index(int(np.argmax(light_is_wrong)), light.shape)
        raise _wrong(f"{name}[{at[0]}, {at[1]}, {at[2]}]", str(array[at]), "is no light")
    return light


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """Reads a picture file into linear light, ``[y, x, 3]``, 1 is white.

    Integer samples are taken as sRGB-encoded, floating-point ones as linear. Alpha is laid over black; EXIF's orientation is obeyed.

    Raises:
        InputError: The file cannot be read.
    """
    with watch() as watching:
        return _petzval.read_picture(os.fspath(path), watching)


def figure(picture: NDArray[np.uint8], caption: str) -> str:
    """A picture ``[y, x, 3]``, sRGB-encoded, as HTML: at most 800 pixels a side, by leaving some out."""
    step = -(-max(picture.shape[:2]) // 800)
    png = bytes(_petzval.picture_png(np.ascontiguousarray(picture[::step, ::step])))
    data = base64.b64encode(png).decode("ascii")
    text = html.escape(caption)
    return f'<figure><img alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption></figure>'


def _wrong(key: str, value: str, message: str) -> InputError:
    return setting(key, value, message, _RIGHT)
