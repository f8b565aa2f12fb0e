"""Light through a lens by Petzval's own renderer: blurred by the PSF of its place, dimmed and distorted; and the blur taken out again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import array_of, count, not_negative, of_class, pair, positive, real, reals
from ._errors import setting
from ._petzval import Cancel
from ._pictures import light_of
from ._watch import watch
from .lens import Lens
from .sensors import Sensor

__all__ = ["Distortion", "FieldPsfs", "HasPsfs", "Wiener", "blend_error", "patches_for", "render", "restore"]

Picture = NDArray[np.float32]

ON_AXIS_MM = 1e-9
"""Image points closer to the axis than this lie on it, mm."""


class HasPsfs(Protocol):
    """PSFs of a rotationally symmetric lens by image radius: a `PsfBank`, or `FieldPsfs` of one's own.

    A PSF belongs to an image point on the +y axis. Rows are y, away from the axis; the image point lies between the two middle cells.
    """

    @property
    def values(self) -> Any:
        """``[field, colour, y, x]``; each PSF has unit sum."""

    @property
    def illumination(self) -> Any:
        """Irradiance of the image of a uniform scene, 1 on the axis, ``[field, colour]``."""

    @property
    def field_radius_mm(self) -> Any:
        """Image radius of each field, mm, ascending from 0, ``[field]``."""

    @property
    def pitch_um(self) -> float:
        """Size of a cell, um."""


@dataclass(frozen=True, repr=False, eq=False)
class FieldPsfs:
    """PSFs of one's own: measured, computed elsewhere, or tensors. `PsfBank` has the same attributes.

    Attributes:
        values: ``[field, colour, y, x]``; each PSF has unit sum. y grows away from the axis; the image point lies between the two middle cells.
        field_radius_mm: Image radius of each field, mm, ascending from 0, ``[field]``.
        pitch_um: Size of a cell, um.
        illumination: Irradiance of the image of a uniform scene, 1 on the axis, ``[field, colour]``; 1 everywhere if left out.
    """

    values: Any
    field_radius_mm: Any
    pitch_um: float
    illumination: Any = None

    def __post_init__(self) -> None:
        if self.illumination is None:
            object.__setattr__(self, "illumination", np.ones(np.shape(self.values)[:2]))

    def __repr__(self) -> str:
        return f"<FieldPsfs {tuple(np.shape(self.values))}, cells of {self.pitch_um:g} um>"


@dataclass(frozen=True, repr=False, eq=False)
class Distortion:
    """Where on the image the points of a rectilinear picture land: the chief-ray map of a rotationally symmetric lens.

    Between the given radii the map is a cubic through neighbouring values; beyond the last it is straight.

    Attributes:
        image_mm: Image radii, mm, ascending from 0, at least two.
        ideal_mm: Radius of each in an image without distortion that has the same scale on the axis, mm, ascending from 0.

    Raises:
        InputError: The radii are no map.
    """

    image_mm: ArrayLike
    ideal_mm: ArrayLike

    def __post_init__(self) -> None:
        # Fail where the map is made, not where it is used.
        _ = self._core

    @cached_property
    def _core(self) -> _petzval.Distortion:
        return _petzval.Distortion(reals("image_mm", self.image_mm, "radius"), reals("ideal_mm", self.ideal_mm, "radius"))

    @classmethod
    def of(cls, lens: Lens, sensor: Sensor) -> Distortion:
        """That of a lens in front of a sensor, as ``petzval simulate`` renders it.

        Raises:
            InputError: A chief ray is lost, or the field is wider than a rectilinear picture can be.
        """
        of_class("lens", lens, Lens, "petzval.Lens.load(PATH) gives one")
        of_class("sensor", sensor, Sensor, "petzval.Sensor.load(NAME) gives one")
        with watch() as watching:
            return cls(*_petzval.Distortion.table(lens._core, sensor._core, watching))

    def to_ideal_mm(self, image_mm: ArrayLike) -> NDArray[np.float64]:
        """The ideal radius of each image radius, mm, ``[radius]``."""
        return self._core.ideal_mm(reals("image_mm", image_mm, "radius"))

    def to_image_mm(self, ideal_mm: ArrayLike) -> NDArray[np.float64]:
        """The image radius of each ideal radius, mm, ``[radius]``: where a label of the scene lands."""
        return self._core.image_mm(reals("ideal_mm", ideal_mm, "radius"))

    def frame(self, shape: tuple[int, int], pixel_um: float) -> tuple[int, int]:
        """Rows and columns of a rectilinear picture that covers everything a sensor sees, in pixels of the sensor.

        The optical axis meets the middle of both.
        """
        height, width = pair("shape", shape)
        return self._core.frame(height, width, real("pixel_um", pixel_um, "the pixel pitch in um"))

    def __reduce__(self) -> tuple[Any, ...]:
        return Distortion, (self.image_mm, self.ideal_mm)

    def __repr__(self) -> str:
        radii = np.asarray(self.image_mm)
        return f"<Distortion of {len(radii)} radii up to {radii[-1]:.3g} mm>"


@dataclass(frozen=True)
class Wiener:
    """How strongly a restoration trusts what it sees: the power of noise over that of the picture,

    ``P_c(f) = noise (10 f)^power exp(s_c(f))``, with the frequency f in cycles per pixel.

    Attributes:
        noise: P at a tenth of a cycle per pixel, above 0.
        power: Power of the frequency with which it grows, from 0.
            Both are numbers; `petzval.torch.restore` takes tensors, too.
        curves: ``s_c`` of each colour at 1/64, 1/32, ... 1/2 cycles per pixel, ``[colour, 6]``, linear in log f between; 0 if left out.
    """

    noise: Any = _petzval.wiener(None)[0]
    power: Any = _petzval.wiener(None)[1]
    curves: Any = None

    @classmethod
    def of_exposure(cls, sensor: Sensor, *, white_e: float, time_s: float = 0.0, linear_gain: float = 1.0) -> Wiener:
        """The filter for pictures of a sensor whose green pixels have `white_e` electrons of white, exposed for `time_s` at a linear gain."""
        of_class("sensor", sensor, Sensor, "petzval.Sensor.load(NAME) gives one")
        exposure = positive("white_e", white_e, "electrons, above 0"), not_negative("time_s", time_s, "seconds, 0 or above")
        noise, power = _petzval.wiener((sensor._core, *exposure, positive("linear_gain", linear_gain, "a gain above 0")))
        return cls(noise, power)


def render(
    picture: ArrayLike,
    psfs: HasPsfs,
    *,
    pixel_um: float,
    shape: tuple[int, int] | None = None,
    patches: tuple[int, int] | None = None,
    distortion: Distortion | None = None,
    row: int = 0,
    column: int = 0,
    size: tuple[int, int] | None = None,
    samples: int = 1,
    cancel: Cancel | None = None,
) -> Picture:
    """The light of a picture on the pixels of a sensor behind a lens.

    The PSF of its place spreads the light of every point, relative illumination dims it, and distortion moves it. The sensor is divided into
    patches; each has the PSF of its centre, rotated to its azimuth and integrated over pixels, and neighbouring patches blend. The optical axis
    meets the middle of the sensor.

    Args:
        picture: Light of the scene, ``[y, x, colour]`` or ``[y, x]`` for one colour: floats are linear and not negative, ``uint8`` is
            sRGB-encoded. It covers the sensor, or, with a
            distortion, what the lens projects onto it (`Distortion.frame`). Outside it its edge is repeated.
        psfs: PSFs of as many colours.
        pixel_um: Pixel pitch, um.
        shape: Rows and columns of the sensor; those of the picture if left out, which a distortion does not allow.
        patches: Rows and columns of patches; if left out as many as ``petzval simulate`` takes (`patches_for`).
        distortion: Where points land; as the picture shows them if left out.
        row: Sensor row of the first pixel of the result.
        column: Sensor column of the first pixel of the result.
        size: Rows and columns of the result; up to the last pixel of the sensor if left out.
        samples: Samples of the picture along a side of each pixel, which collects their mean.
        cancel: A flag that another thread may set.

    Returns:
        Light on the pixels, ``[y, x, colour]`` or ``[y, x]``, 1 where a uniform scene of 1 is imaged on the axis. Error of the transforms: about
        1e-6 of the largest value.

    Raises:
        InputError: An argument is out of its range, or shapes do not fit.
    """
    light, is_plane = _picture("picture", picture)
    if distortion is not None:
        of_class("distortion", distortion, Distortion, "petzval.Distortion.of(lens, sensor) gives one")
    samples = count("samples", samples)
    if shape is None:
        if distortion is not None:
            raise setting("shape", "", "left out beside a distortion", "name the rows and columns of the sensor")
        shape = light.shape[0] // max(samples, 1), light.shape[1] // max(samples, 1)
    height, width = pair("shape", shape)
    if distortion is None and light.shape[:2] != (height * samples, width * samples):
        value = f"of {light.shape[0]} x {light.shape[1]} samples"
        hint = f"the sensor has {height} x {width} pixels of {samples} x {samples} samples"
        raise setting("picture", value, "does not cover the sensor", hint)
    first = count("row", row), count("column", column)
    last = pair("size", size) if size is not None else (height - first[0], width - first[1])
    window = first + (max(last[0], 0), max(last[1], 0))
    with watch(cancel=cancel) as watching:
        renderer = _renderer(psfs, (height, width), pixel_um, patches, None, watching)
        core = None if distortion is None else distortion._core
        found = renderer.light(light, core, window, samples, watching)
    return found[..., 0] if is_plane else found


def restore(
    picture: ArrayLike,
    psfs: HasPsfs,
    *,
    pixel_um: float,
    wiener: Wiener | None = None,
    shape: tuple[int, int] | None = None,
    patches: tuple[int, int] | None = None,
    row: int = 0,
    column: int = 0,
    cancel: Cancel | None = None,
) -> Picture:
    """A picture without the blur of its lens, as far as its noise allows: a Wiener filter that varies over the sensor as the blur does.

    Each patch has the filter ``conj(K) / (|K|^2 + P)`` of its own kernel K; P is that of `Wiener`.

    Args:
        picture: Light, corrected for shading, ``[y, x, colour]`` or ``[y, x]``: floats are linear, ``uint8`` is sRGB-encoded. Beyond its border its edge is repeated.
        psfs: PSFs of as many colours.
        pixel_um: Pixel pitch, um.
        wiener: The noise; that of 16,000 electrons of white if left out.
        shape: Rows and columns of the sensor; those of the picture if left out.
        patches: Rows and columns of patches; if left out as many as ``petzval simulate`` takes (`patches_for`).
        row: Sensor row of the first pixel of the picture.
        column: Sensor column of the first pixel of the picture.
        cancel: A flag that another thread may set.

    Raises:
        InputError: An argument is out of its range, or shapes do not fit.
    """
    blurred, is_plane = _picture("picture", picture)
    wiener = Wiener() if wiener is None else of_class("wiener", wiener, Wiener, "such as petzval.Wiener(noise=0.01)")
    curves = np.zeros((blurred.shape[2], 6)) if wiener.curves is None else reals("curves", wiener.curves, "colour", "knot")
    numbers = real("noise", wiener.noise), real("power", wiener.power)
    place = count("row", row), count("column", column)
    with watch(cancel=cancel) as watching:
        renderer = _renderer(psfs, blurred.shape[:2] if shape is None else shape, pixel_um, patches, None, watching)
        found = renderer.restore(blurred, (*numbers, curves), *place, watching)
    return found[..., 0] if is_plane else found


def patches_for(
    psfs: HasPsfs, shape: tuple[int, int], *, pixel_um: float, blend_error: float | None = None
) -> tuple[int, int]:
    """The fewest rows and columns of patches that blend PSFs with a median error over the sensor.

    Args:
        psfs: The PSFs.
        shape: Rows and columns of the sensor.
        pixel_um: Pixel pitch, um.
        blend_error: Largest median error, see `blend_error`; that of scoring in experiments if left out.
    """
    with watch() as watching:
        return _renderer(psfs, shape, pixel_um, None, blend_error, watching).patches()


def blend_error(
    psfs: HasPsfs, shape: tuple[int, int], patches: tuple[int, int], *, pixel_um: float
) -> tuple[float, float]:
    """Median over the sensor, and largest, of the difference between the PSF that is blended at a place and that of the place itself.

    The difference is the sum of absolute differences over the pixels, both of unit sum, mean of the colours; 2 at most.
    """
    with watch() as watching:
        return _renderer(psfs, shape, pixel_um, patches, None, watching).blend_error(watching)


def check_azimuth(psfs: HasPsfs) -> None:
    """Fails if the PSFs of all azimuths are not these, turned about the axis from +y.

    Raises:
        InputError: The lens is not rotationally symmetric, or a field lies below the axis.
    """
    if not getattr(psfs, "rotationally_symmetric", True):
        message = "the PSFs of one azimuth are turned about the axis, which these do not allow"
        raise setting("psfs.rotationally_symmetric", "False", message, "take PSFs of a rotationally symmetric lens")
    chief_mm = getattr(psfs, "chief_mm", None)
    if isinstance(chief_mm, np.ndarray) and (chief_mm[:, 1] < -ON_AXIS_MM).any():
        message, hint = "a field below the axis: its rows run towards the axis", "take the field on the other side of the axis"
        raise setting("psfs.chief_mm", f"{chief_mm[:, 1].min():g}", message, hint)


def _renderer(
    psfs: HasPsfs,
    shape: tuple[int, ...],
    pixel_um: float,
    patches: tuple[int, int] | None,
    largest_error: float | None,
    watching: Any,
) -> _petzval.Renderer:
    if not all(hasattr(psfs, of) for of in ("values", "illumination", "field_radius_mm", "pitch_um")):
        raise setting("psfs", type(psfs).__name__, "holds no PSFs", "a petzval.PsfBank, such as petzval.psf(lens), or petzval.FieldPsfs")
    check_azimuth(psfs)
    values, illumination = (array_of(f"psfs.{of}", getattr(psfs, of), np.float32) for of in ("values", "illumination"))
    radius_mm = reals("psfs.field_radius_mm", psfs.field_radius_mm, "field")
    pitch_um, pixel_um = real("psfs.pitch_um", psfs.pitch_um), real("pixel_um", pixel_um, "the pixel pitch in um")
    if values.ndim != 4 or illumination.ndim != 2:
        found = f"of shapes {values.shape} and {illumination.shape}"
        raise setting("psfs", found, "hold no PSFs", "values [field, colour, y, x], illumination [field, colour]")
    sensor = *pair("shape", shape), pixel_um
    number = None if patches is None else pair("patches", patches)
    error = None if largest_error is None else real("blend_error", largest_error, "the largest median error, such as 0.03")
    return _petzval.Renderer(values, illumination, radius_mm, pitch_um, sensor, number, error, watching)


def _picture(name: str, picture: ArrayLike) -> tuple[Picture, bool]:
    """The light of a picture ``[y, x, colour]``, and whether it was given without colours."""
    hint = "an array [y, x] or [y, x, colour]: floats are linear light, uint8 is sRGB-encoded; petzval.read_picture reads files"
    pixels = light_of(name, picture, hint)
    if pixels.ndim not in (2, 3):
        raise setting(name, f"of shape {pixels.shape}", "has the wrong shape", "give [y, x] or [y, x, colour]")
    return (pixels[..., None], True) if pixels.ndim == 2 else (pixels, False)
