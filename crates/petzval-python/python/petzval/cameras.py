"""Cameras: pictures go in, frames come out."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _petzval, jobs
from ._arguments import finite, flag, json_of, made_by, path_of, real, text
from ._errors import setting
from ._petzval import Cancel
from ._pictures import Given, Picture, figure, given
from ._watch import Progress, watch
from .lens import Lens
from .psfs import PsfBank
from .sensors import Sensor, SensorLike, sensor_input

__all__ = ["Camera", "Frames"]


class Frames:
    """A frame of a simulated camera, and what was developed from it.

    Arrays are made when they are first read. Pictures are ``[y, x, 3]``: red, green, blue. It cannot be pickled, but its arrays and facts can.
    """

    def __init__(self, core: _petzval.Frame) -> None:
        self._core = made_by(core, _petzval.Frame, "petzval.Camera.take")

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Facts: ``name``, ``sensor``, ``bits``, ``cfa`` (colour filters of the upper left pixels), ``pixel_um``, ``black_level_dn``, ``white_e``
        (photoelectrons of white in a green pixel on the axis), ``time_s``, ``linear_gain``, ``display_white`` (light that a display shows as
        white) and ``saturated_share`` (of the pixels).
        """
        found: dict[str, Any] = json.loads(self._core.facts())
        return found

    @property
    def name(self) -> str:
        """Name of the picture, by which files are named."""
        return str(self.facts["name"])

    @cached_property
    def irradiance(self) -> NDArray[np.float32]:
        """Light on the pixels, ``[y, x, 3]``; 1 is white on the axis."""
        return self._core.irradiance()

    @cached_property
    def illumination(self) -> NDArray[np.float32]:
        """Light of each pixel relative to the axis, ``[y, x, 3]``."""
        return self._core.illumination()

    @cached_property
    def raw(self) -> NDArray[np.uint16]:
        """The raw frame, digital numbers ``[y, x]``; without noise they are rounded."""
        return self._core.raw()

    @cached_property
    def developed(self) -> NDArray[np.float32]:
        """The developed picture in linear light, ``[y, x, 3]``; 1 is white. Restoration comes after it."""
        return self._core.developed()

    @cached_property
    def restored(self) -> NDArray[np.float32] | None:
        """The developed picture without the blur of the lens, in linear light, ``[y, x, 3]``; ``None`` if the camera does not restore."""
        return self._core.restored()

    @cached_property
    def finished(self) -> NDArray[np.uint8] | None:
        """The picture of the image signal processor, sRGB-encoded, ``[y, x, 3]``; ``None`` if the camera has none."""
        return self._core.by_isp()

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """What a display shows, sRGB-encoded, ``[y, x, 3]``: the restored picture or, without restoration, the developed one."""
        return self._core.shown()

    def save(
        self,
        folder: str | os.PathLike[str],
        *,
        raw_format: Literal["tiff", "png", "packed", "npy"] | None = None,
        picture_format: Literal["png", "png16", "exr", "npy"] | None = None,
        overwrite: bool = False,
    ) -> dict[str, Path]:
        """Writes the files of ``petzval simulate``: the raw frame with its sidecar, its calibration, the developed picture, and that of the ISP.

        Args:
            folder: It is made if need be.
            raw_format: Format of the raw frame; that of the command if left out.
            picture_format: Format of the developed picture; that of the command if left out.
            overwrite: Whether files that are there may be overwritten.

        Returns:
            The files by what they hold: ``raw``, ``sidecar``, ``calibration``, ``developed``, ``isp``.

        Raises:
            InputError: A file is there already, or the folder cannot be written.
        """
        formats = _known(images=[], raw_format=raw_format, picture_format=picture_format)
        options = json_of("formats", formats, "names of formats")
        with watch() as watching:
            facts = json.loads(self._core.save(path_of("folder", folder), options, flag("overwrite", overwrite), watching))
        return {key: Path(facts[key]) for key in ("raw", "sidecar", "calibration", "developed", "isp") if key in facts}

    def __copy__(self) -> Frames:
        return Frames(self._core)

    def __deepcopy__(self, memo: dict[int, Any]) -> Frames:
        return Frames(self._core)

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("petzval.Frames cannot be pickled: take its arrays, such as raw and picture, and its facts; or write it by save")

    def __repr__(self) -> str:
        height, width = self.raw.shape
        return f"<Frames of {self.name!r}: {height} x {width} pixels, {self.facts['bits']} bits, {self.facts['sensor']}>"

    def _repr_html_(self) -> str:
        return figure(self.picture if self.finished is None else self.finished, repr(self))


class Camera:
    """A lens in front of a sensor, with what develops its raw frames. It never changes; its PSFs are traced for the first picture.

    What is left out has the default of ``petzval simulate``.

    Args:
        lens: A lens, a built-in name, or the path of a lens file.
        sensor: A built-in name, the path of a sensor file, or anything with a method ``to_toml``.
        exposure_e: Photoelectrons that white gives in a green pixel on the axis; ``white_e`` of the command.
        time_s: Exposure time, s.
        gain: Linear analogue gain.
        isp: An image signal processor: a preset such as ``"quality"``, a file, or ``"neutral"``.
        restore: Whether the blur of the lens is divided out; a number is the power of noise over that of the picture at a tenth of a cycle per
            pixel.
        place: How a picture lands on the sensor: it covers the sensor (``"fill"``), or one pixel lands on one (``"centre"``).
        distortion: Whether the picture is the scene in front of the lens, and its distortion is rendered.
        size: Rows and columns in the middle of the sensor that are read; all of them if left out.
        samples: Samples of the scene along a side of a pixel, 1 to 8.
        noise: Whether the frames have temporal noise. The fixed pattern of the sensor (DSNU, PRNU, hot pixels) stays without it.
        psfs: PSFs in place of those of the lens: the folder that `PsfBank.save` or ``petzval psf`` wrote.
        **request: Further keys of `petzval.requests.Simulate`, such as ``spectral={"illuminant": "A"}``.
    """

    def __init__(
        self,
        lens: Lens | str | os.PathLike[str] | None = None,
        sensor: SensorLike | None = None,
        *,
        exposure_e: float | None = None,
        time_s: float | None = None,
        gain: float | None = None,
        isp: str | os.PathLike[str] | None = None,
        restore: bool | float = False,
        place: Literal["fill", "centre"] | None = None,
        distortion: bool = True,
        size: tuple[int, int] | None = None,
        samples: int | None = None,
        noise: bool = True,
        psfs: str | os.PathLike[str] | None = None,
        **request: Any,
    ) -> None:
        for key in ("images", "seed", "out"):
            if key in request:
                hint = "`take` has the picture and the seed, `Frames.save` the folder"
                raise setting(key, str(request[key]), "is no property of a camera", hint)
        if isinstance(psfs, PsfBank):
            raise setting("psfs", repr(psfs), "is in memory", "write it by its `save`, and give the folder")
        # Of what is in memory the request holds the text.
        self._names = {key: value.name for key, value in (("lens", lens), ("sensor", sensor)) if isinstance(value, Lens | Sensor)}
        self._glasses = lens._core.glasses() if isinstance(lens, Lens) else []
        named = _known(
            lens={"toml": lens.to_toml()} if isinstance(lens, Lens) else lens,
            sensor=None if sensor is None else sensor_input(sensor),
            white_e=finite("exposure_e", exposure_e),
            time_s=finite("time_s", time_s),
            gain=finite("gain", gain),
            isp=isp,
            restore=_restore(restore),
            place=place,
            no_distortion=not flag("distortion", distortion),
            size=size,
            samples=samples,
            no_noise=not flag("noise", noise),
            psfs=psfs,
        )
        for key in request.keys() & named.keys():
            argument, right = _ARGUMENTS.get(key, (key, "a value"))
            raise setting(key, repr(request[key]), f"stands for the argument `{argument}`", f"give `{argument}`, {right}, alone")
        self._request = request | named

    @cached_property
    def _core(self) -> _petzval.Camera:
        return _petzval.Camera(self._glasses)

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "_core"}

    @property
    def request(self) -> dict[str, Any]:
        """What `take` requests of the job ``simulate``, without picture and seed."""
        return dict(self._request)

    def take(
        self,
        picture: Picture,
        *,
        seed: int | None = None,
        name: str | None = None,
        progress: Progress = False,
        cancel: Cancel | None = None,
    ) -> Frames:
        """Takes a picture.

        Args:
            picture: A path, ``"scene:NAME"`` for a built-in scene over the spectrum, or an array ``[y, x, 3]``: ``uint8`` is sRGB-encoded, floats are
                linear light where 1 is white.
            seed: Seed of the noise; that of the command if left out.
            name: Name of an array, by which its files are named.
            progress: ``True`` for a bar, or a function that takes every event.
            cancel: A flag that another thread may set.

        Raises:
            InputError: The picture or a property of the camera is wrong.
        """
        return self.take_all([picture], seed=seed, names=None if name is None else [text("name", name, "the name of the picture")], progress=progress, cancel=cancel)[0]

    def take_all(
        self,
        pictures: Sequence[Picture],
        *,
        seed: int | None = None,
        names: Sequence[str] | None = None,
        progress: Progress = False,
        cancel: Cancel | None = None,
    ) -> list[Frames]:
        """Takes several pictures, each with noise of its own. All frames are in memory together.

        Args:
            pictures: As in `take`.
            seed: Seed of the noise.
            names: Names of the arrays among them, in their order.
            progress: ``True`` for a bar, or a function that takes every event.
            cancel: A flag that another thread may set.
        """
        if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**64):
            raise setting("seed", repr(seed), "is no seed", "a whole number, 0 to 2^64 - 1")
        several = len(pictures) > 1
        all_given = [given(one, f"pictures[{i}]" if several else "picture") for i, one in enumerate(pictures)]
        arrays = sum(not isinstance(one, str) for one in all_given)
        if names is not None:
            names = [text(f"names[{i}]", name, "the name of an array") for i, name in enumerate(names)]
            if len(names) != arrays:
                raise setting("names", str(names), f"there are {arrays} arrays", "one name for each array")
        usual = ["picture"] if arrays == 1 else [f"picture-{i + 1}" for i in range(arrays)]
        free = iter(usual if names is None else names)
        named: list[tuple[str, Given]] = [(one if isinstance(one, str) else next(free), one) for one in all_given]
        photos = [(name, one) for name, one in named if not isinstance(one, str)]
        request = {**self._request, "images": [name for name, _ in named], **_known(seed=seed)}
        with watch(progress, cancel) as watching:
            frames = self._core.take(jobs._json(request), photos, watching)
        return [Frames(frame) for frame in frames]

    def __repr__(self) -> str:
        about = {key: value for key, value in self._request.items() if value is not False} | self._names
        return f"<Camera {', '.join(f'{key}={value!r}' for key, value in about.items()) or 'of the defaults'}>"


_ARGUMENTS = {
    "white_e": ("exposure_e", "photoelectrons of white"),
    "no_noise": ("noise", "True or False"),
    "no_distortion": ("distortion", "True or False"),
}
"""Keys of the request that arguments of a camera have another name for."""


def _restore(restore: bool | float) -> dict[str, float] | None:
    if isinstance(restore, bool):
        return {} if restore else None
    return {"noise": real("restore", restore, "True, False or the power of noise over that of the picture")}


def _known(**keys: Any) -> dict[str, Any]:
    """The keys that have a value: what is left out has its default in the job."""
    return {key: value for key, value in keys.items() if value is not None}
