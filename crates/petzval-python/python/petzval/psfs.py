"""Point-spread functions as arrays."""

from __future__ import annotations

import base64
import html
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._errors import InputError, Place, setting
from ._petzval import Cancel
from ._watch import Progress, watch
from .lens import Lens

if TYPE_CHECKING:
    import xarray

__all__ = ["PsfBank", "psf"]

Array = NDArray[np.float64]
Kind = Literal["geometric", "diffraction"]


@dataclass(frozen=True, repr=False)
class PsfBank:
    """PSFs of a lens by field and wavelength.

    Attributes:
        values: ``[field, wavelength, y, x]``; each PSF has unit sum. y grows away from the axis; the chief ray of the reference wavelength lands
            between the two middle cells.
        illumination: Irradiance of the image of a uniform scene, 1 on the axis of a lens without vignetting, ``[field, wavelength]``.
        fields_deg: Field angles, degrees, ``[field]``.
        chief_mm: Where the chief ray of the reference wavelength lands, x and y, mm, ``[field, 2]``.
        wavelengths_um: Wavelengths, um, ``[wavelength]``.
        pitch_um: Size of a cell, um.
        captured: Share of the light that falls inside the grid, ``[field, wavelength]``.
        kind: ``"geometric"`` (rays) or ``"diffraction"`` (waves).
        pupil_cells: Cells a side of the pupil on which the PSFs were computed.
        pupil_error: Error by these cells: sum of absolute differences of a PSF of unit sum; 0 of waves.
        lens: Name of the lens.
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
            "chief_mm": (("field_deg", "axis"), self.chief_mm),
        }
        attrs = {"lens": self.lens, "kind": self.kind, "pitch_um": self.pitch_um}
        return xarray.DataArray(self.values, dims=dims, coords=coords, name="psf", attrs=attrs)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Writes ``psf.json`` and arrays as ``.npy`` into a folder, as ``petzval psf`` does and `load` reads.

        Raises:
            InputError: A part of the folder is there already and is no folder.
        """
        folder = Path(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            place = Place(path=folder, key="folder")
            raise InputError(f"{folder}: {error.strerror}", place=place, hint="name a folder that can be made") from error
        axes = {
            "lens": self.lens,
            "axes": ["field", "wavelength", "row", "column"],
            "field_deg": self.fields_deg.tolist(),
            "field_radius_mm": self.field_radius_mm.tolist(),
            "chief_ray_x_mm": self.chief_mm[:, 0].tolist(),
            "chief_ray_y_mm": self.chief_mm[:, 1].tolist(),
            "wavelengths_um": self.wavelengths_um.tolist(),
            "pitch_um": self.pitch_um,
            "kind": self.kind,
            "pupil_cells": self.pupil_cells,
            "pupil_error": self.pupil_error,
            "row_axis": "y, away from the axis",
            "captured": self.captured.tolist(),
        }
        np.save(folder / "psf.npy", self.values)
        np.save(folder / "illumination.npy", self.illumination)
        (folder / "psf.json").write_text(json.dumps(axes, indent=2) + "\n", encoding="utf-8")

    def picture_png(self, *, fields: int = 7, cells: int = 128) -> bytes:
        """The PSFs as a PNG: a column a field, a row a wavelength; three wavelengths are shown in colour and together, too.

        Brightness is the square root of the value, so that cores and tails are both visible.

        Args:
            fields: Most fields, spread evenly.
            cells: Most cells a side, around the chief ray.
        """
        for name, value in (("fields", fields), ("cells", cells)):
            if value < 1:
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
        return f"<PsfBank of {self.lens!r}: {fields} fields, {colours} wavelengths, {cells} cells of {self.pitch_um:g} um, {self.kind}>"


def psf(
    lens: Lens,
    *,
    fields_deg: ArrayLike | None = None,
    wavelengths_um: ArrayLike | None = None,
    grid: int = 64,
    pitch_um: float = 1.0,
    kind: Kind = "geometric",
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
        grid: Cells a side.
        pitch_um: Size of a cell, um.
        kind: Rays (``"geometric"``), right where spots are many times the Airy disk; or waves (``"diffraction"``), right everywhere.
        pupil_cells: Cells a side of the pupil to begin with. Waves choose their own.
        pupil_error: Error above which the pupil cells are doubled.
        progress: A function that takes every event.
        cancel: A flag that another thread may set.

    Raises:
        InputError: An argument is out of its range, or no light of a field arrives.
    """
    fields = lens.fields_deg if fields_deg is None else np.atleast_1d(np.asarray(fields_deg, dtype=np.float64))
    colours = lens.wavelengths_um if wavelengths_um is None else np.atleast_1d(np.asarray(wavelengths_um, dtype=np.float64))
    plan = _petzval.PsfPlan(fields, colours, grid, pitch_um, kind, pupil_cells)
    with watch(progress, cancel) as watching:
        values, illumination, chief_mm, captured, cells, error = plan.of_lens(lens._core, pupil_error, watching)
    return PsfBank(values, illumination, fields, chief_mm, colours, pitch_um, captured, kind, cells, error, lens.name)
