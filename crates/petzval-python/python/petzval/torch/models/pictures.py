"""Networks that restore and finish pictures, and that read the class of every pixel.

Pictures are ``[batch, channel, y, x]``, sRGB-encoded, about 0 to 1, of any height and width.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...weights import Kind
from ._base import Conv, LeakyConv, Mix, PetzvalModule, crop, depthwise, double, extend, gated, normal, normalized, pointwise, zeros

# Knots of the curves of regularisation of each colour, and by how much the curves bend for a change of their parameter.
_KNOTS = 6
_CURVE_SCALE = 4.0

# The noise of 400 electrons of white becomes 1.
_NOISE_SCALE = 40.0

# The middle of the values of a picture.
_MIDDLE = 0.5


class ConvPair(nn.Module):
    """Two convolutions at one resolution."""

    def __init__(self, inputs: int, middle: int, outputs: int) -> None:
        super().__init__()
        self.first = LeakyConv(inputs, middle)
        self.second = LeakyConv(middle, outputs)


class Trunk(nn.Module):
    """Pairs of 3x3 convolutions at ``levels + 1`` resolutions, joined by skip connections: ``inputs`` to ``base`` channels.

    Source: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015. Pictures are halved by 2x2 max-pooling and doubled by repeated pixels.
    """

    def __init__(self, inputs: int, base: int, levels: int) -> None:
        super().__init__()
        widths = [base << level for level in range(levels + 1)]
        self.encoder = nn.ModuleList(
            ConvPair(inputs if level == 0 else widths[level - 1], widths[level], widths[level]) for level in range(levels)
        )
        self.bottom = ConvPair(widths[levels - 1], widths[levels], widths[levels - 1])
        self.decoder = nn.ModuleList(
            ConvPair(2 * widths[level], widths[level], widths[max(level - 1, 0)]) for level in reversed(range(levels))
        )

    @property
    def unit(self) -> int:
        """Pixels that one pixel of the lowest resolution covers in each direction."""
        return 1 << len(self.encoder)

    @staticmethod
    def widths(base: int, levels: int) -> list[int]:
        """Channels behind the first convolution of every pair, in the order in which ``modulate`` sees them."""
        return [base << level for level in (*range(levels + 1), *reversed(range(levels)))]

    def forward(self, x: Tensor, modulate: Callable[[int, Tensor], Tensor] | None = None) -> Tensor:
        """Sides are multiples of `unit`. ``modulate(pair, x)`` acts behind the first convolution of every pair."""
        number = 0

        def run(pair: nn.Module, x: Tensor) -> Tensor:
            nonlocal number
            assert isinstance(pair, ConvPair)
            middle: Tensor = pair.first(x)
            if modulate is not None:
                middle = modulate(number, middle)
            number += 1
            return pair.second(middle)

        # Halve the picture level by level, and keep each resolution for the skip connections.
        skips = []
        for pair in self.encoder:
            kept = run(pair, x)
            x = F.max_pool2d(kept, 2)
            skips.append(kept)
        x = run(self.bottom, x)

        # Double the picture level by level, and join it with the kept resolution.
        for pair, kept in zip(self.decoder, reversed(skips), strict=True):
            x = run(pair, torch.cat([double(x), kept], 1))
        return x


class _UNetBody(nn.Module):
    """A trunk behind which a matrix mixes the channels of every pixel."""

    def __init__(self, inputs: int, outputs: int, base_channels: int, levels: int) -> None:
        super().__init__()
        self.trunk = Trunk(inputs, base_channels, levels)
        self.last_weight = zeros(outputs, base_channels)
        self.last_bias = zeros(outputs)

    @property
    def unit(self) -> int:
        """See `Trunk.unit`."""
        return self.trunk.unit

    def found(self, x: Tensor) -> Tensor:
        """What the last layer gives, of the size of ``x``."""
        features = self.trunk(extend(x, self.trunk.unit))
        return crop(pointwise(features, self.last_weight, self.last_bias), x)


class UNet(_UNetBody, PetzvalModule):
    """``output = input + U(input)``, U a U-Net of 3x3 convolutions and leaky rectifiers.

    Args:
        base_channels: Channels at full resolution; they double with each level.
        levels: How often the picture is halved.
        in_channels: Channels of the input.
        out_channels: Channels of the output, which is added to as many of the input.
    """

    kind: ClassVar[Kind] = "u-net"

    def __init__(self, base_channels: int, levels: int, in_channels: int, out_channels: int) -> None:
        super().__init__(in_channels, out_channels, base_channels, levels)
        self.in_channels = in_channels

    def forward(self, pictures: Tensor) -> Tensor:
        """``[batch, in_channels, y, x]`` to ``[batch, out_channels, y, x]``, not clamped."""
        found = self.found(pictures)
        return pictures[:, : found.shape[1]] + found


class Segmenter(_UNetBody, PetzvalModule):
    """Logits of the class of every pixel: ``W U(picture - 0.5) + b``.

    Args:
        classes: Number of classes.
        base_channels: Channels at full resolution; they double with each level.
        levels: How often the picture is halved.
    """

    kind: ClassVar[Kind] = "segmenter"

    def __init__(self, classes: int, base_channels: int, levels: int) -> None:
        super().__init__(3, classes, base_channels, levels)

    def forward(self, pictures: Tensor) -> Tensor:
        """``[batch, 3, y, x]`` to logits ``[batch, classes, y, x]``."""
        return self.found(pictures - _MIDDLE)


class Block(nn.Module):
    """Two residual halves without activation functions: ``y = x + s1 B(gate(D(A(norm(x)))))``, then ``y + s2 F(gate(E(norm(y))))``."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.widen = Mix(channels, 2 * channels)
        self.spatial_weight = normal(2 * channels, 3, 3, deviation=1 / 3)
        self.spatial_bias = zeros(2 * channels)
        self.join = Mix(channels, channels)
        self.join_scale = zeros(channels)
        self.expand = Mix(channels, 2 * channels)
        self.reduce = Mix(channels, channels)
        self.reduce_scale = zeros(channels)

    def forward(self, x: Tensor) -> Tensor:
        # Mix neighbouring pixels.
        wide = depthwise(self.widen(normalized(x)), self.spatial_weight, self.spatial_bias)
        y = x + self.join_scale[:, None, None] * self.join(gated(wide))

        # Mix the channels of every pixel.
        return y + self.reduce_scale[:, None, None] * self.reduce(gated(self.expand(normalized(y))))


class Down(nn.Module):
    """Blocks, then half the resolution with twice the channels."""

    def __init__(self, channels: int, blocks: int) -> None:
        super().__init__()
        self.blocks = nn.Sequential(*(Block(channels) for _ in range(blocks)))
        self.halve = Conv(channels, 2 * channels, stride=2)


class Up(nn.Module):
    """Half the channels at twice the resolution, then blocks."""

    def __init__(self, channels: int, blocks: int) -> None:
        super().__init__()
        self.narrow = Mix(2 * channels, channels)
        self.blocks = nn.Sequential(*(Block(channels) for _ in range(blocks)))


class Naf(nn.Module):
    """A U-shaped network whose only non-linearity is a product of channels.

    Source: L. Chen, X. Chu, X. Zhang, J. Sun, "Simple Baselines for Image Restoration", ECCV 2022, without its channel attention.

    Args:
        in_channels: Channels of the input.
        out_channels: Channels of the output.
        base_channels: Channels at full resolution; they double with each level.
        levels: How often the picture is halved.
        blocks: Blocks at every resolution on each way.
    """

    def __init__(self, in_channels: int, out_channels: int, base_channels: int, levels: int, blocks: int = 1) -> None:
        super().__init__()
        self.first = Conv(in_channels, base_channels)
        self.encoder = nn.ModuleList(Down(base_channels << level, blocks) for level in range(levels))
        self.bottom = nn.Sequential(*(Block(base_channels << levels) for _ in range(blocks)))
        self.decoder = nn.ModuleList(Up(base_channels << level, blocks) for level in reversed(range(levels)))
        self.last = Conv(base_channels, out_channels, gain=0.0)

    @property
    def unit(self) -> int:
        """Pixels that one pixel of the lowest resolution covers in each direction."""
        return 1 << len(self.encoder)

    def found(self, x: Tensor) -> Tensor:
        """``[batch, in_channels, y, x]`` to ``[batch, out_channels, y, x]``."""
        like = x
        x = self.first(extend(x, self.unit))

        # Halve the picture level by level, and keep each resolution for the way up.
        skips = []
        for down in self.encoder:
            assert isinstance(down, Down)
            skips.append(down.blocks(x))
            x = down.halve(skips[-1])
        x = self.bottom(x)

        # Double the picture level by level, and add the kept resolution.
        for up, kept in zip(self.decoder, reversed(skips), strict=True):
            assert isinstance(up, Up)
            x = up.blocks(double(up.narrow(x)) + kept)
        return crop(self.last(x), like)

    def forward(self, pictures: Tensor) -> Tensor:
        """See `found`."""
        return self.found(pictures)


class Restoration(PetzvalModule):
    """Mixes the restored with the developed picture and adds what it finds missing.

    ``output = restored + share (developed - restored) + missing``, with ``(missing, share) = N(restored, developed, field, noise)``, N a U-Net.

    Args:
        base_channels: Channels at full resolution; they double with each level.
        levels: How often the picture is halved.
    """

    kind: ClassVar[Kind] = "restoration"

    def __init__(self, base_channels: int, levels: int) -> None:
        super().__init__()
        self.curves = zeros(3, _KNOTS)
        self.correction = self._network(base_channels, levels)

    @staticmethod
    def _network(base_channels: int, levels: int) -> _UNetBody | Naf:
        return _UNetBody(8, 6, base_channels, levels)

    @property
    def unit(self) -> int:
        """Pixels that one pixel of the lowest resolution covers in each direction."""
        return self.correction.unit

    @property
    def restoration_curves(self) -> Tensor:
        """The curves of regularisation of the restoration in front of the network, ``[colour, knot]``; they are trained with it."""
        return _CURVE_SCALE * self.curves

    def forward(self, restored: Tensor, developed: Tensor, field: Tensor, noise: Tensor) -> Tensor:
        """The finished pictures, ``[batch, 3, y, x]``.

        Args:
            restored: Pictures without the blur of the lens, ``[batch, 3, y, x]``.
            developed: Pictures with it, of the same shape.
            field: Distance from the optical axis, 0 on it and 1 in the corner of the sensor, ``[batch, 1, y, x]``.
            noise: Standard deviation of the noise in the square root of light, in roots of white, ``[batch, 1, y, x]``.
        """
        seen = torch.cat([restored, developed, field, _NOISE_SCALE * noise], 1)
        missing, share = self.correction.found(seen).chunk(2, 1)
        return restored + share * (developed - restored) + missing


class RestorationNaf(Restoration):
    """`Restoration` with a `Naf` in place of the U-Net: the built-in network is one."""

    kind: ClassVar[Kind] = "restoration-naf"

    @staticmethod
    def _network(base_channels: int, levels: int) -> _UNetBody | Naf:
        return Naf(8, 6, base_channels, levels)
