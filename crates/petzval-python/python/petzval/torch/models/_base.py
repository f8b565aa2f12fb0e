"""Layers that several networks share, and the way of weights into modules and back."""

from __future__ import annotations

import math
from typing import ClassVar, Self

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..._errors import InputError, Place
from ...weights import Kind, Weights

# Slope of the rectifiers for negative values.
SLOPE = 0.2


class PetzvalModule(nn.Module):
    """A network of Petzval as a torch module. Its parameters have the names of `petzval.Weights.tensors`."""

    kind: ClassVar[Kind]

    @classmethod
    def from_weights(cls, weights: Weights) -> Self:
        """A module with these weights, on the CPU, in evaluation mode.

        Raises:
            InputError: The weights are those of another kind of network.
        """
        if weights.kind != cls.kind:
            hint = "petzval.torch.models.from_weights makes the module of any kind"
            place = Place(key="weights", value=weights.kind)
            raise InputError(f"weights are those of a network {weights.kind!r}; {cls.__name__} takes {cls.kind!r}", place=place, hint=hint)
        module = cls(**weights.settings)
        load(module, weights)
        return module

    def to_weights(self) -> Weights:
        """The weights as Petzval takes them.

        Raises:
            InputError: A weight is not finite.
        """
        return as_weights(self, self.kind)


def load(module: nn.Module, weights: Weights) -> None:
    """Puts weights into a module, which must have exactly these."""
    module.load_state_dict({name: torch.tensor(tensor) for name, tensor in weights.tensors.items()})
    module.eval()


def as_weights(module: nn.Module, kind: Kind) -> Weights:
    """The weights of a module whose parameters have the names of Petzval."""
    state = {name: tensor.detach().float().cpu().numpy() for name, tensor in module.state_dict().items() if not name.endswith("num_batches_tracked")}
    return Weights(state, kind=kind)


def normal(*shape: int, deviation: float) -> nn.Parameter:
    """Normal weights of this standard deviation, from torch's generator."""
    return nn.Parameter(deviation * torch.randn(shape))


def zeros(*shape: int) -> nn.Parameter:
    """Weights that start at 0."""
    return nn.Parameter(torch.zeros(shape))


class Conv(nn.Conv2d):
    """A 3x3 convolution with zeros outside the picture. Weights keep the variance; the bias starts at 0."""

    def __init__(self, inputs: int, outputs: int, *, stride: int = 1, gain: float = 1.0) -> None:
        super().__init__(inputs, outputs, 3, stride=stride, padding=1)
        nn.init.normal_(self.weight, std=math.sqrt(gain / (9 * inputs)))
        if self.bias is not None:
            nn.init.zeros_(self.bias)


class LeakyConv(Conv):
    """A 3x3 convolution behind which negative values are multiplied by 0.2."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, gain=2.0 / (1.0 + SLOPE**2))

    def forward(self, input: Tensor) -> Tensor:
        return F.leaky_relu(super().forward(input), SLOPE)


class Mix(nn.Linear):
    """A 1x1 convolution: ``weight`` ``[output, input]`` mixes the channels of every pixel."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs)
        nn.init.normal_(self.weight, std=1.0 / math.sqrt(inputs))
        nn.init.zeros_(self.bias)

    def forward(self, input: Tensor) -> Tensor:
        return pointwise(input, self.weight, self.bias)


def pointwise(x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """``weight x + bias`` at every pixel."""
    return F.conv2d(x, weight[:, :, None, None], bias)


def depthwise(x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Every channel convolved with a kernel of its own, ``weight`` ``[channel, row, column]``; zeros outside the picture."""
    return F.conv2d(x, weight[:, None], bias, padding=weight.shape[-1] // 2, groups=weight.shape[0])


def normalized(x: Tensor) -> Tensor:
    """``(x - mean) / sqrt(variance + 1e-6)``, over the channels of every pixel."""
    centred = x - x.mean(1, keepdim=True)
    return centred / (centred.square().mean(1, keepdim=True) + 1e-6).sqrt()


def gated(x: Tensor) -> Tensor:
    """The product of the two halves of the channels."""
    first, second = x.chunk(2, 1)
    return first * second


def double(x: Tensor) -> Tensor:
    """Repeats every pixel twice in both directions."""
    return F.interpolate(x, scale_factor=2.0, mode="nearest")


def extend(x: Tensor, unit: int) -> Tensor:
    """Extends pictures at the right and bottom to multiples of ``unit``, by repeating the border."""
    down, right = -x.shape[2] % unit, -x.shape[3] % unit
    return x if down == 0 and right == 0 else F.pad(x, (0, right, 0, down), mode="replicate")


def crop(x: Tensor, like: Tensor) -> Tensor:
    """The top left of pictures, as large as ``like``."""
    return x[:, :, : like.shape[2], : like.shape[3]]
