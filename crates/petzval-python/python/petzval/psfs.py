"""Point-spread functions as arrays."""

from __future__ import annotations

import base64
import html
import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from . import _petzval
from ._arguments import count, json_of, of_class, path_of, real, reals, text
from ._errors import setting
from ._petzval import Cancel
from ._watch import Progress, watch
from .lens import Lens

if TYPE_CHECKING:
    import xarray

__all__ = ["PsfBank", "psf"]

Array = NDArray[np.float64]
Kind = Literal["geometric", "diffraction", "measured", "other"]
Traced = Literal["geometric", "diffraction"]
Channel = Literal["red", "green", "blue"]


def _json(axes: dict[str, Any]) -> str:
    """Axes as JSON, which has no number that is not finite."""
    for key, value in axes.items():
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, float) and not math.isfinite(number):
                raise setting(key, str(number), "not finite", "give finite numbers")
    return json_of("axes", axes, "give numbers and texts")


@dataclass(frozen=True, repr=False, eq=False)
class PsfBank:
    """PSFs by field and wavelength: of a lens, measured, or made elsewhere.

    Attributes:
        values: ``[field, wavelength, y, x]``; each PSF has unit sum. y grows away from the axis; the chief ray of the reference wavelength lands
            between the two middle cells.
        illumination: Irradiance of the image of a uniform scene, 1 on the axis of a lens without vignetting, ``[field, wavelength]``.
        fields_deg: Field angles, degrees, ``[field]``.
        chief_mm: Where the chief ray of the reference wavelength lands, x and y, mm, ``[field, 2]``.
        wavelengths_um: Wavelengths, um, ``[wavelength]``.
        pitch_um: Size of a cell, um.
        captured: Share of the light that falls inside the grid, ``[field, wavelength]``.
        kind: ``"geometric"`` (rays), ``"diffraction"`` (waves), ``"measured"`` or ``"other"``.
        pupil_cells: Cells a side of the pupil on which the PSFs were computed.
        pupil_error: Error by these cells: sum of absolute differences of a PSF of unit sum; 0 of waves.
        lens: Name of the lens.
        channels: The colour of a camera for which each wavelength stands; empty where that is not said.
        source: Where the PSFs come from, in words.
        rotationally_symmetric: Whether the PSFs of other azimuths are these, turned: only then a camera takes them.
        image_scale_mm: Image height per tangent of the field near the axis, mm, by which cameras know the distortion; NaN if it is not known.
    """

    values: Array
    illumination: Array
    fields_deg: Array
    chief_mm: Array
    wavelengths_um: Array
    pitch_um: float
    captured: Array
    kind: Kind
    pupil_cells: int
    pupil_error: float
    lens: str
    channels: tuple[Channel, ...] = ()
    source: str = ""
    rotationally_symmetric: bool = True
    image_scale_mm: float = float("nan")

    @property
    def field_radius_mm(self) -> Array:
        """Image radius of each field, mm, ``[field]``."""
        radius: Array = np.hypot(self.chief_mm[:, 0], self.chief_mm[:, 1])
        return radius

    @property
    def x_um(self) -> Array:
        """Centres of the columns from the chief ray, um; rows have the same."""
        cells = self.values.shape[-1]
        centres: Array = (np.arange(cells) - 0.5 * (cells - 1)) * self.pitch_um
        return centres

    def to_xarray(self) -> xarray.DataArray:
        """The values as a labelled array with dimensions ``field_deg``, ``wavelength_um``, ``y_um`` and ``x_um``. Needs xarray."""
        import xarray

        dims = ("field_deg", "wavelength_um", "y_um", "x_um")
        coords = {
            "field_deg": self.fields_deg,
            "wavelength_um": self.wavelengths_um,
            "y_um": self.x_um,
            "x_um": self.x_um,
            "illumination": (dims[:2], self.illumination),
            "captured": (dims[:2], self.captured),
            "chief_x_mm": (dims[:1], self.chief_mm[:, 0]),
            "chief_y_mm": (dims[:1], self.chief_mm[:, 1]),
        }
        attrs = {"lens": self.lens, "kind": self.kind, "pitch_um": self.pitch_um}
        return xarray.DataArray(self.values, dims=dims, coords=coords, name="psf", attrs=attrs)

    @classmethod
    def of(
        cls,
        values: ArrayLike,
        *,
        pitch_um: float,
        field_radius_mm: ArrayLike,
        illumination: ArrayLike | None = None,
        fields_deg: ArrayLike | None = None,
        wavelengths_um: ArrayLike | None = None,
        channels: Sequence[Channel] | None = None,
        kind: Kind = "other",
        source: str = "",
    ) -> PsfBank:
        """A bank of PSFs that were measured or computed elsewhere, of a rotationally symmetric lens.

        The PSFs are those of points on the +y axis of the image: rows run along y, away from the axis, and columns along x. The image point is
        in the middle of the grid, and cells hold the light that falls on them. PSFs that were measured in pixels are integrated over them already;
        a camera would blur them twice.

        Args:
            values: ``[field, wavelength, y, x]``, square, 0 or more. Each PSF is divided by its sum.
            pitch_um: Size of a cell, um, 1e-6 to 1000.
            field_radius_mm: Distance from the axis at which each field is imaged, mm, ``[field]``. Cameras need one at 0.
            illumination: Relative illumination, 1 on the axis, ``[field, wavelength]``; 1 everywhere if left out.
            fields_deg: Field angles, degrees, ``[field]``; unknown (NaN) if left out.
            wavelengths_um: Wavelengths, um, ``[wavelength]``; unknown (NaN) if left out.
            channels: The colour for which each wavelength stands. Without it cameras take the longest of three wavelengths for red; one stands for
                all colours.
            kind: How they were made.
            source: Where they come from, in words.

        Raises:
            InputError: Shapes disagree, a number is out of its range, or a PSF has no light.
        """
        psfs = reals("values", values, "field", "wavelength", "y", "x")
        radius = reals("field_radius_mm", field_radius_mm, "field")
        if kind not in get_args(Kind):
            raise setting("kind", repr(kind), "there is no such kind", ", ".join(get_args(Kind)))
        text("source", source)
        for number, channel in enumerate(channels or ()):
            if channel not in get_args(Channel):
                raise setting(f"channels[{number}]", repr(channel), "is no colour of a camera", ", ".join(get_args(Channel)))
        if (radius < 0.0).any():
            raise setting("field_radius_mm", str(radius.min()), "no distance", "in mm, 0 on the axis")
        fields, colours = psfs.shape[:2]
        unknown = np.full(fields, np.nan), np.full(colours, np.nan)
        bank = cls(
            values=psfs,
            illumination=np.ones((fields, colours))
            if illumination is None
            else reals("illumination", illumination, "field", "wavelength"),
            fields_deg=unknown[0] if fields_deg is None else reals("fields_deg", fields_deg, "field"),
            chief_mm=np.stack([np.zeros_like(radius), radius], axis=-1),
            wavelengths_um=unknown[1] if wavelengths_um is None else reals("wavelengths_um", wavelengths_um, "wavelength"),
            pitch_um=real("pitch_um", pitch_um, "a length in um"),
            captured=np.full((fields, colours), np.nan),
            kind=kind,
            pupil_cells=0,
            pupil_error=0.0,
            lens="",
            channels=tuple(channels or ()),
            source=source,
        )
        with watch() as watching:
            normalised, light = _petzval.psfs_of(bank._axes(), bank.values, bank.illumination, watching)
        return replace(bank, values=normalised, illumination=light)

    def save(self, folder: str | os.PathLike[str], *, dtype: DTypeLike = np.float64) -> None:
        """Writes ``psf.json``, ``psf.npy`` and ``illumination.npy`` into a folder, as ``petzval psf`` does.

        `load` reads the folder, and so do ``simulate``, ``apply``, ``evaluate`` (``psfs`` of their requests) and experiments
        (``[psf] kind = "file"``).

        Args:
            folder: The folder; it is made if it does not exist.
            dtype: Precision of the PSFs: ``float16``, ``float32`` or ``float64``.

        Raises:
            InputError: The bank has a fault, or nothing can be written there.
        """
        try:
            precision = np.dtype(dtype).name
        except TypeError as error:
            raise setting("dtype", repr(dtype), str(error), "numpy.float16, float32 or float64") from error
        with watch() as watching:
            _petzval.psfs_save(path_of("folder", folder), self._axes(), self.values, self.illumination, precision, watching)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> PsfBank:
        """Reads a bank: a folder that ``petzval psf``, ``petzval psf-calibrate`` or `save` wrote, or its ``psf.json``.

        What the file does not say is NaN, 0 or empty. ``psfs.toml`` of earlier versions is read, too.

        Raises:
            InputError: A file has a defect, which is named with file, key and value.
        """
        with watch() as watching:
            found, (values, illumination) = _petzval.psfs_load(path_of("path", path), watching)
        axes = json.loads(found)
        fields, colours = values.shape[:2]
        radius = np.array(axes["field_radius_mm"], dtype=np.float64)

        def known(key: str, otherwise: Array) -> Array:
            return np.array(axes[key], dtype=np.float64) if key in axes else otherwise

        y = known("chief_ray_y_mm", radius)
        return cls(
            values=values,
            illumination=illumination,
            fields_deg=known("field_deg", np.full(fields, np.nan)),
            chief_mm=np.stack([known("chief_ray_x_mm", np.zeros(fields)), y], axis=-1),
            wavelengths_um=known("wavelengths_um", np.full(colours, np.nan)),
            pitch_um=axes["pitch_um"],
            captured=known("captured", np.full((fields, colours), np.nan)),
            kind=axes.get("kind", "other"),
            pupil_cells=axes.get("pupil_cells", 0),
            pupil_error=axes.get("pupil_error", 0.0),
            lens=axes.get("lens", ""),
            channels=tuple(axes.get("channels", ())),
            source=axes.get("source", ""),
            rotationally_symmetric=axes["rotationally_symmetric"],
            image_scale_mm=axes.get("image_scale_mm", float("nan")),
        )

    def _axes(self) -> str:
        """The axes as in ``psf.json``; what is not known is left out.

        Raises:
            InputError: A number is not finite, or fields that may be turned about the axis do not lie further and further out.
        """
        radius_mm = self.field_radius_mm
        if self.rotationally_symmetric and (np.diff(radius_mm) <= 0.0).any():
            raise setting("field_radius_mm", str(radius_mm.tolist()), "do not ascend", "let each field lie further out than the last")
        lists = {
            "field_radius_mm": self.field_radius_mm,
            "chief_ray_x_mm": self.chief_mm[:, 0],
            "chief_ray_y_mm": self.chief_mm[:, 1],
            "field_deg": self.fields_deg,
            "wavelengths_um": self.wavelengths_um,
            "captured": self.captured,
        }
        needed = {"field_radius_mm", "chief_ray_x_mm", "chief_ray_y_mm"}
        axes: dict[str, Any] = {
            "format": "petzval-psfs",
            "version": 1,
            "lens": self.lens,
            "source": self.source,
            "kind": self.kind,
            "pitch_um": self.pitch_um,
            "rotationally_symmetric": self.rotationally_symmetric,
            "row_axis": "y, away from the axis" if self.rotationally_symmetric else "y",
            "channels": list(self.channels),
            "pupil_error": self.pupil_error,
        }
        axes |= {key: of.tolist() for key, of in lists.items() if key in needed or not np.isnan(of).all()}
        if self.pupil_cells > 0:
            axes["pupil_cells"] = self.pupil_cells
        if not np.isnan(self.image_scale_mm):
            axes["image_scale_mm"] = self.image_scale_mm
        return _json(axes)

    def picture_png(self, *, fields: int = 7, cells: int = 128) -> bytes:
        """The PSFs as a PNG: a column a field, a row a wavelength; three wavelengths are shown in colour and together, too.

        Brightness is the square root of the value, so that cores and tails are both visible.

        Args:
            fields: Most fields, spread evenly.
            cells: Most cells a side, around the chief ray.
        """
        for name, value in (("fields", fields), ("cells", cells)):
            if count(name, value) < 1:
                raise setting(name, str(value), "nothing would be shown", "1 or more")
        every, colours, side, _ = self.values.shape
        shown = np.unique(np.linspace(0, every - 1, min(fields, every)).round().astype(int))
        three = np.unique(np.linspace(0, colours - 1, min(3, colours)).round().astype(int))
        edge = max(0, (side - cells) // 2)
        middle = slice(edge, side - edge)
        values = self.values[np.ix_(shown, three)][:, :, middle, middle]
        with watch() as watching:
            png = _petzval.psf_picture(
                values, self.fields_deg[shown], self.chief_mm[shown], self.wavelengths_um[three], self.pitch_um, watching
            )
        return bytes(png)

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.picture_png()).decode("ascii")
        caption = html.escape(repr(self))
        return f'<figure><img alt="{caption}" src="data:image/png;base64,{data}"><figcaption>{caption}</figcaption></figure>'

    def __repr__(self) -> str:
        fields, colours, cells, _ = self.values.shape
        return f"<PsfBank of {self.lens or self.source!r}: {fields} fields, {colours} wavelengths, {cells} cells of {self.pitch_um:g} um, {self.kind}>"


def psf(
    lens: Lens,
    *,
    fields_deg: ArrayLike | None = None,
    wavelengths_um: ArrayLike | None = None,
    grid: int = 64,
    pitch_um: float = 1.0,
    kind: Traced = "geometric",
    pupil_cells: int = 64,
    pupil_error: float = 0.02,
    progress: Progress = False,
    cancel: Cancel | None = None,
) -> PsfBank:
    """The PSFs of a lens by exact tracing.

    Args:
        lens: The lens.
        fields_deg: Field angles, degrees; those of the lens if left out.
        wavelengths_um: Wavelengths, um, 0.2 to 20; those of the lens if left out.
        grid: Cells a side, 16 to 1024.
        pitch_um: Size of a cell, um, 1e-6 to 1000. Rays share their light among the cells around them, which widens a PSF by half a cell RMS: give
            cells that are small against the spot.
        kind: Rays (``"geometric"``), right where spots are many times the Airy disk; or waves (``"diffraction"``), right everywhere.
        pupil_cells: Cells a side of the pupil to begin with, 12 to 4096 and even. Waves choose their own.
        pupil_error: Error above which the pupil cells are doubled.
        progress: ``True`` for a bar, or a function that takes every event.
        cancel: A flag that another thread may set.

    Raises:
        InputError: An argument is out of its range, or no light of a field arrives.
    """
    of_class("lens", lens, Lens, "petzval.Lens.load(PATH) gives one")
    fields = lens.fields_deg if fields_deg is None else reals("fields_deg", fields_deg, "field")
    colours = lens.wavelengths_um if wavelengths_um is None else reals("wavelengths_um", wavelengths_um, "wavelength")
    if not isinstance(kind, str):
        raise setting("kind", repr(kind), "no such kind", '"geometric" or "diffraction"')
    cells = count("grid", grid), count("pupil_cells", pupil_cells)
    plan = _petzval.PsfPlan(fields, colours, cells[0], real("pitch_um", pitch_um, "a length in um"), kind, cells[1])
    pupil_error = real("pupil_error", pupil_error)
    with watch(progress, cancel) as watching:
        values, illumination, chief_mm, captured, pupil_cells, error = plan.of_lens(lens._core, pupil_error, watching)
    scale_mm = plan.image_scale_mm(lens._core)
    return PsfBank(
        values,
        illumination,
        fields,
        chief_mm,
        colours,
        pitch_um,
        captured,
        kind,
        pupil_cells,
        error,
        lens.name,
        rotationally_symmetric=_petzval.is_rotationally_symmetric(lens._core),
        image_scale_mm=float("nan") if scale_mm is None else scale_mm,
    )
