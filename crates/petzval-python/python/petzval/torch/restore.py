"""Restoration in plain PyTorch: a Wiener filter that varies over the sensor as the blur does, differentiable by everything that it depends on."""

from __future__ import annotations

import torch
from torch import Tensor

from .._arguments import count, of_class
from ..rendering import HasPsfs, Wiener
from ._patches import FieldTensors, blend, checked, fast_size, grid_of, replicated, wide, wrong

__all__ = ["restore"]

LEAST_SIDE = 64
"""Least side of the transform of a kernel, pixels: filters reach half as far."""

KNOTS = 6
"""Knots of a curve, an octave apart; the last is at half a cycle per pixel."""


def restore(
    picture: Tensor,
    psfs: HasPsfs,
    *,
    pixel_um: float,
    wiener: Wiener | None = None,
    patches: tuple[int, int] = (7, 7),
    shape: tuple[int, int] | None = None,
    row: int = 0,
    column: int = 0,
) -> Tensor:
    """Pictures without the blur of their lens, as far as their noise allows.

    Each patch has the filter ``G = conj(K) / (|K|^2 + P)`` of its own kernel K; P is that of `Wiener`. Values are not looked at.

    Args:
        picture: Linear light, corrected for shading, ``[batch, colour, y, x]``, float32 or float64. Beyond its border its edge is repeated.
        psfs: PSFs of as many colours, as `render` takes them. A lens that moves is filtered otherwise: the gradient follows.
        pixel_um: Pixel pitch, um.
        wiener: The noise, whose numbers may be tensors that are trained; that of 16,000 electrons of white if left out.
        patches: Rows and columns of patches of constant filter.
        shape: Rows and columns of the sensor; those of the picture if left out.
        row: Sensor row of the first pixel of the picture.
        column: Sensor column of the first pixel of the picture.

    Raises:
        InputError: An argument is out of its range, or shapes do not fit.
    """
    picture = checked("picture", picture)
    wiener = Wiener() if wiener is None else of_class("wiener", wiener, Wiener, "such as petzval.Wiener(noise=0.01)")
    row, column = count("row", row), count("column", column)
    height, width = int(picture.shape[-2]), int(picture.shape[-1])
    grid = grid_of((height, width) if shape is None else shape, pixel_um, patches)
    grid.check_window(row, column, height, width)
    fields = FieldTensors.of(psfs, picture)
    tiles = grid.tiles(row, column, height, width)
    active = grid.active(*tiles)
    filters = _filters(fields.kernels(grid, active), wiener)
    reach = filters.shape[-1] // 2
    scene = replicated(picture, -reach, -reach, height + 2 * reach, width + 2 * reach)
    return blend(scene, filters, active, grid, tiles)


def _filters(kernels: Tensor, wiener: Wiener) -> Tensor:
    """The filters of kernels, ``[patch, colour, y, x]``."""
    reach = kernels.shape[-1] // 2
    side = fast_size(max(4 * reach, LEAST_SIDE))
    # Transform each kernel about its middle, and invert it where it stands above the noise.
    placed = torch.nn.functional.pad(kernels, (0, side - kernels.shape[-1], 0, side - kernels.shape[-1])).roll((-reach, -reach), (-2, -1))
    spectrum = torch.fft.rfft2(placed)
    power = spectrum.real.square() + spectrum.imag.square()
    inverse = spectrum.conj() / (power + _regularisation(kernels, wiener, side))
    # Keep what lies around the middle.
    half = side // 2 - 1
    filters: Tensor = torch.fft.irfft2(inverse, s=(side, side)).roll((half, half), (-2, -1))
    return filters[..., : 2 * half + 1, : 2 * half + 1]


def _regularisation(kernels: Tensor, wiener: Wiener, side: int) -> Tensor:
    """``P_c(f) = noise (10 f)^power exp(s_c(f))`` over a half spectrum, ``[colour or 1, y, x]``."""
    device, dtype, colours = kernels.device, kernels.dtype, kernels.shape[1]
    precise = wide(device)
    rows = torch.arange(side, device=device, dtype=precise)
    columns = torch.arange(side // 2 + 1, device=device, dtype=precise)
    frequency = torch.hypot(torch.minimum(rows, side - rows)[:, None], columns[None, :]) / side
    prior: Tensor = (wiener.noise * (10.0 * frequency) ** wiener.power).to(dtype)
    if wiener.curves is None:
        return prior[None]
    curves = torch.as_tensor(wiener.curves).to(device, dtype)
    if curves.shape != (colours, KNOTS):
        raise wrong("curves", f"of shape {tuple(curves.shape)}", "are no curves of these colours", f"give [{colours}, {KNOTS}]")
    position = (frequency.log2() + KNOTS).clamp(0, KNOTS - 1)
    lower = position.floor().clamp(max=KNOTS - 2).to(torch.int64)
    upper = (position - lower).to(dtype)
    bend: Tensor = (1.0 - upper) * curves[:, lower] + upper * curves[:, lower + 1]
    return prior * bend.exp()
