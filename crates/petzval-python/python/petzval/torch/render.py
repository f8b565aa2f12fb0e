"""Light through a lens, in plain PyTorch: on any device, differentiable by the picture, the PSFs, their illumination and their radii.

The mathematics is that of `petzval.render`; tests hold both together to 1e-5 of the largest value.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from .._arguments import count, of_class, pair
from ..rendering import Distortion, HasPsfs
from ._patches import FieldTensors, Grid, blend, checked, grid_of, replicated, wide, wrong

__all__ = ["illumination_map", "project", "render"]


def render(
    picture: Tensor,
    psfs: HasPsfs,
    *,
    pixel_um: float,
    patches: tuple[int, int] = (7, 7),
    shape: tuple[int, int] | None = None,
    row: int = 0,
    column: int = 0,
    size: tuple[int, int] | None = None,
    border: int | None = None,
    distortion: Distortion | None = None,
) -> Tensor:
    """The light of pictures on the pixels of a sensor behind a lens.

    The PSF of its place spreads the light of every point, relative illumination dims it, and distortion moves it. The optical axis meets the
    middle of the sensor. Values are not looked at: a NaN makes the pixels near it NaN.

    Args:
        picture: Linear light, ``[batch, colour, y, x]``, float32 or float64. It covers the sensor; with a `border` only the result and so many
            pixels around it; with a `distortion` what the lens projects onto the sensor (`Distortion.frame`). Outside it its edge is repeated.
        psfs: PSFs of as many colours: those of ``petzval.torch.Lens``, a `PsfBank`, or `FieldPsfs` of one's own.
        pixel_um: Pixel pitch, um.
        patches: Rows and columns of patches of constant PSF; `petzval.patches_for` says how many an accuracy needs.
        shape: Rows and columns of the sensor; those of the picture if left out.
        row: Sensor row of the first pixel of the result.
        column: Sensor column of the first pixel of the result.
        size: Rows and columns of the result; without a `border` up to the last pixel of the sensor if left out.
        border: Pixels of the picture outside the result on each side: for training on windows of a large sensor, where the PSF's reach is enough.
        distortion: Where points land; as the picture shows them if left out. It has no gradient.

    Returns:
        Light on the pixels, ``[batch, colour, y, x]``. It may be below 0 by rounding.

    Raises:
        InputError: An argument is out of its range, or shapes do not fit.
    """
    picture = checked("picture", picture)
    row, column = count("row", row), count("column", column)
    whole = (int(picture.shape[-2]), int(picture.shape[-1]))
    if shape is None:
        if distortion is not None or border is not None:
            raise wrong("shape", "", "is left out beside a distortion or a border", "name the rows and columns of the sensor")
        shape = whole
    grid = grid_of(shape, pixel_um, patches)
    if border is not None:
        border = count("border", border)
        if distortion is not None:
            raise wrong("border", border, "does not go with a distortion", "project the picture first, then render it with a border")
        found = whole[0] - 2 * border, whole[1] - 2 * border
        if size is not None and pair("size", size) != found:
            raise wrong("size", size, "is not that of the picture without its border", f"leave it out: it is {found}")
    else:
        found = pair("size", size) if size is not None else (grid.height - row, grid.width - column)
        if distortion is None and whole != (grid.height, grid.width):
            hint = "give a picture of the whole sensor, a border, or a distortion"
            raise wrong("picture", f"of {whole[0]} x {whole[1]} pixels", "does not cover the sensor", hint)
    grid.check_window(row, column, *found)
    fields = FieldTensors.of(psfs, picture)
    reach = fields.kernel_radius(grid)

    # Bring the scene onto the image, with what the PSF brings in from around the window.
    if distortion is not None:
        scene = _projected(picture, distortion, grid, (row - reach, column - reach), (found[0] + 2 * reach, found[1] + 2 * reach))
    else:
        first = (row - reach, column - reach) if border is None else (border - reach, border - reach)
        scene = replicated(picture, *first, found[0] + 2 * reach, found[1] + 2 * reach)

    # Spread every point by the PSF of its place, and dim the image off the axis.
    tiles = grid.tiles(row, column, *found)
    active = grid.active(*tiles)
    light = blend(scene, fields.kernels(grid, active), active, grid, tiles)
    return light * fields.illumination_at(grid.radius_mm(row, column, *found, picture.device))


def illumination_map(
    psfs: HasPsfs,
    size: tuple[int, int],
    *,
    pixel_um: float,
    shape: tuple[int, int] | None = None,
    row: int = 0,
    column: int = 0,
    like: Tensor | None = None,
) -> Tensor:
    """Relative illumination of the pixels of a window, ``[colour, y, x]``: what a development divides by.

    Args:
        psfs: PSFs with their illumination, 1 on the axis.
        size: Rows and columns of the window.
        pixel_um: Pixel pitch, um.
        shape: Rows and columns of the sensor; those of the window if left out.
        row: Sensor row of the first pixel.
        column: Sensor column of the first pixel.
        like: A tensor of the device and type of the result; those of the illumination if left out.
    """
    height, width = pair("size", size)
    row, column = count("row", row), count("column", column)
    grid = grid_of((height, width) if shape is None else shape, pixel_um, (1, 1))
    grid.check_window(row, column, height, width)
    table = torch.as_tensor(psfs.illumination)
    of = table if like is None else like
    fields = FieldTensors.of(psfs, torch.empty((1, *table.shape[1:2], 1, 1), device=of.device, dtype=of.dtype))
    return fields.illumination_at(grid.radius_mm(row, column, height, width, of.device))


def project(
    picture: Tensor,
    distortion: Distortion,
    size: tuple[int, int],
    *,
    pixel_um: float,
    shape: tuple[int, int] | None = None,
    row: int = 0,
    column: int = 0,
    border: int = 0,
) -> Tensor:
    """A rectilinear picture as a lens projects it onto a window of the sensor and `border` pixels around it.

    The optical axis meets the middle of the picture, whose pixels are those of the sensor. Light is resampled by cubic convolution (Keys 1981,
    a = -1/2), and light below zero is cut off. Outside the picture its edge is repeated.

    Args:
        picture: Linear light, ``[batch, colour, y, x]``.
        distortion: Where points land.
        size: Rows and columns of the window.
        pixel_um: Pixel pitch, um.
        shape: Rows and columns of the sensor; those of the window if left out.
        row: Sensor row of the first pixel of the window.
        column: Sensor column of the first pixel of the window.
        border: Pixels around the window, on each side.
    """
    picture = checked("picture", picture)
    height, width = pair("size", size)
    row, column, border = count("row", row), count("column", column), count("border", border)
    grid = grid_of((height, width) if shape is None else shape, pixel_um, (1, 1))
    grid.check_window(row, column, height, width)
    return _projected(picture, distortion, grid, (row - border, column - border), (height + 2 * border, width + 2 * border))


def _projected(picture: Tensor, distortion: Distortion, grid: Grid, first: tuple[int, int], size: tuple[int, int]) -> Tensor:
    of_class("distortion", distortion, Distortion, "petzval.Distortion.of(lens, sensor) gives one")
    # Find where in the picture the light of each pixel comes from.
    rows = np.arange(first[0], first[0] + size[0]) - 0.5 * (grid.height - 1)
    columns = np.arange(first[1], first[1] + size[1]) - 0.5 * (grid.width - 1)
    radius_mm = np.hypot(rows[:, None], columns[None, :]) * (1e-3 * grid.pixel_um)
    ideal_mm = distortion.to_ideal_mm(radius_mm.ravel()).reshape(size)
    stretch = np.divide(ideal_mm, radius_mm, out=np.ones(size), where=radius_mm > 0.0)
    height, width = int(picture.shape[-2]), int(picture.shape[-1])
    at_row, at_column = (
        torch.from_numpy(at).to(picture.device, wide(picture.device))
        for at in (rows[:, None] * stretch + 0.5 * (height - 1), columns[None, :] * stretch + 0.5 * (width - 1))
    )

    # Weigh the 4 x 4 pixels around it.
    (first_row, by_row), (first_column, by_column) = _taps(at_row, picture.dtype), _taps(at_column, picture.dtype)
    seen = torch.zeros((), device=picture.device, dtype=picture.dtype)
    for k, weight_row in enumerate(by_row):
        of_row = (first_row + k).clamp(0, height - 1)
        for l, weight_column in enumerate(by_column):
            seen = seen + weight_row * weight_column * picture[..., of_row, (first_column + l).clamp(0, width - 1)]
    return seen.clamp(min=0.0)


def _taps(at: Tensor, dtype: torch.dtype) -> tuple[Tensor, list[Tensor]]:
    """The first of the four pixels around positions, and their weights by cubic convolution."""
    floor = at.floor()
    t = (at - floor).to(dtype)
    t2, t3 = t * t, t * t * t
    weights = [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
    return floor.to(torch.int64) - 1, weights
