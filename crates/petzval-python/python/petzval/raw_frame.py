"""Raw frames as an image signal processor takes them."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import array_of, count, finite, flag, json_of, of_class, path_of, reals, shaped, text
from ._errors import setting
from ._watch import watch
from .sensors import SensorLike, sensor_input

__all__ = ["FrameInfo", "RawFrame"]


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameInfo:
    """What is known of a raw frame beside its digital numbers (DN).

    Needed are `bits`, `cfa` and `black_level_dn`, or a `sensor`, which gives them. Light is counted in units of white.

    Attributes:
        bits: Bits of a number, 8 to 24.
        cfa: Colours of the Bayer array from the first pixel on: ``"RGGB"``, ``"GRBG"``, ``"GBRG"`` or ``"BGGR"``.
        black_level_dn: Number without light, DN.
        white_level_dn: Number of saturation, DN; the largest number if left out.
        sensor: Sensor that gives noise, response to white and saturation where the calibration does not state them: a built-in name, a path, or an object with ``to_toml``.
        exposure_s: Exposure time, s: the dark signal of the sensor depends on it.
        linear_gain: Linear analogue gain, 1 = the system gain of the sensor.
        white_e: Electrons of white in a green pixel; needs a sensor. It gives `white_dn`, and `black_dn` where that is left out.
        black_dn: Mean number of a dark pixel, DN; takes precedence over `black_level_dn`.
        white_dn: Number of white light in a green pixel, DN; that of saturation if left out.
        response: Answers of red, green and blue pixels to white light, relative to green, 0.01 to 100. The white balance divides by them.
        saturation: Light at which the first colour saturates under white light.
        noise: Variance of the light of a green pixel, ``shot * light + read``: shot and read.
        gain_ev: Gain above the lowest, EV: presets set parameters by it. That of `linear_gain` if left out.
        colour_matrix: Linear sRGB from white-balanced camera colours, ``[3, 3]``; the camera's own colours if left out.
        shading: Relative illumination at the nodes of a mesh over the frame, red, green and blue, ``[3, rows, cols]``, above 0.
        warp: Where to fetch each pixel of a picture without distortion: displacements along y and x, pixels, ``[2, rows, cols]``.
        companding: Knots of companded and of linear numbers, ascending from 0; numbers are linear in light if left out.
        auto_balance: Whether to estimate the white balance from the frame.
        auto_exposure: Whether to estimate from the frame what is white.
    """

    bits: int | None = None
    cfa: str | None = None
    black_level_dn: float | None = None
    white_level_dn: float | None = None
    sensor: SensorLike | None = None
    exposure_s: float | None = None
    linear_gain: float | None = None
    white_e: float | None = None
    black_dn: float | None = None
    white_dn: float | None = None
    response: Sequence[float] | None = None
    saturation: float | None = None
    noise: tuple[float, float] | None = None
    gain_ev: float | None = None
    colour_matrix: ArrayLike | None = None
    shading: ArrayLike | None = None
    warp: ArrayLike | None = None
    companding: tuple[Sequence[int], Sequence[int]] | None = None
    auto_balance: bool = False
    auto_exposure: bool = False

    def _json(self) -> str:
        """What the binary part reads of it."""
        noise = shaped("noise", self.noise, (2,))
        about = {
            "info": {
                "bits": None if self.bits is None else count("bits", self.bits, "a whole number, 8 to 24"),
                "cfa": None if self.cfa is None else text("cfa", self.cfa, '"RGGB", "GRBG", "GBRG" or "BGGR"'),
                "black_level_dn": finite("black_level_dn", self.black_level_dn),
                "white_level_dn": finite("white_level_dn", self.white_level_dn),
                "exposure_s": finite("exposure_s", self.exposure_s),
                "linear_gain": finite("linear_gain", self.linear_gain),
                "companding": _knots(self.companding),
            },
            "calibration": {
                "black_dn": finite("black_dn", self.black_dn),
                "white_dn": finite("white_dn", self.white_dn),
                "response": shaped("response", self.response, (3,)),
                "saturation": finite("saturation", self.saturation),
                "gain_ev": finite("gain_ev", self.gain_ev),
                "colour_matrix": shaped("colour_matrix", self.colour_matrix, (3, 3)),
                "noise": None if noise is None else {"shot": noise[0], "read": noise[1]},
                "shading": _mesh("shading", self.shading, 3),
                "warp": _mesh("warp", self.warp, 2),
            },
            "options": {
                "sensor": None if self.sensor is None else sensor_input(self.sensor),
                "auto_balance": flag("auto_balance", self.auto_balance),
                "auto_exposure": flag("auto_exposure", self.auto_exposure),
            },
            "white_e": finite("white_e", self.white_e),
        }
        return json_of("info", about, "numbers, texts and arrays")


class RawFrame:
    """A raw frame with all that an image signal processor knows of it. It never changes.

    Args:
        values: Digital numbers, ``[y, x]``, 0 to 2^bits - 1; fractions are rounded. Sides are even and at least 16.
        info: What is known of them.

    Raises:
        InputError: A number is none, or does not fit in the bits; or something needed is not known.
    """

    def __init__(self, values: ArrayLike, info: FrameInfo) -> None:
        about = _checked(info)._json()
        numbers = reals("values", values, "y", "x")
        with watch() as watching:
            self._core = _petzval.RawFrame.of_numbers(numbers, about, watching)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        sensor: SensorLike | None = None,
        white_dn: float | None = None,
        auto_balance: bool = False,
        auto_exposure: bool = False,
    ) -> RawFrame:
        """Reads a raw file (TIFF, PNG, NPY, packed, DNG) with its sidecar and calibration, as ``petzval isp develop`` does.

        Args:
            path: The file; its sidecar is the TOML file of the same name with ``.toml`` appended.
            sensor: The sensor, after what the calibration states; the built-in one that the sidecar names if left out.
            white_dn: Number of white light in a green pixel, DN; that of the calibration, or of saturation, if left out.
            auto_balance: Whether to estimate the white balance from the frame.
            auto_exposure: Whether to estimate from the frame what is white.

        Raises:
            InputError: The file, its sidecar or its calibration is wrong; the place is in the error.
        """
        options = {
            "sensor": None if sensor is None else sensor_input(sensor),
            "white_dn": finite("white_dn", white_dn),
            "auto_balance": flag("auto_balance", auto_balance),
            "auto_exposure": flag("auto_exposure", auto_exposure),
        }
        with watch() as watching:
            return cls._of(_petzval.RawFrame.load(path_of("path", path), json.dumps(options), watching))

    @classmethod
    def like(cls, info: FrameInfo) -> RawFrame:
        """What is known of frames that come later: it has no pixels, and `petzval.torch` develops tensors by it."""
        about = _checked(info)._json()
        with watch() as watching:
            return cls._of(_petzval.RawFrame.like(about, watching))

    @classmethod
    def _of(cls, core: _petzval.RawFrame) -> RawFrame:
        frame = cls.__new__(cls)
        frame._core = core
        return frame

    @cached_property
    def _facts(self) -> dict[str, Any]:
        facts: dict[str, Any] = json.loads(self._core.facts())
        return facts

    @cached_property
    def _about(self) -> str:
        """What is known of the frame, without its size and numbers."""
        return json.dumps([self.bits, self.cfa, self._facts["about"]])

    @classmethod
    def _of_about(cls, about: str) -> RawFrame:
        """The frame without pixels of which `_about` says this."""
        bits, cfa, known = json.loads(about)
        companding, noise = known["companding"], known["noise"]
        info = FrameInfo(
            bits=bits,
            cfa=cfa,
            # `black_dn` takes precedence.
            black_level_dn=0.0,
            black_dn=known["black_dn"],
            white_dn=known["white_dn"],
            response=known["response"],
            saturation=known["saturation"],
            noise=(noise["shot"], noise["read"]),
            gain_ev=known["gain_ev"],
            colour_matrix=known["colour_matrix"],
            shading=_nodes(known["shading"]),
            warp=_nodes(known["warp"]),
            companding=None if companding is None else (companding["companded_dn"], companding["linear_dn"]),
        )
        return cls.like(info)

    @cached_property
    def linear_dn(self) -> NDArray[np.float32]:
        """Digital numbers proportional to light, ``[y, x]``: expanded where the frame is companded."""
        return self._core.linear_dn()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._facts["height"], self._facts["width"]

    @property
    def bits(self) -> int:
        """Bits of a digital number."""
        return int(self._facts["bits"])

    @property
    def cfa(self) -> str:
        """Colours of the Bayer array from the first pixel on, such as ``RG/GB``."""
        return str(self._facts["cfa"])

    @property
    def black_dn(self) -> float:
        """Digital number of the dark."""
        return float(self._facts["about"]["black_dn"])

    @property
    def white_dn(self) -> float:
        """Digital number of white light in a green pixel."""
        return float(self._facts["about"]["white_dn"])

    @property
    def response(self) -> tuple[float, float, float]:
        """Answers of red, green and blue pixels to white light, relative to green."""
        red, green, blue = self._facts["about"]["response"]
        return red, green, blue

    @property
    def saturation(self) -> float:
        """Light, 1 = white, at which the first colour saturates under white light."""
        return float(self._facts["about"]["saturation"])

    @property
    def noise(self) -> tuple[float, float]:
        """Variance of the light of a green pixel, ``shot * light + read``: shot and read."""
        noise = self._facts["about"]["noise"]
        return noise["shot"], noise["read"]

    @property
    def gain_ev(self) -> float:
        """Gain of the sensor above its lowest, EV."""
        return float(self._facts["about"]["gain_ev"])

    def __copy__(self) -> RawFrame:
        return RawFrame._of(self._core)

    def __deepcopy__(self, memo: dict[int, Any]) -> RawFrame:
        return RawFrame._of(self._core)

    def __reduce__(self) -> tuple[Any, ...]:
        """The frame by its numbers and by all that is known of it, so that no file is needed to make it again."""
        calibration = dict(self._facts["about"])
        companding = calibration.pop("companding", None)
        black_dn, numbers = calibration["black_dn"], None
        if self.shape != (0, 0):
            numbers = self.linear_dn
            if companding is not None:
                numbers = np.interp(numbers, companding["linear_dn"], companding["companded_dn"]).round().astype(np.float32)
                black_dn = float(np.interp(black_dn, companding["linear_dn"], companding["companded_dn"]))
        info = {"bits": self.bits, "cfa": self.cfa, "black_level_dn": black_dn, "companding": companding}
        about = {"info": info, "calibration": calibration, "options": {"sensor": None, "auto_balance": False, "auto_exposure": False}, "white_e": None}
        return _again, (numbers, json.dumps(about))

    def __repr__(self) -> str:
        height, width = self.shape
        size = f"{height} x {width}" if height else "later"
        return f"<RawFrame {size}: {self.bits} bits, {self.cfa}, black {self.black_dn:.6g} DN, white {self.white_dn:.6g} DN>"


def _checked(info: FrameInfo) -> FrameInfo:
    return of_class("info", info, FrameInfo, 'such as petzval.FrameInfo(bits=12, cfa="RGGB", black_level_dn=64)')


def _again(numbers: NDArray[np.float32] | None, about: str) -> RawFrame:
    with watch() as watching:
        if numbers is None:
            return RawFrame._of(_petzval.RawFrame.like(about, watching))
        return RawFrame._of(_petzval.RawFrame.of_numbers(numbers, about, watching))


def _knots(companding: Any) -> dict[str, list[int]] | None:
    """Knots of companding as a sidecar has them."""
    if companding is None:
        return None
    hint = "companded and linear numbers of the knots, ascending from 0, such as ([0, 1023, 4095], [0, 1023, 65535])"
    knots: Any = of_class("companding", companding, (tuple, list, np.ndarray), hint)
    if len(knots) != 2:
        raise setting("companding", repr(companding), f"has {len(knots)} lists", hint)

    def whole(part: int) -> list[int]:
        name = f"companding[{part}]"
        numbers: Any = of_class(name, knots[part], (tuple, list, np.ndarray), hint)
        return [count(f"{name}[{i}]", value, hint) for i, value in enumerate(numbers)]

    return {"companded_dn": whole(0), "linear_dn": whole(1)}


def _mesh(key: str, values: ArrayLike | None, planes: int) -> dict[str, Any] | None:
    """Planes of nodes as a calibration has them."""
    if values is None:
        return None
    array = array_of(key, values, np.float64)
    if array.ndim != 3:
        raise setting(key, f"of shape {array.shape}", f"has {array.ndim} axes", f"give [{planes}, rows, cols]")
    rows, cols = array.shape[1:]
    nodes = shaped(key, array, (planes, rows, cols))
    return {"rows": rows, "cols": cols, "planes": [[v for row in plane for v in row] for plane in nodes]}


def _nodes(mesh: dict[str, Any] | None) -> NDArray[np.float64] | None:
    """The planes of a mesh of a calibration, ``[plane, rows, cols]``."""
    return None if mesh is None else np.array(mesh["planes"], dtype=np.float64).reshape(-1, mesh["rows"], mesh["cols"])
