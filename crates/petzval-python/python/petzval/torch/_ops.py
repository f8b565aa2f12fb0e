"""The optics as operators of PyTorch.

The free coordinates ``x`` of a design space settle the numbers of the lens that move, and those the PSFs::

    x --lens_numbers--> numbers --psf--> values, illumination, chief_mm
    x --lens_penalty--> penalty

Each is a `torch.library` operator, so that ``torch.compile`` sees one node, inside an `autograd.Function`, so that ``torch.func`` can transform
it. The tape of the adjoints is no tensor: backward traces the rays again, by an operator of its own, and so does forward mode. An operator takes
a design space as the integer that `key_of` gives.
"""

from __future__ import annotations

import weakref
from functools import lru_cache
from itertools import count
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .. import _petzval
from .._errors import InputError, Place
from .._watch import watch
from ..lens import DesignSpace

_NO_SECOND = (
    "a lens of petzval.torch has no second derivatives: leave out create_graph=True, torch.func.hessian and the like for its coordinates; "
    "petzval.torch.LevenbergMarquardt takes steps by curvature without them"
)

_NO_COMPILED_FORWARD = (
    "torch.compile has no forward derivatives of a lens of petzval.torch: call torch.func.jvp and jacfwd outside of compiled functions, "
    "or take jacrev"
)

_SPACES: weakref.WeakValueDictionary[int, DesignSpace] = weakref.WeakValueDictionary()
_KEYS: weakref.WeakKeyDictionary[DesignSpace, int] = weakref.WeakKeyDictionary()
_NEXT = count(1)

PLAN = "int space, float[] fields_deg, float[] wavelengths_um, int grid, float pitch_um, str kind, int pupil_cells"

Plan = tuple[int, list[float], list[float], int, float, str, int]
"""What PSFs are made by: key of the space, fields, wavelengths, cells a side, size of a cell, kind, cells of the pupil."""


def key_of(space: DesignSpace) -> int:
    """The integer by which operators name a design space. It does not keep the space alive: modules and graphs do."""
    if space not in _KEYS:
        _KEYS[space] = next(_NEXT)
        _SPACES[_KEYS[space]] = space
    return _KEYS[space]


def space_of(key: int) -> DesignSpace:
    """The design space of a key.

    Raises:
        InputError: Nothing holds the space any more.
    """
    space = _SPACES.get(int(key))
    if space is None:
        raise InputError(
            f"space {int(key)}: this design space is gone",
            place=Place(key="space", value=str(int(key))),
            hint="keep the petzval.torch.Lens until backward of a compiled graph has run",
        )
    return space


def plan_of(plan: Plan | tuple[Any, ...]) -> _petzval.PsfPlan:
    """The fields, colours and cells of PSFs, checked."""
    _, fields_deg, wavelengths_um, grid, pitch_um, kind, pupil_cells = plan
    return _plan(tuple(fields_deg), tuple(wavelengths_um), int(grid), float(pitch_um), kind, int(pupil_cells))


@lru_cache(maxsize=64)
def _plan(
    fields_deg: tuple[float, ...], wavelengths_um: tuple[float, ...], grid: int, pitch_um: float, kind: str, pupil_cells: int
) -> _petzval.PsfPlan:
    return _petzval.PsfPlan(list(fields_deg), list(wavelengths_um), grid, pitch_um, kind, pupil_cells)


def _array(tensor: Tensor) -> Any:
    return tensor.detach().numpy()


def _lens_numbers(x: Tensor, space: int) -> tuple[Tensor, Tensor]:
    numbers, slopes = space_of(space)._core.numbers(_array(x))
    return torch.from_numpy(numbers), torch.from_numpy(slopes)


def _lens_penalty(x: Tensor, space: int) -> tuple[Tensor, Tensor]:
    value, slopes = space_of(space)._core.penalty(_array(x))
    return torch.tensor(value, dtype=torch.float64), torch.from_numpy(slopes)


def _psf(numbers: Tensor, *plan: Any) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    with watch() as watching:
        values, light, chief_mm, captured, _, _ = plan_of(plan).at(space_of(plan[0])._core, _array(numbers), watching)
    return torch.from_numpy(values), torch.from_numpy(light), torch.from_numpy(chief_mm), torch.from_numpy(captured)


def _psf_backward(numbers: Tensor, by_values: Tensor, by_illumination: Tensor, by_chief_mm: Tensor, *plan: Any) -> Tensor:
    by = _array(by_values), _array(by_illumination), _array(by_chief_mm)
    # A loss that has run away says so by NaN, as the gradients of all other layers do.
    if not all(np.isfinite(b).all() for b in by):
        return torch.full_like(numbers, torch.nan)
    with watch() as watching:
        gradient = plan_of(plan).pull_back(space_of(plan[0])._core, _array(numbers), *by, watching)
    return torch.from_numpy(gradient)


def _psf_forward(numbers: Tensor, direction: Tensor, *plan: Any) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    along = _array(direction)
    if not np.isfinite(along).all():
        values, light, chief_mm, captured = _fake_psf(numbers, *plan)
        return values.fill_(torch.nan), light.fill_(torch.nan), chief_mm.fill_(torch.nan), captured.fill_(torch.nan)
    with watch() as watching:
        found = plan_of(plan).push_forward(space_of(plan[0])._core, _array(numbers), along, watching)
    values, light, chief_mm, captured = (torch.from_numpy(array) for array in found)
    return values, light, chief_mm, captured


def _fake_lens_numbers(x: Tensor, space: int) -> tuple[Tensor, Tensor]:
    numbers = space_of(space)._core.number_count()
    return x.new_empty((numbers,)), x.new_empty((numbers, x.shape[0]))


def _fake_lens_penalty(x: Tensor, space: int) -> tuple[Tensor, Tensor]:
    return x.new_empty(()), torch.empty_like(x)


def _fake_psf(numbers: Tensor, *plan: Any) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    plan_of(plan)
    _, fields_deg, wavelengths_um, grid, *_ = plan
    fields, colours = len(fields_deg), len(wavelengths_um)
    shapes = (fields, colours, grid, grid), (fields, colours), (fields, 2), (fields, colours)
    values, light, chief_mm, captured = (numbers.new_empty(shape) for shape in shapes)
    return values, light, chief_mm, captured


def _fake_psf_backward(numbers: Tensor, *_: Any) -> Tensor:
    return torch.empty_like(numbers)


def _fake_psf_forward(numbers: Tensor, direction: Tensor, *plan: Any) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    return _fake_psf(numbers, *plan)


class _Operator:
    """An operator: its kernel on the CPU, its shapes, its gradient, and its batches one by one. `batched` counts the tensors among its arguments."""

    def __init__(self, name: str, schema: str, kernel: Any, fake: Any, batched: int) -> None:
        _LIBRARY.define(f"{name}{schema}")
        _LIBRARY.impl(name, kernel, "CPU")
        _LIBRARY.impl(name, self._with_gradient, "Autograd")
        torch.library.register_fake(f"petzval::{name}", fake, lib=_LIBRARY)
        self.call: Any = getattr(torch.ops.petzval, name).default
        self.function: Any = None
        self.with_jvp: Any = None
        self._batched = batched
        torch.library.register_vmap(f"petzval::{name}", self._vmap, lib=_LIBRARY)

    def _with_gradient(self, *arguments: Any) -> Any:
        """The operator called by its own name; within its `autograd.Function` nothing requires a gradient.

        `torch.compile` calls it so within ``torch.func.jvp``, too: below the function transforms, where no `autograd.Function` can be applied and
        the tangent would be lost in silence.
        """
        tensors = arguments[: self._batched]
        if torch._C._is_fwd_grad_enabled() and any(_has_tangent(tensor) for tensor in tensors):
            if torch._C._functorch.peek_interpreter_stack() is not None:
                raise NotImplementedError(_NO_COMPILED_FORWARD)
            return self.with_jvp.apply(*arguments)
        if torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors):
            return self.function.apply(*arguments)
        with torch._C._AutoDispatchBelowAutograd():
            return self.call(*arguments)

    def _vmap(self, info: Any, in_dims: tuple[int | None, ...], *arguments: Any) -> tuple[Any, Any]:
        tensors, rest = arguments[: self._batched], arguments[self._batched :]
        rows = [
            tensor.expand(info.batch_size, *tensor.shape) if dim is None else tensor.movedim(dim, 0)
            for tensor, dim in zip(tensors, in_dims)
        ]
        found = [self.call(*(tensor.contiguous() for tensor in row), *rest) for row in zip(*rows)]
        if isinstance(found[0], Tensor):
            return torch.stack(found), 0
        stacked = tuple(torch.stack(of_output) for of_output in zip(*found))
        return stacked, (0,) * len(stacked)


def _has_tangent(tensor: Tensor) -> bool:
    """Whether a tensor carries a forward derivative. There is one level of them."""
    return torch._VF._unpack_dual(tensor, level=0)[1] is not None


_LIBRARY = torch.library.Library("petzval", "FRAGMENT")
LENS_NUMBERS = _Operator("lens_numbers", "(Tensor x, int space) -> (Tensor, Tensor)", _lens_numbers, _fake_lens_numbers, 1)
LENS_PENALTY = _Operator("lens_penalty", "(Tensor x, int space) -> (Tensor, Tensor)", _lens_penalty, _fake_lens_penalty, 1)
PSF = _Operator("psf", f"(Tensor numbers, {PLAN}) -> (Tensor, Tensor, Tensor, Tensor)", _psf, _fake_psf, 1)
PSF_BACKWARD = _Operator(
    "psf_backward",
    f"(Tensor numbers, Tensor by_values, Tensor by_illumination, Tensor by_chief_mm, {PLAN}) -> Tensor",
    _psf_backward,
    _fake_psf_backward,
    4,
)
PSF_FORWARD = _Operator(
    "psf_forward", f"(Tensor numbers, Tensor direction, {PLAN}) -> (Tensor, Tensor, Tensor, Tensor)", _psf_forward, _fake_psf_forward, 2
)


def _keep(ctx: Any, space: int) -> None:
    """Makes a graph keep its design space. A compiled graph holds the module instead, and cannot hold more."""
    if not torch.compiler.is_compiling():
        ctx.space = space_of(space)


class _Whole:
    """A plan as one argument: function transforms take lists apart, and vmap then miscounts the arguments. `torch.compile` takes plain arguments alone."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan


def _parts(plan: tuple[Any, ...]) -> tuple[Any, ...]:
    """The arguments of an operator, from those of its function."""
    return plan[0].plan if isinstance(plan[0], _Whole) else plan


class _First(torch.autograd.Function):
    """A gradient that has no derivatives of its own: without this, second derivatives would be wrong in silence."""

    generate_vmap_rule = True

    @staticmethod
    def forward(gradient: Tensor, x: Tensor) -> Tensor:
        return gradient.clone()

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, by: Tensor) -> Any:
        raise NotImplementedError(_NO_SECOND)


class _FirstForward(_First):
    @staticmethod
    def jvp(ctx: Any, *by: Any) -> Any:
        raise NotImplementedError(_NO_SECOND)


class _LensNumbers(torch.autograd.Function):
    generate_vmap_rule = True

    @staticmethod
    def forward(x: Tensor, space: int) -> Any:
        return LENS_NUMBERS.call(x, space)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        _keep(ctx, inputs[1])
        # The same ones for both: of two, vmap remembers the later.
        ctx.save_for_backward(inputs[0], output[1])
        ctx.save_for_forward(inputs[0], output[1])

    @staticmethod
    def backward(ctx: Any, by_numbers: Tensor, by_slopes: Tensor) -> Any:
        x, slopes = ctx.saved_tensors
        return _applied(_First, _FirstForward, by_numbers @ slopes, x), None


class _LensNumbersForward(_LensNumbers):
    @staticmethod
    def jvp(ctx: Any, x_dot: Tensor, space: None) -> Any:
        _, slopes = ctx.saved_tensors
        return slopes @ x_dot, torch.zeros_like(slopes)


class _LensPenalty(torch.autograd.Function):
    generate_vmap_rule = True

    @staticmethod
    def forward(x: Tensor, space: int) -> Any:
        return LENS_PENALTY.call(x, space)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        _keep(ctx, inputs[1])
        # The same ones for both: of two, vmap remembers the later.
        ctx.save_for_backward(inputs[0], output[1])
        ctx.save_for_forward(inputs[0], output[1])

    @staticmethod
    def backward(ctx: Any, by_value: Tensor, by_slopes: Tensor) -> Any:
        x, slopes = ctx.saved_tensors
        return _applied(_First, _FirstForward, by_value * slopes, x), None


class _LensPenaltyForward(_LensPenalty):
    @staticmethod
    def jvp(ctx: Any, x_dot: Tensor, space: None) -> Any:
        _, slopes = ctx.saved_tensors
        return (slopes * x_dot).sum(), torch.zeros_like(slopes)


class _PsfBackward(torch.autograd.Function):
    generate_vmap_rule = True

    @staticmethod
    def forward(numbers: Tensor, by_values: Tensor, by_illumination: Tensor, by_chief_mm: Tensor, *plan: Any) -> Any:
        return PSF_BACKWARD.call(numbers, by_values, by_illumination, by_chief_mm, *_parts(plan))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, by: Tensor) -> Any:
        raise NotImplementedError(_NO_SECOND)


class _PsfBackwardForward(_PsfBackward):
    @staticmethod
    def jvp(ctx: Any, *by: Any) -> Any:
        raise NotImplementedError(_NO_SECOND)


class _PsfAlong(torch.autograd.Function):
    """Derivatives of PSFs along a direction of the numbers of the lens."""

    generate_vmap_rule = True

    @staticmethod
    def forward(numbers: Tensor, direction: Tensor, *plan: Any) -> Any:
        return PSF_FORWARD.call(numbers, direction, *_parts(plan))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, *by: Tensor) -> Any:
        raise NotImplementedError(_NO_SECOND)

    @staticmethod
    def jvp(ctx: Any, *by: Any) -> Any:
        raise NotImplementedError(_NO_SECOND)


class _Psf(torch.autograd.Function):
    generate_vmap_rule = True

    @staticmethod
    def forward(numbers: Tensor, *plan: Any) -> Any:
        return PSF.call(numbers, *_parts(plan))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        _keep(ctx, _parts(inputs[1:])[0])
        ctx.save_for_backward(inputs[0])
        ctx.save_for_forward(inputs[0])
        ctx.plan = inputs[1:]

    @staticmethod
    def backward(ctx: Any, by_values: Tensor, by_illumination: Tensor, by_chief_mm: Tensor, by_captured: Tensor) -> Any:
        (numbers,) = ctx.saved_tensors
        by = _applied(_PsfBackward, _PsfBackwardForward, numbers, by_values, by_illumination, by_chief_mm, *ctx.plan)
        return by, *(None,) * len(ctx.plan)


class _PsfForward(_Psf):
    @staticmethod
    def jvp(ctx: Any, numbers_dot: Tensor, *plan: None) -> Any:
        (numbers,) = ctx.saved_tensors
        return _PsfAlong.apply(numbers, numbers_dot, *ctx.plan)


LENS_NUMBERS.function, LENS_PENALTY.function = _LensNumbers, _LensPenalty
PSF.function, PSF_BACKWARD.function, PSF_FORWARD.function = _Psf, _PsfBackward, _PsfAlong
LENS_NUMBERS.with_jvp, LENS_PENALTY.with_jvp = _LensNumbersForward, _LensPenaltyForward
PSF.with_jvp, PSF_BACKWARD.with_jvp, PSF_FORWARD.with_jvp = _PsfForward, _PsfBackwardForward, _PsfAlong


def _applied(function: Any, with_jvp: Any, *arguments: Any) -> Any:
    """torch.compile follows only functions that have no `jvp`."""
    return (function if torch.compiler.is_compiling() else with_jvp).apply(*arguments)


def lens_numbers(x: Tensor, space: int) -> Tensor:
    """The numbers of the lens that move, ``[number]``: curvatures in 1/mm, lengths in mm, tilts in rad. `x` is float64 on the CPU."""
    numbers, _ = _applied(_LensNumbers, _LensNumbersForward, x, space)
    return numbers


def lens_penalty(x: Tensor, space: int) -> Tensor:
    """The sum of the squares of all violations of limits, mm^2."""
    value, _ = _applied(_LensPenalty, _LensPenaltyForward, x, space)
    return value


def psf(numbers: Tensor, plan: Plan) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Values ``[field, wavelength, y, x]``, illumination ``[field, wavelength]``, chief rays ``[field, 2]``, mm, and the captured share of the light
    ``[field, wavelength]``, which has no gradient."""
    whole = plan if torch.compiler.is_compiling() else (_Whole(plan),)
    values, light, chief_mm, captured = _applied(_Psf, _PsfForward, numbers, *whole)
    return values, light, chief_mm, captured.detach()
