"""Patches of a sensor: the kernel of each, and the blend of their convolutions. The mathematics is that of Petzval's renderer.

``out(x) = sum_p w_p(x) (K_p * scene)(x)``, with weights that sum to 1, at most four of them above 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from .._arguments import pair
from .._errors import InputError, Place
from ..rendering import ON_AXIS_MM, HasPsfs, check_azimuth

MOST_SIDE, MOST_PATCHES, MOST_RADIUS = 65536, 256, 512


@dataclass(frozen=True)
class Grid:
    """A sensor of rows and columns, and its rows and columns of patches. The optical axis meets the middle of the sensor."""

    height: int
    width: int
    pixel_um: float
    patches: tuple[int, int]

    def __post_init__(self) -> None:
        for name, pair, most in (("shape", (self.height, self.width), MOST_SIDE), ("patches", self.patches, MOST_PATCHES)):
            if not all(1 <= side <= most for side in pair):
                raise wrong(name, pair, "is out of range", f"rows and columns, 1 to {most}")
        if not 1e-3 <= self.pixel_um <= 1e4:
            raise wrong("pixel_um", self.pixel_um, "is out of range", "in um, 0.001 to 10000")

    def check_window(self, row: int, column: int, height: int, width: int) -> None:
        """Fails if a window is empty or leaves the sensor."""
        hint = f"the sensor has {self.height} x {self.width} pixels, the window {height} x {width}"
        for name, start, size, whole in (("row", row, height, self.height), ("column", column, width, self.width)):
            if size < 1 or start + size > whole:
                raise wrong(name, start, "the window leaves the sensor", hint)

    def position_mm(self, row: Tensor, column: Tensor) -> tuple[Tensor, Tensor]:
        """Position x and y of rows and columns from the optical axis, mm."""
        scale = 1e-3 * self.pixel_um
        return (column - 0.5 * (self.width - 1)) * scale, (row - 0.5 * (self.height - 1)) * scale

    def radius_mm(self, row: int, column: int, height: int, width: int, device: torch.device) -> Tensor:
        """Distance of the pixels of a window from the optical axis, mm, ``[y, x]``."""
        rows = torch.arange(row, row + height, device=device, dtype=wide(device))
        columns = torch.arange(column, column + width, device=device, dtype=wide(device))
        x, y = self.position_mm(rows[:, None], columns[None, :])
        return torch.hypot(x, y)

    def tiles(self, row: int, column: int, height: int, width: int) -> tuple[list[Tile], list[Tile]]:
        """Runs of rows and of columns of a window that blend the same patches."""
        return _tiles(self.height, self.patches[0], row, height), _tiles(self.width, self.patches[1], column, width)

    def active(self, rows: list[Tile], columns: list[Tile]) -> list[int]:
        """The patches that tiles blend, ascending, numbered row by row."""
        by_row = {patch for tile in rows for patch, _ in tile.weights}
        by_column = {patch for tile in columns for patch, _ in tile.weights}
        return sorted(i * self.patches[1] + j for i in by_row for j in by_column)


@dataclass(frozen=True)
class Tile:
    """A run of pixels along an axis, counted from the window, and the weight of each patch per pixel."""

    start: int
    size: int
    weights: list[tuple[int, Tensor]]


def _centre(size: int, patches: int, patch: int) -> float:
    return (patch + 0.5) * size / patches - 0.5


def _tiles(size: int, patches: int, origin: int, count: int) -> list[Tile]:
    """Cuts a window at the patch centres: between two of them the weight is linear, outside the outer ones it is constant."""
    spacing, middle = size / patches, _centre(size, patches, 0)
    # Run s lies between the patches s - 1 and s.
    runs = [min(max(math.floor((origin + k - middle) / spacing) + 1, 0), patches) for k in range(count)]
    ends = [k for k in range(1, count) if runs[k] != runs[k - 1]] + [count]
    tiles, start = [], 0
    for end in ends:
        s = runs[start]
        if s in (0, patches):
            weights = [(min(max(s - 1, 0), patches - 1), torch.ones(end - start, dtype=torch.float64))]
        else:
            upper = (torch.arange(origin + start, origin + end, dtype=torch.float64) - middle) / spacing - (s - 1)
            weights = [(s - 1, 1.0 - upper), (s, upper)]
        tiles.append(Tile(start, end - start, weights))
        start = end
    return tiles


@dataclass(frozen=True)
class FieldTensors:
    """PSFs as tensors of the device and type of a picture; radii are as precise as the device has them."""

    values: Tensor
    illumination: Tensor
    radius_mm: Tensor
    pitch_um: float

    @classmethod
    def of(cls, psfs: HasPsfs, like: Tensor) -> FieldTensors:
        """Checks shapes and the order of the fields; values are not looked at."""
        check_azimuth(psfs)
        values, light = (torch.as_tensor(of).to(like.device, like.dtype) for of in (psfs.values, psfs.illumination))
        radius = _radius_mm(psfs).to(like.device, wide(like.device))
        colours = like.shape[1]
        fields, cells = (radius.shape[0], values.shape[-1]) if radius.ndim == 1 and values.ndim == 4 else (0, 0)
        if fields == 0 or values.shape != (fields, colours, cells, cells) or light.shape != (fields, colours):
            found = f"of shapes {tuple(values.shape)}, {tuple(light.shape)} and {tuple(radius.shape)}"
            hint = f"values [field, {colours}, y, x], illumination [field, {colours}], field_radius_mm [field]"
            raise wrong("psfs", found, "do not fit the picture or one another", hint)
        pitch_um = float(psfs.pitch_um)
        if not 0.0 < pitch_um < math.inf:
            raise wrong("pitch_um", pitch_um, "is not positive", "size of a cell in um")
        _check_outwards(psfs)
        return cls(values, light, radius, pitch_um)

    def bracket(self, radius_mm: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The two fields around image radii, and the weight of the upper one, linear between them; beyond the last field it is that field alone."""
        last = self.radius_mm.shape[0] - 1
        lower = (torch.searchsorted(self.radius_mm.detach(), radius_mm.contiguous(), right=True) - 1).clamp(0, last)
        upper = (lower + 1).clamp(max=last)
        width = self.radius_mm[upper] - self.radius_mm[lower]
        is_between = upper > lower
        share = (radius_mm - self.radius_mm[lower]) / torch.where(is_between, width, torch.ones_like(width))
        return lower, upper, torch.where(is_between, share, torch.zeros_like(share))

    def kernel_radius(self, grid: Grid) -> int:
        """Pixels from the centre of a kernel to its edge: the corner of the PSF may come to lie on an axis."""
        corner_um = (0.5 * (self.values.shape[-1] - 1) * math.sqrt(2.0) + 0.5) * self.pitch_um
        radius = math.floor(corner_um / grid.pixel_um + 0.5)
        if radius > MOST_RADIUS:
            raise wrong("pitch_um", self.pitch_um, f"the PSFs reach {radius} pixels", f"at most {MOST_RADIUS}: check pitch and pixel size")
        return radius

    def kernels(self, grid: Grid, patches: list[int]) -> Tensor:
        """The kernels of patches, ``[patch, colour, y, x]``, linear in the PSFs.

        The PSFs of the two fields around the patch are mixed and turned to its azimuth. The centre of a cell turns; the cell stays a box along
        the axes, and each pixel below it receives light in proportion to the area. The middle element is the pixel of the image point.
        """
        device, dtype = self.values.device, wide(self.values.device)
        reach, cells = self.kernel_radius(grid), self.values.shape[-1]
        side, colours = 2 * reach + 1, self.values.shape[1]
        numbers = torch.tensor(patches, device=device)
        rows = (numbers // grid.patches[1] + 0.5) * (grid.height / grid.patches[0]) - 0.5
        columns = (numbers % grid.patches[1] + 0.5) * (grid.width / grid.patches[1]) - 0.5
        x_mm, y_mm = grid.position_mm(rows.to(dtype), columns.to(dtype))

        # Mix the PSFs of the fields around each patch.
        lower, upper, share = self.bracket(torch.hypot(x_mm, y_mm))
        share = share.to(self.values.dtype)[:, None, None, None]
        mixed = (1.0 - share) * self.values[lower] + share * self.values[upper]
        mixed = mixed.reshape(len(patches), colours, -1).transpose(0, 1).reshape(colours, -1)

        # Turn the centres of the cells; on the axis there is no azimuth.
        radius = torch.hypot(x_mm, y_mm)
        is_axis = radius < 1e-9 * grid.pixel_um
        safe = torch.where(is_axis, torch.ones_like(radius), radius)
        along_x = torch.where(is_axis, torch.zeros_like(radius), x_mm / safe)[:, None]
        along_y = torch.where(is_axis, torch.ones_like(radius), y_mm / safe)[:, None]
        offset = (torch.arange(cells, device=device, dtype=dtype) - 0.5 * (cells - 1)) * self.pitch_um
        x_psf, y_psf = offset.repeat(cells), offset.repeat_interleave(cells)
        x, y = x_psf * along_y + y_psf * along_x, y_psf * along_y - x_psf * along_x

        # Share each cell among the pixels below it.
        (first_x, by_x), (first_y, by_y) = (_shares(at, self.pitch_um, grid.pixel_um, reach) for at in (x, y))
        base = torch.arange(len(patches), device=device)[:, None] * side**2
        out = mixed.new_zeros((colours, len(patches) * side**2))
        for dy, share_y in enumerate(by_y):
            row = base + (first_y + dy).clamp(max=side - 1) * side
            for dx, share_x in enumerate(by_x):
                pixel = row + (first_x + dx).clamp(max=side - 1)
                out = out.index_add(1, pixel.flatten(), mixed * (share_y * share_x).flatten().to(mixed.dtype))
        return out.reshape(colours, len(patches), side, side).transpose(0, 1)

    def illumination_at(self, radius_mm: Tensor) -> Tensor:
        """Relative illumination at image radii ``[y, x]``, ``[colour, y, x]``."""
        lower, upper, share = self.bracket(radius_mm)
        share = share.to(self.values.dtype)
        return (1.0 - share) * self.illumination.T[:, lower] + share * self.illumination.T[:, upper]


def _shares(at_um: Tensor, cell_um: float, pixel_um: float, reach: int) -> tuple[Tensor, list[Tensor]]:
    """The first pixel below each box of a cell, and the shares of that pixel and those after it."""
    low, high = at_um - 0.5 * cell_um, at_um + 0.5 * cell_um
    first, last = (((edge / pixel_um + 0.5).floor() + reach).clamp(0, 2 * reach).to(torch.int64) for edge in (low, high))
    shares = []
    for step in range(math.ceil(cell_um / pixel_um) + 1):
        pixel = first + step
        edge = (pixel - reach - 0.5) * pixel_um
        lower = torch.where(pixel == first, low, edge)
        upper = torch.where(pixel == last, high, edge + pixel_um)
        shares.append(torch.where(pixel <= last, (upper - lower) / cell_um, torch.zeros_like(low)))
    return first, shares


def blend(scene: Tensor, kernels: Tensor, patches: list[int], grid: Grid, tiles: tuple[list[Tile], list[Tile]]) -> Tensor:
    """Convolves a scene with the kernels of its place, ``[b, c, y, x]``; the result is smaller by the kernels' radius on each side."""
    border, slot = kernels.shape[-1] - 1, {patch: i for i, patch in enumerate(patches)}
    spectra: dict[tuple[int, int, int], Tensor] = {}
    lines = []
    for rows in tiles[0]:
        line = []
        for columns in tiles[1]:
            # Transform the light under the tile and its border, and the kernels of its patches.
            size = fast_size(rows.size + border), fast_size(columns.size + border)
            block = scene[..., rows.start : rows.start + rows.size + border, columns.start : columns.start + columns.size + border]
            light = torch.fft.rfft2(block, s=size)
            total = None
            for i, by_row in rows.weights:
                for j, by_column in columns.weights:
                    key = (*size, slot[i * grid.patches[1] + j])
                    if key not in spectra:
                        spectra[key] = torch.fft.rfft2(kernels[key[2]], s=size)
                    # Convolve, and keep what no wrap of the transform has reached.
                    blurred = torch.fft.irfft2(light * spectra[key], s=size)[..., border : border + rows.size, border : border + columns.size]
                    weight = (by_row[:, None] * by_column[None, :]).to(scene.dtype).to(scene.device)
                    total = blurred * weight if total is None else total + blurred * weight
            assert total is not None
            line.append(total)
        lines.append(torch.cat(line, dim=-1))
    return torch.cat(lines, dim=-2)


def replicated(picture: Tensor, row: int, column: int, height: int, width: int) -> Tensor:
    """A window of a picture; outside it its edge is repeated."""
    rows = torch.arange(row, row + height, device=picture.device).clamp(0, picture.shape[-2] - 1)
    columns = torch.arange(column, column + width, device=picture.device).clamp(0, picture.shape[-1] - 1)
    return picture.index_select(-2, rows).index_select(-1, columns)


def fast_size(size: int) -> int:
    """Smallest even length with no prime factor above 5 that holds `size` samples."""
    size = max(size + size % 2, 2)
    while True:
        rest = size
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return size
        size += 2


def wide(device: torch.device) -> torch.dtype:
    """The most precise floating-point type of a device."""
    return torch.float32 if device.type == "mps" else torch.float64


def checked(name: str, picture: Tensor) -> Tensor:
    """A batch of pictures ``[b, c, y, x]`` in float32 or float64."""
    if not isinstance(picture, Tensor) or picture.dtype not in (torch.float32, torch.float64):
        found = getattr(picture, "dtype", type(picture).__name__)
        raise wrong(name, f"of type {found}", "is no picture", "give a tensor of float32 or float64")
    if picture.ndim != 4 or 0 in picture.shape:
        raise wrong(name, f"of shape {tuple(picture.shape)}", "has the wrong shape", "give [batch, colour, y, x]")
    return picture


def grid_of(shape: tuple[int, ...], pixel_um: float, patches: tuple[int, int]) -> Grid:
    """A sensor and its patches, checked."""
    height, width = pair("shape", tuple(shape))
    if isinstance(pixel_um, (str, bytes)):
        raise wrong("pixel_um", repr(pixel_um), "is no number", "in um, 0.001 to 10000")
    return Grid(height, width, float(pixel_um), pair("patches", patches))


def wrong(name: str, value: object, message: str, hint: str) -> InputError:
    """The error of an argument."""
    return InputError(f"{name} {value}: {message}", message=message, place=Place(key=name, value=str(value)), hint=hint, kind="setting")


def _check_outwards(psfs: Any) -> None:
    """Fails if there are several fields whose image radii do not ascend from 0: none would lie between its neighbours.

    Of a lens that moves its field angles are looked at, which ``torch.compile`` and ``torch.func`` know; other radii are looked at outside of these.
    """
    hint = "begin on the axis, and let each field lie further out than the last"
    if isinstance(psfs, tuple):
        fields: tuple[float, ...] = psfs.fields_deg  # type: ignore[attr-defined]
        if len(fields) > 1 and (fields[0] != 0.0 or any(later <= field for field, later in zip(fields, fields[1:]))):
            raise wrong("psfs.fields_deg", fields, "do not ascend from 0", hint)
        return
    radius = _radius_mm(psfs)
    if torch.compiler.is_compiling() or torch._C._functorch.is_functorch_wrapped_tensor(radius) or radius.device.type == "meta":
        return
    found = radius.detach().cpu()
    # Differences of gradients move the axis a little.
    if len(found) > 1 and not (abs(float(found[0])) <= 1e-3 * abs(float(found[-1])) and bool((found.diff() > 0.0).all())):
        raise wrong("psfs.field_radius_mm", found.tolist(), "do not ascend from 0", hint)


def _radius_mm(psfs: Any) -> Tensor:
    """Image radii, by their own name or as distances of chief rays."""
    # PSFs of a lens that moves are a named tuple, whose properties ``torch.compile`` does not follow.
    is_by_chief = isinstance(psfs, tuple) or not hasattr(psfs, "field_radius_mm")
    return radii(torch.as_tensor(psfs.chief_mm)) if is_by_chief else torch.as_tensor(psfs.field_radius_mm)


def radii(points_mm: Tensor) -> Tensor:
    """Distances of points ``[point, 2]`` from the axis; on the axis their derivative is 0."""
    square = points_mm.square().sum(-1)
    is_axis = square == 0.0
    return torch.where(is_axis, torch.zeros_like(square), torch.where(is_axis, torch.ones_like(square), square).sqrt())
