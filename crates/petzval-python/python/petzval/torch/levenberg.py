"""Curvature steps for a lens under any loss of its PSFs."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .. import _petzval
from .._errors import InputError, PetzvalWarning, Place
from .._watch import watch
from . import _ops
from .lens import Lens

__all__ = ["LevenbergMarquardt"]


class LevenbergMarquardt(torch.optim.Optimizer):
    """Steps of a lens by the curvature of any loss > 0 of its PSFs, after Levenberg and Marquardt.

    Of the lens a loss sees where rays land and how much light arrives. Let e be these landing points, g the derivatives of the loss L by e, and J
    those of e by the coordinates. The loss is replaced by the paraboloid over e with the same value and slope whose minimum is zero. Its curvature
    by the coordinates is ``|g|^2 / (4 L) J' J``: it knows which numbers of the lens move the rays alike, where Adam sees each alone, and needs no
    second derivative of the loss (Cote, Tseng and Heide, 2026). One backward pass gives g, exact tracing gives J.

    Gradient and curvature are averaged over steps (decays 0.9 and 0.95), since batches are noisy. A step goes a share `lr` of the way to the minimum,
    damped by 1e-2 of each coordinate's own curvature, and no coordinate moves by more than 0.1. This is the step of ``method = "levenberg"`` in
    ``petzval design``.

    Penalties of limits are added by the optimiser, each violation as a residual of its own: leave `Lens.penalty` out of the loss. What else the
    loss depends on by ``lens.x`` counts in the slope alone.

    Args:
        lens: The lens; its ``x`` is the one parameter. Networks have an optimiser of their own.
        lr: Share of the way, above 0 and at most 1: 0.1 to 0.3 with noisy batches.
        penalty_weight: Weight of the squared violations in the loss, 1/mm^2.

    Raises:
        InputError: An argument is out of its range.
    """

    def __init__(self, lens: Lens, lr: float = 0.3, *, penalty_weight: float = 1.0) -> None:
        if not isinstance(lens, Lens):
            raise _refused("lens", lens, "give a petzval.torch.Lens")
        if not (isinstance(lr, (int, float)) and 0.0 < lr <= 1.0):
            raise _refused("lr", lr, "above 0 and at most 1")
        if not (isinstance(penalty_weight, (int, float)) and 0.0 <= penalty_weight < math.inf):
            raise _refused("penalty_weight", penalty_weight, "at least 0, 1/mm^2")
        super().__init__([lens.x], {"lr": lr, "penalty_weight": penalty_weight})
        self._lens = lens

    @torch.no_grad()
    def step(self, closure: Callable[[], Tensor]) -> Tensor:
        """Takes one step.

        Args:
            closure: Computes the loss of `Lens.psf` from the lens as it stands, calls ``backward`` and returns the loss. It may train a network by
                the same backward pass. Gradients of the lens are cleared before.

        Returns:
            The loss before the step, as the closure returned it. ``lens.x.grad`` then has its derivatives.

        Raises:
            InputError: The loss is not above zero, or does not depend on PSFs of the lens.
        """
        lens = self._lens
        lens.x.grad = None
        with torch.enable_grad(), lens._lifted() as cut:
            loss = closure()
        if not isinstance(loss, Tensor) or loss.numel() != 1:
            shown = f"a tensor of shape {tuple(loss.shape)}" if isinstance(loss, Tensor) else repr(loss)
            raise InputError(f"closure: it returned {shown}", place=Place(key="closure", value=shown), hint="return the loss, a tensor of one number")
        value = float(loss.detach())
        if not (value > 0.0 and math.isfinite(value)):
            raise _refused("loss", value, "the lift takes losses above zero: add what keeps it there")
        if cut.numbers.grad is None:
            raise InputError(
                "closure: the loss has no gradient by PSFs of the lens",
                place=Place(key="closure"),
                hint="use lens.psf() of this lens within it, and call loss.backward()",
            )

        # Bring the derivatives by the numbers of the lens to the coordinates, beside those that came there directly.
        x = lens.x.detach().cpu().numpy()
        by_numbers = cut.numbers.grad.numpy()
        _, slopes = lens.space._core.numbers(x)
        gradient = by_numbers @ slopes
        if lens.x.grad is not None:
            gradient = gradient + lens.x.grad.cpu().numpy()
        lens.x.grad = torch.from_numpy(gradient).to(lens.x.device)
        if not np.isfinite(gradient).all():
            raise _refused("gradient", "not finite", "the loss has no finite derivatives by the PSFs")

        # Lift the loss to the rays, and go a share of the way to the minimum of the averaged paraboloid.
        group = self.param_groups[0]
        weight = group["penalty_weight"]
        plan = _ops.plan_of(_merged(cut.plans))
        with watch() as watching:
            lifted = _petzval.lift(plan, lens.space._core, x, value, by_numbers, weight, watching)
        if lifted is None:
            warnings.warn("most rays of a field are lost, or none moves: the lens stays", PetzvalWarning, stacklevel=2)
            return loss
        curvature, _, by_penalty = lifted
        state = self.state[lens.x]
        count = len(x)
        average_gradient = state.get("gradient", torch.zeros(count, dtype=torch.float64))
        average_curvature = state.get("curvature", torch.zeros((count, count), dtype=torch.float64))
        moved, gradient_now, curvature_now = _petzval.lifted_step(
            x,
            0.5 * (gradient + weight * by_penalty),
            curvature,
            average_gradient.cpu().numpy(),
            average_curvature.cpu().numpy(),
            state.get("steps", 0),
            float(group["lr"]),
        )
        state["gradient"] = torch.from_numpy(gradient_now)
        state["curvature"] = torch.from_numpy(curvature_now)
        state["steps"] = state.get("steps", 0) + 1
        lens.x.copy_(torch.from_numpy(moved))
        return loss


def _merged(plans: list[Any]) -> Any:
    """One plan with the fields and wavelengths of all PSFs that a loss was made of."""
    first = plans[0]
    if all(plan == first for plan in plans):
        return first
    fields, colours = ({value for plan in plans for value in plan[i]} for i in (1, 2))
    return first[0], sorted(fields), sorted(colours), *first[3:]


def _refused(name: str, value: object, hint: str) -> InputError:
    return InputError(f"{name} = {value!r}: out of range", place=Place(key=name, value=repr(value)), hint=hint)
