"""Linear development: what every simulated picture goes through before a network."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import array_of, count, finite, json_of, positive, shaped, text
from ._errors import setting
from ._watch import watch
from .sensors import SensorLike, sensor_input

__all__ = ["LinearIsp"]

Float32 = NDArray[np.float32]


class LinearIsp:
    """Linear development of the frames of a sensor.

    ::

        raw -> clip highlights to neutral white -> dark level, white balance -> demosaic
            -> / max(illumination, floor) -> end of the highlights -> colour matrix -> linear sRGB

    Args:
        sensor: The sensor: a built-in name, a path, or an object with ``to_toml``. It gives black level, gain and answers to white.
        white_e: Electrons in a green pixel where the picture is white, above 0.
        exposure_s: Exposure time, s; that of `petzval simulate` if left out, as in what follows. The dark signal depends on it.
        linear_gain: Linear analogue gain; 1 is the system gain of the sensor.
        row: Sensor row of the first pixel: it sets the phase of the mosaic.
        col: Sensor column of the first pixel.
        demosaic: Method of demosaicing; bilinear if left out. Arrays other than Bayer's take no other. ``rcd`` has no gradient.
        domain: Values between which colours are interpolated; ``linear`` light if left out.
        shading_floor: Relative illumination, above 0 to 1, below which shading is not corrected further.
        colour_matrix: Linear sRGB from white-balanced camera colours, ``[3, 3]``; the camera's own colours if left out.

    Raises:
        InputError: There is no such sensor, or an argument is out of its range.
    """

    def __init__(
        self,
        sensor: SensorLike,
        *,
        white_e: float,
        exposure_s: float | None = None,
        linear_gain: float | None = None,
        row: int = 0,
        col: int = 0,
        demosaic: Literal["bilinear", "malvar", "rcd", "menon"] | None = None,
        domain: Literal["linear", "stabilised"] | None = None,
        shading_floor: float | None = None,
        colour_matrix: ArrayLike | None = None,
    ) -> None:
        self._plan = json_of(
            "isp",
            {
                "sensor": sensor_input(sensor),
                "white_e": positive("white_e", white_e, "electrons, above 0"),
                "exposure_s": finite("exposure_s", exposure_s),
                "linear_gain": finite("linear_gain", linear_gain),
                "row": count("row", row, "count from 0"),
                "col": count("col", col, "count from 0"),
                "demosaic": None if demosaic is None else text("demosaic", demosaic, "the name of a method"),
                "domain": None if domain is None else text("domain", domain, '"linear" or "stabilised"'),
                "shading_floor": finite("shading_floor", shading_floor),
                "colour_matrix": shaped("colour_matrix", colour_matrix, (3, 3)),
            },
            "numbers and texts",
        )
        with watch() as watching:
            self._core = _petzval.LinearIsp(self._plan, watching)

    def develop(self, raw: ArrayLike, illumination: ArrayLike | None = None) -> Float32:
        """Develops a raw frame to linear light, 1 = white.

        Args:
            raw: Digital numbers, ``[y, x]``; they need not be whole.
            illumination: Relative illumination that the lens gives the pixels, ``[y, x, 3]``; none leaves the shading.

        Returns:
            The picture, linear sRGB, ``[y, x, 3]``. Noise can make values negative.

        Raises:
            InputError: A shape is wrong, or a value is not finite.
        """
        numbers = array_of("raw", raw, np.float32)
        light = _light(illumination, (*numbers.shape, 3))
        if numbers.ndim != 2 or light.shape != (*numbers.shape, 3):
            shapes = f"{numbers.shape} and {light.shape}"
            raise setting("raw", f"and illumination of shapes {shapes}", "do not fit", "give [y, x] and [y, x, 3]")
        with watch() as watching:
            picture = self._core.develop(numbers[None], np.moveaxis(light, -1, 0)[None], watching)
        return np.moveaxis(picture[0], 0, -1)

    def pull_back(
        self, raw: ArrayLike, cotangent: ArrayLike, illumination: ArrayLike | None = None
    ) -> tuple[Float32, Float32]:
        """Derivatives of a loss by raw frame and illumination, by Petzval's adjoints.

        Args:
            raw: As of `develop`.
            cotangent: Derivatives of the loss by the picture that `develop` returns, ``[y, x, 3]``.
            illumination: As of `develop`.

        Returns:
            Derivatives by the digital numbers, 1/DN, ``[y, x]``, and by the illumination, ``[y, x, 3]``.
        """
        numbers, planes = array_of("raw", raw, np.float32), array_of("cotangent", cotangent, np.float32)
        light = _light(illumination, planes.shape)
        if numbers.ndim != 2 or planes.shape != (*numbers.shape, 3) or light.shape != planes.shape:
            shapes = f"{numbers.shape}, {planes.shape} and {light.shape}"
            hint = "give [y, x], [y, x, 3] and [y, x, 3]"
            raise setting("raw", f"cotangent and illumination of shapes {shapes}", "do not fit", hint)
        light, planes = np.moveaxis(light, -1, 0), np.moveaxis(planes, -1, 0)
        with watch() as watching:
            by_raw, by_light = self._core.pull_back(numbers[None], light[None], planes[None], watching)
        return by_raw[0], np.moveaxis(by_light[0], 0, -1)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LinearIsp) and self._plan == other._plan

    def __hash__(self) -> int:
        return hash(self._plan)

    def __reduce__(self) -> tuple[object, ...]:
        return _again, (self._plan,)


def _again(plan: str) -> LinearIsp:
    isp = LinearIsp.__new__(LinearIsp)
    isp._plan = plan
    with watch() as watching:
        isp._core = _petzval.LinearIsp(plan, watching)
    return isp


def _light(illumination: ArrayLike | None, shape: tuple[int, ...]) -> Float32:
    """Relative illumination; 1 everywhere if it is left out."""
    return np.ones(shape, np.float32) if illumination is None else array_of("illumination", illumination, np.float32)
