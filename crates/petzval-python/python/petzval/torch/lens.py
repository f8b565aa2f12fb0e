"""A lens as a module of PyTorch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from .. import _petzval
from .._errors import InputError, Place
from ..lens import DesignSpace
from ..lens import Lens as PlainLens
from ..psfs import Kind
from . import _ops
from ._exact import alike, keeping_types
from ._patches import radii

__all__ = ["Lens", "Psfs"]


class Psfs(NamedTuple):
    """PSFs of a lens by field and wavelength, float64.

    Attributes:
        values: ``[field, wavelength, y, x]``; each PSF has unit sum. y grows away from the axis; the chief ray of the reference wavelength lands
            between the two middle cells.
        illumination: Irradiance of the image of a uniform scene, 1 on the axis of a lens without vignetting, ``[field, wavelength]``.
        chief_mm: Where the chief ray of the reference wavelength lands, x and y, mm, ``[field, 2]``.
        captured: Share of the light that falls inside the grid, ``[field, wavelength]``. It has no gradient.
        fields_deg: Field angles, degrees.
        wavelengths_um: Wavelengths, um.
        pitch_um: Size of a cell, um.
        kind: ``"geometric"`` (rays) or ``"diffraction"`` (waves).
        rotationally_symmetric: Whether the PSFs of other azimuths are these, turned: only then `render` and `restore` take them.
    """

    values: Tensor
    illumination: Tensor
    chief_mm: Tensor
    captured: Tensor
    fields_deg: tuple[float, ...]
    wavelengths_um: tuple[float, ...]
    pitch_um: float
    kind: Kind
    rotationally_symmetric: bool = True

    @property
    def field_radius_mm(self) -> Tensor:
        """Image radius of each field, mm, ``[field]``."""
        return radii(self.chief_mm)

    def to(self, *args: Any, **options: Any) -> Psfs:
        """The same with every tensor as ``Tensor.to`` makes it, such as ``psfs.to("cuda", torch.float32)``. Gradients pass."""
        values, illumination, chief_mm, captured, *rest = self
        moved = (tensor.to(*args, **options) for tensor in (values, illumination, chief_mm, captured))
        return Psfs(*moved, *rest)


@dataclass
class Cut:
    """The numbers of a lens as a leaf, while a loss is lifted to its rays: the graph of PSFs ends here."""

    numbers: Tensor
    plans: list[Any] = field(default_factory=list)


class Lens(nn.Module):
    """A lens that moves: PSFs and penalty with exact gradients by its free coordinates.

    The only parameter, ``x``, ``[coordinate]``, holds the free coordinates of a design space: angles of about the size of 1, without bounds, so
    that one learning rate suits all; 1e-2 is usual for Adam. It stays float64 whatever the rest of a model is cast to (``.half()``,
    ``.to(torch.bfloat16)``): in float32 gradients of PSFs are 1e-5 off. Cast the PSFs instead.

    Rays are traced on the CPU. If ``x`` is on another device, it is copied to the CPU and the results are copied back. A device without float64
    leaves ``x`` where it is.

    First derivatives go by autograd, ``torch.func.grad``, ``jacrev``, ``vmap`` and ``torch.compile(fullgraph=True)``, and by forward mode outside
    ``torch.compile``: ``torch.func.jvp``, ``jacfwd`` and ``torch.autograd.forward_ad``. Forward mode costs one trace of the rays a direction, so it
    suits few coordinates and many outputs. Second derivatives raise `NotImplementedError`.

    Args:
        lens: The lens to begin with.
        space: What may move, by ``lens.variables(..)``. Left out, it is ``lens.variables()``.

    Raises:
        InputError: The space is one of a lens with other surfaces.
    """

    x: nn.Parameter

    def __init__(self, lens: PlainLens, space: DesignSpace | None = None) -> None:
        super().__init__()
        if not isinstance(lens, PlainLens):
            raise _wrong("lens", lens, "give a petzval.Lens")
        if not (space is None or isinstance(space, DesignSpace)):
            raise _wrong("space", space, "give what petzval.Lens.variables returns")
        self.space = lens.variables() if space is None else space
        self._key = _ops.key_of(self.space)
        self._title = lens.name
        self._fields_deg = tuple(lens.fields_deg.tolist())
        self._wavelengths_um = tuple(lens.wavelengths_um.tolist())
        self._is_symmetric = _petzval.is_rotationally_symmetric(lens._core)
        self._cut: Cut | None = None
        self.x = nn.Parameter(torch.from_numpy(self.space.coordinates_of(lens)))

    def psf(
        self,
        *,
        fields_deg: Sequence[float] | None = None,
        wavelengths_um: Sequence[float] | None = None,
        grid: int = 64,
        pitch_um: float = 1.0,
        kind: Kind = "geometric",
        pupil_cells: int = 64,
    ) -> Psfs:
        """The PSFs of the lens as it stands, by exact tracing.

        Args:
            fields_deg: Field angles, degrees; those of the lens if left out.
            wavelengths_um: Wavelengths, um, 0.2 to 20; those of the lens if left out.
            grid: Cells a side, 16 to 1024.
            pitch_um: Size of a cell, um, 1e-6 to 1000. A ray shares its light among 3 x 3 cells (quadratic B-spline), so that its position has a
                derivative; by this a PSF is half a cell RMS wider.
            kind: Rays (``"geometric"``) or waves (``"diffraction"``).
            pupil_cells: Cells a side of the pupil. They are not refined, so that the PSFs are a smooth function; 64 is quick, 256 accurate.

        Raises:
            InputError: An argument is out of its range, ``x`` is not finite, or no light of a field arrives.
        """
        fields = self._fields_deg if fields_deg is None else _numbers("fields_deg", fields_deg)
        colours = self._wavelengths_um if wavelengths_um is None else _numbers("wavelengths_um", wavelengths_um)
        if not isinstance(kind, str):
            raise _wrong("kind", kind, "\"geometric\" or \"diffraction\"")
        for name, cells in (("grid", grid), ("pupil_cells", pupil_cells)):
            if isinstance(cells, bool) or not isinstance(cells, (int, np.integer)):
                raise _wrong(name, cells, "a whole number")
        if isinstance(pitch_um, bool) or not isinstance(pitch_um, (int, float, np.integer, np.floating)):
            raise _wrong("pitch_um", pitch_um, "a number, um")
        plan = (self._key, list(fields), list(colours), int(grid), float(pitch_um), kind, int(pupil_cells))
        if self._cut is None:
            numbers = _ops.lens_numbers(self._x_on_cpu(), self._key)
        else:
            numbers = self._cut.numbers
            self._cut.plans.append(plan)
        values, light, chief_mm, captured = (tensor.to(self.x.device) for tensor in _ops.psf(numbers, plan))
        return Psfs(values, light, chief_mm, captured, fields, colours, float(pitch_um), kind, self._is_symmetric)

    def forward(self, **options: Any) -> Psfs:
        """`psf`, so that ``torch.func.functional_call`` and hooks of modules apply."""
        return self.psf(**options)

    def penalty(self) -> Tensor:
        """The sum of the squares of all violations of the limits of the space, mm^2: 0 where all are kept. A scalar, float64."""
        return _ops.lens_penalty(self._x_on_cpu(), self._key).to(self.x.device)

    def lens(self) -> PlainLens:
        """The lens as it stands, for `Lens.save`, `Lens.spots` and all else."""
        return self.space.lens_at(self.x.detach().cpu().numpy())

    def extra_repr(self) -> str:
        return f"{self._title!r}, {len(self.space)} coordinates"

    def get_extra_state(self) -> dict[str, Any]:
        """Name and bounds of each coordinate: a state is loaded only by a lens with the same ones."""
        rows = [[c.name, c.min, c.max] for c in self.space.coordinates]
        return {"coordinates": rows}

    def set_extra_state(self, state: dict[str, Any]) -> None:
        if not isinstance(state, dict) or not alike(state.get("coordinates"), self.get_extra_state()["coordinates"]):
            raise InputError(
                f"state: its coordinates are not those of {self._title!r}",
                place=Place(key="state"),
                hint="make the petzval.torch.Lens with the design space with which the state was saved",
            )

    def _load_from_state_dict(self, state_dict: dict[str, Any], prefix: str, *rest: Any) -> None:
        # Before x is overwritten.
        if prefix + "_extra_state" in state_dict:
            self.set_extra_state(state_dict[prefix + "_extra_state"])
        # With ``assign=True`` the tensor itself becomes the parameter.
        if isinstance(state_dict.get(prefix + "x"), Tensor):
            state_dict[prefix + "x"] = state_dict[prefix + "x"].to(torch.float64)
        super()._load_from_state_dict(state_dict, prefix, *rest)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Lens:
        super()._apply(keeping_types(fn), recurse)
        return self

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        # Another process counts its spaces anew.
        self._key = _ops.key_of(self.space)

    def _x_on_cpu(self) -> Tensor:
        return self.x.to("cpu", torch.float64)

    @contextmanager
    def _lifted(self) -> Iterator[Cut]:
        """Within it the graph of PSFs ends at the numbers of the lens, which collect derivatives."""
        with torch.no_grad():
            numbers = _ops.lens_numbers(self._x_on_cpu(), self._key)
        self._cut = Cut(numbers.requires_grad_())
        try:
            yield self._cut
        finally:
            self._cut = None


def _wrong(name: str, value: object, hint: str) -> InputError:
    return InputError(f"{name} = {value!r}: of the wrong type", place=Place(key=name, value=repr(value)), hint=hint)


def _numbers(name: str, values: Any) -> tuple[float, ...]:
    """Numbers of a list, a tuple, an array or a tensor. ``torch.compile`` follows lists and tuples."""
    if isinstance(values, (str, bytes)):
        raise _wrong(name, values, "a list of numbers")
    try:
        return (float(values),) if isinstance(values, (int, float)) else tuple([float(value) for value in values])
    except (TypeError, ValueError) as error:
        raise _wrong(name, values, "a list of numbers") from error
