"""The automotive image signal processor: from raw frames to pictures."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import array_of, count, made_by, of_class, path_of, placed, real, reals
from ._arguments import text as checked_text
from ._errors import setting
from ._watch import watch
from .raw_frame import FrameInfo, RawFrame

__all__ = ["Isp", "IspParameter", "develop"]

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]
Picture = NDArray[np.uint8] | NDArray[np.uint16]
RawLike = RawFrame | str | os.PathLike[str] | ArrayLike
"""A raw frame, the path of a raw file, or digital numbers ``[y, x]``."""

_STOPS = "stops above the lowest gain of the sensor"


@dataclass(frozen=True)
class IspParameter:
    """A parameter of the ISP.

    Attributes:
        name: ``stage.key``, or ``stage.key[i]`` for a number of an array.
        value: Its value, in its unit.
        default: Its default.
        unit: Its unit; empty for a plain number.
        min: Least value.
        max: Greatest value.
        scale: Whether it is best varied by differences (``linear``) or by ratios (``log``).
        sentence: What it is.
    """

    name: str
    value: float
    default: float
    unit: str
    min: float
    max: float
    scale: Literal["linear", "log"]
    sentence: str


class Isp:
    """Petzval's automotive ISP with values for all of its parameters. It never changes: what would change it gives another one.

    Make it with `load` or `parse`. It has two forms. `develop` computes in whole numbers, as a chip does. `smooth` is the same chain of
    stages in floating point, which `pull_back` differentiates by the raw frame and by every parameter.
    """

    def __init__(self, core: _petzval.Isp) -> None:
        self._core = made_by(core, _petzval.Isp, "petzval.Isp.load(PRESET) or petzval.Isp.parse(TEXT)")

    @classmethod
    def load(cls, preset: str | os.PathLike[str] | None = None) -> Isp:
        """Reads a preset.

        Args:
            preset: A built-in name (``"neutral"``, ``"quality"``, ``"real-time"``, ``"automotive"``, ``"low-light"``) or a path. If left out,
                every parameter has its default.

        Raises:
            InputError: There is no such preset, its file is wrong, or it stands for another ISP.
        """
        path = None if preset is None else path_of("preset", preset)
        with watch() as watching, placed("preset", path or "", "give a file that exists, or a built-in name"):
            return cls(_petzval.Isp.load(path, watching))

    @classmethod
    def parse(cls, text: str) -> Isp:
        """Reads the text of a preset, as `load` reads the file."""
        with watch() as watching:
            return cls(_petzval.Isp.parse(checked_text("text", text, "the text of a preset"), watching))

    @property
    def about(self) -> str:
        """What it is for."""
        return self._core.about()

    @property
    def demosaic(self) -> str:
        """Method of demosaicing: ``bilinear``, ``malvar``, ``rcd`` or ``menon``."""
        return str(json.loads(self._core.methods())[0])

    @property
    def domain(self) -> str:
        """Values between which colours are interpolated: roots of light (``stabilised``) or light (``linear``)."""
        return str(json.loads(self._core.methods())[1])

    @cached_property
    def parameters(self) -> Mapping[str, IspParameter]:
        """Every parameter by name, in the order of the light, with its value at the lowest gain of the sensor."""
        rows = json.loads(self._core.parameters(0.0))
        return MappingProxyType({row["name"]: IspParameter(**row) for row in rows})

    def values(self, gain_ev: float = 0.0) -> Array:
        """The values of all parameters, in the order of `parameters`, ``[parameter]``.

        Args:
            gain_ev: Gain of the sensor above its lowest, EV: presets set some parameters by it.
        """
        return self._core.values(real("gain_ev", gain_ev, _STOPS))

    def at_gain(self, gain_ev: float) -> Isp:
        """The ISP whose parameters have, at every gain, the values of this gain in EV."""
        return Isp(self._core.at_gain(real("gain_ev", gain_ev, _STOPS)))

    def with_(
        self,
        changes: Mapping[str, float | Sequence[float]] | None = None,
        *,
        demosaic: Literal["bilinear", "malvar", "rcd", "menon"] | None = None,
        domain: Literal["stabilised", "linear"] | None = None,
        **numbers: float | Sequence[float],
    ) -> Isp:
        """The ISP with other values, which it has at every gain of the sensor.

            >>> isp.with_(sharpen_amount=1.2, gain_stops=0.5)
            >>> isp.with_({"sharpen.amount": 1.2, "black_level.offset_dn": [0.5, 0.0, 0.0, -0.5]})

        Args:
            changes: Values by name, ``stage.key``, in the units of `parameters`; an array by a list of all of its numbers.
            demosaic: Another method of demosaicing.
            domain: Other values between which colours are interpolated.
            **numbers: Values by names in which ``_`` stands for the dot.

        Raises:
            InputError: There is no such parameter, or a value is out of its range.
        """
        hint = 'values by name, such as {"sharpen.amount": 1.2}'
        given: Mapping[str, Any] = {} if changes is None else of_class("changes", changes, Mapping, hint)
        named = list(self._named({**given, **numbers}))
        methods = [None if value is None else checked_text(key, value, "the name of a method") for key, value in (("demosaic", demosaic), ("domain", domain))]
        return Isp(self._core.changed(named, methods[0], methods[1]))

    def to_toml(self) -> str:
        """The ISP as text of a preset, with a sentence for each parameter."""
        return self._core.toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a preset, which `load` and every job read. The file is whole or not there."""
        with watch() as watching:
            self._core.save(path_of("path", path), watching)

    def develop(self, raw: RawLike, info: FrameInfo | None = None, *, bits: int | None = None) -> Picture:
        """Develops a raw frame in whole numbers, as the job ``isp-develop`` does.

        Args:
            raw: A raw frame; the path of a raw file; or digital numbers ``[y, x]``, of which `info` says more. Sides are even and at least 16.
            info: What is known of an array.
            bits: Bits of the picture: 8, 10 or 16; 8 if left out.

        Returns:
            The picture, sRGB-encoded, ``[y, x, 3]``: ``uint8`` of 8 bits, else ``uint16``.

        Raises:
            InputError: The frame or something about it is wrong.
        """
        frame = _frame(raw, info)
        bits = None if bits is None else count("bits", bits, "8, 10 or 16")
        with watch() as watching:
            return self._core.develop(frame._core, bits, watching)

    def smooth(self, raw: RawLike, info: FrameInfo | None = None, *, values: ArrayLike | None = None) -> Float32:
        """Develops a raw frame in floating point: the stages of `develop` without rounding.

        Args:
            raw: As of `develop`. The digital numbers of a `RawFrame` are those proportional to light, and so are those of an array: they need
                not be whole.
            info: What is known of an array.
            values: Values of all parameters, in the order of `parameters`, ``[parameter]``; those of this ISP at the frame's gain if left out.

        Returns:
            The picture, sRGB-encoded, about 0 to 1, ``[y, x, 3]``.
        """
        frame, numbers, theta = self._smooth(raw, info, values)
        with watch() as watching:
            picture = self._core.smooth(frame._core, numbers, theta, watching)
        return np.moveaxis(picture[0], 0, -1)

    def pull_back(
        self, raw: RawLike, cotangent: ArrayLike, info: FrameInfo | None = None, *, values: ArrayLike | None = None
    ) -> tuple[Float32, Array]:
        """Derivatives of a loss by the raw frame and by the parameters, by reverse differentiation of `smooth` in 32 bits.

        Args:
            raw: As of `smooth`.
            cotangent: Derivatives of the loss by the picture that `smooth` returns, ``[y, x, 3]``.
            info: What is known of an array.
            values: As of `smooth`.

        Returns:
            Derivatives by the digital numbers, 1/DN, ``[y, x]``; and by the parameters, one over the unit of each, ``[parameter]``.
        """
        frame, numbers, theta = self._smooth(raw, info, values)
        planes = array_of("cotangent", cotangent, np.float32)
        wanted = (*numbers.shape[1:], 3)
        if planes.shape != wanted:
            raise setting("cotangent", f"of shape {planes.shape}", f"has the shape {planes.shape}", f"give {wanted}")
        with watch() as watching:
            by_raw, by_values = self._core.pull_back(frame._core, numbers, theta, np.moveaxis(planes, -1, 0)[None], watching)
        return by_raw[0], by_values[0]

    def _smooth(self, raw: RawLike, info: FrameInfo | None, values: ArrayLike | None) -> tuple[RawFrame, Float32, Array]:
        """What is known of a frame, its numbers ``[1, y, x]``, and the values of the parameters ``[1, parameter]``."""
        if isinstance(raw, (RawFrame, str, os.PathLike)):
            frame = _frame(raw, info)
            numbers = frame.linear_dn
        else:
            frame = RawFrame.like(_needed(info))
            numbers = array_of("raw", raw, np.float32)
        if numbers.ndim != 2:
            raise setting("raw", f"of shape {numbers.shape}", f"has {numbers.ndim} axes", "give [y, x]")
        theta = self.values(frame.gain_ev) if values is None else array_of("values", values, np.float64)
        if theta.shape != (len(self.parameters),):
            raise setting("values", f"of shape {theta.shape}", f"have the shape {theta.shape}", f"give ({len(self.parameters)},)")
        return frame, numbers[None], theta[None]

    def _named(self, changes: Mapping[str, float | Sequence[float]]) -> Iterator[tuple[str, float]]:
        """Names and values of single numbers."""
        for key, value in changes.items():
            names = self._names.get(key, (key,))
            values = reals(checked_text("changes", key, "names of parameters are texts"), value, "number")
            if values.shape != (len(names),):
                raise setting(key, str(value), f"is not {len(names)} numbers", f"it has {len(names)}")
            yield from zip(names, values.tolist(), strict=True)

    @cached_property
    def _names(self) -> dict[str, tuple[str, ...]]:
        """The single numbers that names stand for, also those in which ``_`` stands for the dot."""
        found: dict[str, tuple[str, ...]] = {}
        for name in self.parameters:
            key = name.split("[")[0]
            for spelt in {key, key.replace(".", "_")}:
                found[spelt] = (*found.get(spelt, ()), name)
            if name != key:
                found[name] = (name,)
        return found

    def __getitem__(self, name: str) -> float:
        """The value of a parameter at the lowest gain."""
        return self.parameters[name].value

    def __repr__(self) -> str:
        changed = [f"{p.name}={p.value:g}" for p in self.parameters.values() if p.value != p.default]
        return f"<Isp {self.demosaic}, {len(self.parameters)} parameters{': ' if changed else ''}{', '.join(changed)}>"

    def _repr_html_(self) -> str:
        def row(p: IspParameter) -> str:
            value = f"<b>{p.value:g}</b>" if p.value != p.default else f"{p.value:g}"
            cells = html.escape(p.name), value, f"{p.min:g} to {p.max:g} {html.escape(p.unit)}", html.escape(p.sentence)
            return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"

        head = f"<caption>{html.escape(self.about)} Demosaicing: {self.demosaic}.</caption>"
        return f"<table>{head}{''.join(row(p) for p in self.parameters.values())}</table>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Isp) and self.to_toml() == other.to_toml()

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[Any, ...]:
        return Isp.parse, (self.to_toml(),)


def develop(
    raw: RawLike,
    *,
    preset: Isp | str | os.PathLike[str] | None = None,
    info: FrameInfo | None = None,
    bits: int | None = None,
    **parameters: float | Sequence[float],
) -> Picture:
    """Develops a raw frame to a picture by Petzval's automotive ISP in whole numbers.

        >>> info = petzval.FrameInfo(bits=12, cfa="RGGB", black_level_dn=64)
        >>> petzval.develop(raw, info=info, preset="quality", sharpen_amount=0.8)

    Args:
        raw: Digital numbers ``[y, x]``, of which `info` says more; a `RawFrame`; or the path of a raw file with its sidecar.
        preset: A preset by name or path, or an `Isp`. If left out, every parameter has its default.
        info: What is known of an array.
        bits: Bits of the picture: 8, 10 or 16; 8 if left out.
        **parameters: Other values, as of `Isp.with_`.

    Returns:
        The picture, sRGB-encoded, ``[y, x, 3]``: ``uint8`` of 8 bits, else ``uint16``.

    Raises:
        InputError: The frame, the preset or a parameter is wrong.
    """
    isp = preset if isinstance(preset, Isp) else Isp.load(preset)
    if parameters:
        isp = isp.with_(parameters)
    return isp.develop(raw, info, bits=bits)


def _frame(raw: RawLike, info: FrameInfo | None) -> RawFrame:
    if isinstance(raw, (RawFrame, str, os.PathLike)):
        if info is not None:
            raise setting("info", "", "the raw frame has its own", "give info with an array alone")
        return raw if isinstance(raw, RawFrame) else RawFrame.load(raw)
    return RawFrame(reals("raw", raw, "y", "x"), _needed(info))


def _needed(info: FrameInfo | None) -> FrameInfo:
    if info is None:
        hint = 'such as info=FrameInfo(bits=12, cfa="RGGB", black_level_dn=64)'
        raise setting("info", "", "what are the numbers of the array?", hint)
    return info
