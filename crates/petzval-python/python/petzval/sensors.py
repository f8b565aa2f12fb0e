"""Sensors: read, changed, and exposed to light."""

from __future__ import annotations

import html
import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import count, json_of, made_by, not_negative, not_written, pair, path_of, placed, positive, real, reals
from ._arguments import text as checked_text
from ._errors import setting
from ._watch import watch

__all__ = ["FixedPattern", "NoiseMode", "Sensor"]

Array = NDArray[np.float32]

NoiseMode = Literal["exact", "dequantised", "half_step", "straight_through", "gaussian", "off"]
"""How shot noise is drawn, and its derivative by the mean number of electrons.

``exact``: whole Poisson electrons, without a derivative; for evaluation. ``dequantised``: counts spread evenly over the unit interval about
them, with a derivative that is unbiased for functions of the result. ``half_step``: counts and a half, derivative 1. ``straight_through``:
counts, derivative 1, biased. ``gaussian``: normal with the mean and variance of counts. ``off``: the mean, without noise and rounding.
"""


@runtime_checkable
class HasToml(Protocol):
    """What gives itself as the text of a file of Petzval, such as a sensor."""

    def to_toml(self) -> str:
        """The text."""


SensorLike = str | os.PathLike[str] | HasToml
"""A built-in name, the path of a sensor file, or something that has its text."""


def sensor_input(sensor: SensorLike) -> str | dict[str, str]:
    """A sensor as requests of jobs have it.

    Raises:
        InputError: It is no sensor.
    """
    # A class has the method, too, but no text.
    if isinstance(sensor, HasToml) and not isinstance(sensor, type):
        return {"toml": sensor.to_toml()}
    return path_of("sensor", sensor)


@dataclass(frozen=True, repr=False, eq=False)
class FixedPattern:
    """What is fixed in a window of one specimen of a sensor, whatever the frame.

    Attributes:
        offset_e: Offset of each pixel (DSNU), electrons, ``[y, x]``.
        response: Factor on the light of each pixel (PRNU), about 1, ``[y, x]``.
        dark_e_per_s: Dark current of each pixel above that of the sensor, electrons per second, ``[y, x]``; zero but for hot pixels.
    """

    offset_e: Array
    response: Array
    dark_e_per_s: Array

    def __repr__(self) -> str:
        height, width = self.offset_e.shape
        return f"<FixedPattern of {height} x {width} pixels>"


class Sensor:
    """An EMVA 1288 sensor with any colour filter array. It never changes: what would change it gives another one.

    Make it with `load` or `parse`. A pixel with a mean of ``e`` photoelectrons, in an exposure of ``t`` seconds at linear gain ``g``, has

    ``n ~ Poisson(e P + (mu_I + h) t)``, ``y = clip(round(K g (min(n, FWC) + mu_r + D + sigma_r z1) + BL + mu_el + sigma_el z2))``

    with the fixed pattern ``D, P, h`` of the specimen. Source: EMVA 1288 release 4.0, linear camera model.
    """

    def __init__(self, core: _petzval.Sensor) -> None:
        self._core = made_by(core, _petzval.Sensor, "petzval.Sensor.load(NAME) or petzval.Sensor.parse(TEXT)")

    @classmethod
    def load(cls, name: str | os.PathLike[str]) -> Sensor:
        """Reads a sensor: a built-in name, such as ``"imx249-fitted"``, or a sensor file (``.toml``).

        Raises:
            InputError: There is no such sensor, or the file is wrong; its place is in the error.
        """
        path = path_of("name", name)
        with watch() as watching, placed("name", path, "give a file that exists, or a built-in name"):
            return cls(_petzval.Sensor.load(path, watching))

    @classmethod
    def parse(cls, text: str) -> Sensor:
        """Reads the text of a sensor file, as `load` reads the file. Errors name the line."""
        with watch() as watching:
            return cls(_petzval.Sensor.parse(checked_text("text", text, "the text of a sensor file"), watching))

    @cached_property
    def _facts(self) -> dict[str, Any]:
        facts: dict[str, Any] = json.loads(self._core.facts())
        return facts

    @property
    def name(self) -> str:
        """What it is called."""
        return str(self._facts["name"])

    @property
    def source(self) -> str:
        """Where its numbers come from."""
        return str(self._facts["source"])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return int(self._facts["height"]), int(self._facts["width"])

    @property
    def pixel_um(self) -> float:
        """Pixel pitch, um."""
        return float(self._facts["pixel_um"])

    @property
    def bits(self) -> int:
        """Bits of the converter."""
        return int(self._facts["bits"])

    @property
    def cfa(self) -> str:
        """Colour filter array: its rows from the top, as ``RGGB``, ``RRGG/RRGG/GGBB/GGBB`` or ``mono``."""
        return str(self._facts["cfa"])

    @property
    def black_level_dn(self) -> float:
        """Black level BL, DN."""
        return float(self._facts["black_level_dn"])

    @property
    def gain_dn_per_e(self) -> float:
        """System gain K at linear gain 1, DN per electron."""
        return float(self._facts["gain_dn_per_e"])

    @property
    def gain_steps(self) -> tuple[float, ...]:
        """Linear gains that the sensor offers; empty if every gain can be set."""
        return tuple(self._facts.get("gain_steps", ()))

    @property
    def full_well_e(self) -> float:
        """Full well capacity FWC, electrons."""
        return float(self._facts["full_well_e"])

    @property
    def dark_current_e_per_s(self) -> float:
        """Dark current mu_I, electrons per pixel and second."""
        return float(self._facts["dark_current_e_per_s"])

    @property
    def read_noise_e(self) -> float:
        """Standard deviation of the read noise sigma_r, electrons."""
        return float(self._facts["read_noise_e"])

    @property
    def read_noise_mean_e(self) -> float:
        """Mean of the read noise mu_r, electrons."""
        return float(self._facts["read_noise_mean_e"])

    @property
    def electronics_noise_dn(self) -> float:
        """Standard deviation of the electronics noise sigma_el, DN."""
        return float(self._facts["electronics_noise_dn"])

    @property
    def electronics_mean_dn(self) -> float:
        """Mean of the electronics noise mu_el, DN."""
        return float(self._facts["electronics_mean_dn"])

    @property
    def electronics(self) -> Literal["before_adc", "after_adc"]:
        """Where the electronics noise enters: before the converter, or after it, which rounds a second time."""
        found: Literal["before_adc", "after_adc"] = self._facts["electronics"]
        return found

    @property
    def relative_qe(self) -> tuple[float, float, float]:
        """Quantum efficiency of red, green and blue pixels relative to green."""
        red, green, blue = self._facts["relative_qe"]
        return red, green, blue

    @property
    def nonuniformity(self) -> dict[str, float]:
        """Differences between its pixels by the keys of a sensor file: DSNU, PRNU, hot pixels, row and column noise."""
        return dict(self._facts["nonuniformity"])

    @cached_property
    def response(self) -> NDArray[np.float64]:
        """Electrons of each pixel of the filter array's tile per electron that red, green and blue light gives a green pixel.

        ``[row, column, 3]``; the tile repeats from the sensor's pixel (0, 0).
        """
        return self._core.response()

    def white_level_dn(self, linear_gain: float = 1.0) -> float:
        """Mean digital number of a saturated pixel, DN: the largest of the converter, or the mean reading of a full well.

        Raises:
            InputError: The gain is not positive.
        """
        return self._core.white_level_dn(positive("linear_gain", linear_gain, "a gain above 0"))

    def light_capacity_e(self, *, time_s: float = 0.0, linear_gain: float = 1.0) -> float:
        """Photoelectrons that saturate a pixel; zero or negative if a dark pixel is saturated.

        Raises:
            InputError: The gain is not positive, or the time is negative.
        """
        seconds = not_negative("time_s", time_s, "seconds, 0 or above")
        return self._core.light_capacity_e(seconds, positive("linear_gain", linear_gain, "a gain above 0"))

    def to_toml(self) -> str:
        """The sensor as text of a sensor file."""
        return self._core.toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a sensor file, which `load` and the command read.

        Raises:
            InputError: The file cannot be written.
        """
        file = Path(path_of("path", path))
        try:
            file.write_text(self.to_toml(), encoding="utf-8")
        except (OSError, ValueError) as error:
            raise not_written(file, error) from error

    def with_(self, **values: Any) -> Sensor:
        """The sensor with other values of keys of its file.

        Args:
            **values: By key, such as ``full_well_e=12000.0``, ``cfa="GRBG"`` or ``nonuniformity={"specimen": 3, "dsnu_pixel_e": 1.5}``; a table
                replaces the whole table.

        Raises:
            InputError: There is no such key, or a sensor cannot have this value.
        """
        text = json_of("values", values, "give finite numbers, texts, lists or tables")
        with watch() as watching:
            return Sensor(self._core.changed(text, watching))

    def expose(
        self,
        electrons: ArrayLike,
        *,
        seed: int = 0,
        frame: int = 0,
        time_s: float = 0.0,
        linear_gain: float = 1.0,
        row: int = 0,
        column: int = 0,
    ) -> NDArray[np.uint16]:
        """A raw frame with Petzval's exact noise: every electron is counted.

        The same seed, frame and pixel of the sensor give the same noise, for any window and number of threads.

        Args:
            electrons: Mean photoelectrons of each pixel behind its own filter, ``[y, x]``; or ``[y, x, 3]``: what red, green and blue light give
                a green pixel, which the filter array then samples. Finite, not negative.
            seed: Seed of the noise, from 0.
            frame: Number of the frame, from 0: frames of one seed have independent noise.
            time_s: Exposure time, s, which sets the electrons of the dark current.
            linear_gain: Linear gain g above the system gain; one of `gain_steps`, if there are any.
            row: Sensor row of the first pixel. It sets the phase of the filter array and the fixed pattern.
            column: Sensor column of the first pixel.

        Returns:
            Digital numbers ``[y, x]``, 0 to 2^bits - 1.

        Raises:
            InputError: An argument is out of its range, or the frame leaves the sensor.
        """
        settings = _settings(seed, frame, time_s, linear_gain, row, column)
        with watch() as watching:
            return self._core.expose(reals("electrons", electrons), settings, watching)

    def mean_dn(
        self,
        electrons: ArrayLike,
        *,
        time_s: float = 0.0,
        linear_gain: float = 1.0,
        row: int = 0,
        column: int = 0,
    ) -> Array:
        """Digital numbers without noise and rounding, ``[y, x]``; full well, limits of the converter and fixed pattern remain.

        The arguments are those of `expose`. Away from the limits this is the mean over frames.
        """
        settings = _settings(0, 0, time_s, linear_gain, row, column)
        with watch() as watching:
            return self._core.expose_with_tape(reals("electrons", electrons), "off", settings, watching)[0]

    def expose_with_derivative(
        self,
        electrons: ArrayLike,
        mode: NoiseMode,
        *,
        seed: int = 0,
        frame: int = 0,
        time_s: float = 0.0,
        linear_gain: float = 1.0,
        row: int = 0,
        column: int = 0,
    ) -> tuple[Array, Array]:
        """Digital numbers in a mode of noise, and their derivatives by the photoelectrons of each pixel.

        The arguments are those of `expose`. Rounding passes the derivative unchanged; a full well and a converter at its limits block it.

        Returns:
            Digital numbers, and DN per electron, both ``[y, x]``. Of light ``[y, x, 3]``, multiply by `response` for each colour.
        """
        if mode not in get_args(NoiseMode):
            raise setting("mode", repr(mode), "there is no such mode of noise", ", ".join(get_args(NoiseMode)))
        settings = _settings(seed, frame, time_s, linear_gain, row, column)
        with watch() as watching:
            return self._core.expose_with_tape(reals("electrons", electrons), mode, settings, watching)

    def dark(
        self,
        *,
        seed: int = 0,
        frame: int = 0,
        time_s: float = 0.0,
        linear_gain: float = 1.0,
        size: tuple[int, int] | None = None,
    ) -> NDArray[np.uint16]:
        """A dark frame ``[y, x]``: what `expose` gives without light, of the whole sensor or its first ``size`` rows and columns."""
        height, width = self.shape if size is None else pair("size", size)
        if not (1 <= height <= self.shape[0] and 1 <= width <= self.shape[1]):
            raise setting("size", str(size), "no size of a frame", f"rows and columns, up to {self.shape}")
        # One dark pixel stands for all of them.
        electrons = np.broadcast_to(np.float32(0), (height, width))
        return self.expose(electrons, seed=seed, frame=frame, time_s=time_s, linear_gain=linear_gain)

    def fixed_pattern(self, size: tuple[int, int] | None = None, *, row: int = 0, column: int = 0) -> FixedPattern:
        """The fixed pattern of the specimen: the truth that a characterisation is held to.

        Args:
            size: Rows and columns; those of the whole sensor if left out.
            row: Sensor row of the first pixel.
            column: Sensor column of the first pixel.
        """
        height, width = self.shape if size is None else pair("size", size)
        first = count("row", row), count("column", column)
        with watch() as watching:
            return FixedPattern(*self._core.fixed_pattern(*first, height, width, watching))

    def __repr__(self) -> str:
        height, width = self.shape
        return f"<Sensor {self.name!r}: {height} x {width} pixels of {self.pixel_um:g} um, {self.cfa}, {self.bits} bits>"

    def _repr_html_(self) -> str:
        rows = (
            ("pixels", f"{self.shape[0]} x {self.shape[1]} of {self.pixel_um:g} um"),
            ("filter array", self.cfa),
            ("converter", f"{self.bits} bits, black level {self.black_level_dn:g} DN"),
            ("system gain", f"{self.gain_dn_per_e:g} DN/e-"),
            ("full well", f"{self.full_well_e:g} e-"),
            ("dark current", f"{self.dark_current_e_per_s:g} e-/s"),
            ("read noise", f"{self.read_noise_e:g} e-"),
            ("electronics noise", f"{self.electronics_noise_dn:g} DN"),
            ("source", self.source),
        )
        cells = "".join(f"<tr><th>{html.escape(key)}</th><td>{html.escape(value)}</td></tr>" for key, value in rows)
        return f"<table><caption>{html.escape(self.name)}</caption>{cells}</table>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sensor) and self._core.facts() == other._core.facts()

    def __hash__(self) -> int:
        return hash(self._core.facts())

    def __reduce__(self) -> tuple[Any, ...]:
        return Sensor.parse, (self.to_toml(),)


def _settings(
    seed: int, frame: int, time_s: float, linear_gain: float, row: int, column: int
) -> tuple[int, int, float, float, int, int]:
    return (
        count("seed", seed),
        count("frame", frame),
        real("time_s", time_s),
        real("linear_gain", linear_gain),
        count("row", row),
        count("column", column),
    )

