"""Networks in place of an ISP and of ray tracing."""

from __future__ import annotations

import math
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...weights import Kind
from ._base import SLOPE, Conv, LeakyConv, Mix, PetzvalModule, crop, double, extend, normal, zeros
from .pictures import Trunk

# Colours of the mosaic and of the picture, and values that a cell of the mosaic has in the picture.
_MOSAIC, _COLOURS = 4, 3
_OUT = 4 * _COLOURS

# Sides of the thumbnail, straight pieces of the curve of the tones, slope where the ISP clips, and what keeps the slope at black finite.
_THUMBNAIL, _PIECES, _LEAK, _BLACK = 16, 8, 0.02, 1e-4

# Sides of the picture from which PSFs are decoded, and the inverse of softplus at 1.
_SMALL, _UNIT = 32, 0.541325


class IspProxy(PetzvalModule):
    """The picture that an ISP develops from a raw mosaic, as a function of the mosaic and of the parameters of the ISP.

    Formulas: `IspProxy` in `petzval-learn/src/network/isp_proxy.rs`. Sources: E. Perez et al., "FiLM", AAAI 2018; E. Tseng et al.,
    "Hyperparameter optimization in black-box image processing using differentiable proxies", ACM TOG 2019.

    Args:
        parameters: Numbers that it takes besides the mosaic.
        base_channels: Channels at the resolution of one colour of the mosaic; they double with each level.
        levels: How often the picture is halved.
        thumbnail_channels: Channels of the thumbnail.
        hidden: Width of the dense layers behind the parameters.
    """

    kind: ClassVar[Kind] = "isp-proxy"

    def __init__(self, parameters: int, base_channels: int, levels: int, thumbnail_channels: int, hidden: int) -> None:
        super().__init__()
        small = thumbnail_channels
        self._widths = [small, *Trunk.widths(base_channels, levels)]
        self._counts = [_COLOURS**2, _COLOURS, small, _COLOURS**2 * _PIECES, _OUT * (base_channels + _COLOURS)]
        self.hidden_weight = normal(parameters, hidden, deviation=1 / math.sqrt(parameters))
        self.hidden_bias = normal(hidden, deviation=0.5)
        self.second_weight = normal(hidden, hidden, deviation=1 / math.sqrt(hidden))
        self.second_bias = zeros(hidden)
        self.modulation_weight = zeros(parameters + hidden, 2 * sum(self._widths))
        self.modulation_bias = zeros(2 * sum(self._widths))
        self.thumbnail = nn.ModuleList([LeakyConv(_MOSAIC + _COLOURS, small), LeakyConv(small, small), LeakyConv(small, small)])
        self.trunk = Trunk(_MOSAIC + _COLOURS + small, base_channels, levels)
        self.last_weight = zeros(parameters + hidden, sum(self._counts))
        self.last_bias = zeros(sum(self._counts))

    def forward(self, raw: Tensor, theta: Tensor) -> Tensor:
        """The pictures ``[batch, 3, y, x]``, not clamped.

        Args:
            raw: ``[batch, 4, y / 2, x / 2]``: red, green, green and blue of the mosaic, linear, black 0 and white 1.
            theta: The parameters, each scaled to about -1 to 1, ``[batch, parameters]``.
        """
        # What the dense network makes of the parameters.
        first = F.leaky_relu(theta @ self.hidden_weight + self.hidden_bias, SLOPE)
        second = F.leaky_relu(first @ self.second_weight + self.second_bias, SLOPE)
        hidden = torch.cat([theta, first + second], 1)
        modulations = (hidden @ self.modulation_weight + self.modulation_bias).split([w for width in self._widths for w in (width, width)], 1)
        by_colour, shift, by_far, by_piece, by_feature = (hidden @ self.last_weight + self.last_bias).split(self._counts, 1)

        def modulated(block: int, x: Tensor) -> Tensor:
            scale, offset = modulations[2 * block], modulations[2 * block + 1]
            return x * (scale[:, :, None, None] + 1.0) + offset[:, :, None, None]

        def mixed(light: Tensor) -> Tensor:
            return _encode(light + _mix(by_colour, light, _COLOURS) + shift[:, :, None, None])

        # The light as the ISP sees it, and without the mosaic.
        encoded = _encode(raw)
        light = torch.cat([raw[:, :1], 0.5 * (raw[:, 1:2] + raw[:, 2:3]), raw[:, 3:]], 1)

        # Look at the whole picture through a thumbnail.
        near = F.adaptive_avg_pool2d(torch.cat([encoded, mixed(light)], 1), _THUMBNAIL)
        small = modulated(0, self.thumbnail[0](near))
        for conv in self.thumbnail[1:]:
            small = conv(small)
        far = F.interpolate(small, size=raw.shape[2:], mode="bilinear", align_corners=False)

        # Amplify by what lies around, mix the colours, and bend the tones.
        colours = mixed(light * _mix(by_far, far, 1).exp())
        pieces = torch.cat([(colours - k / _PIECES).clamp(min=0.0) for k in range(_PIECES)], 1)
        colours = colours + _mix(by_piece, pieces, _COLOURS)

        # Add what the network finds for each pixel of a cell of the mosaic.
        x = torch.cat([encoded, colours, far], 1)
        x = crop(self.trunk(extend(x, self.trunk.unit), lambda pair, x: modulated(pair + 1, x)), x)
        found = _mix(by_feature, torch.cat([x, colours], 1), _OUT)
        picture = double(colours) + F.pixel_shuffle(found, 2)
        return picture.clamp(0.0, 1.0) * (1.0 - _LEAK) + picture * _LEAK


def _encode(light: Tensor) -> Tensor:
    """The square root of light, with a finite slope at black."""
    return (light.clamp(min=0.0) + _BLACK).sqrt() - math.sqrt(_BLACK)


def _mix(weights: Tensor, x: Tensor, outputs: int) -> Tensor:
    """At every pixel, ``outputs`` sums of its channels, with weights ``[batch, outputs * channels]`` of each picture."""
    return torch.einsum("boc,bcyx->boyx", weights.reshape(weights.shape[0], outputs, x.shape[1]), x)


class Dense(nn.Module):
    """``x weight + bias``."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = normal(inputs, outputs, deviation=1 / math.sqrt(inputs))
        self.bias = zeros(outputs)

    def forward(self, x: Tensor) -> Tensor:
        return x @ self.weight + self.bias


class Doubling(Mix):
    """Every pixel becomes 2x2 pixels, each by a matrix of its own."""

    def __init__(self, channels: int) -> None:
        super().__init__(channels, 4 * channels)

    def forward(self, input: Tensor) -> Tensor:
        return F.pixel_shuffle(super().forward(input), 2)


class OpticsProxy(PetzvalModule):
    """PSFs of a lens as a function of its numbers and of the field.

    Source: E. Tseng et al., "Differentiable Compound Optics and Processing Pipeline Optimization for End-to-end Camera Design", ACM TOG 2021,
    supplement, section 4.

    Args:
        inputs: Numbers of the lens, and the field.
        hidden: Width of the two hidden layers.
        channels: Channels of the decoder.
    """

    kind: ClassVar[Kind] = "optics-proxy"

    def __init__(self, inputs: int, hidden: int, channels: int) -> None:
        super().__init__()
        self.first = Dense(inputs, hidden)
        self.second = Dense(hidden, hidden)
        self.third = Dense(hidden, _COLOURS * _SMALL**2 + _COLOURS)
        self.coarse = nn.Sequential(LeakyConv(_COLOURS, channels), LeakyConv(channels, channels))
        self.to_middle = Doubling(channels)
        self.middle = nn.Sequential(LeakyConv(channels, channels), LeakyConv(channels, channels))
        self.to_fine = Doubling(channels)
        last = Conv(channels, _COLOURS)
        self.last_weight = last.weight
        self.last_bias = zeros(_COLOURS)

    def forward(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """PSFs ``[batch, 3, 128, 128]``, each of unit sum, and their relative illumination ``[batch, 3]``.

        Args:
            inputs: Numbers and field, each scaled to mean 0 and variance 1, ``[batch, inputs]``.
        """
        hidden = F.leaky_relu(self.first(inputs), SLOPE)
        hidden = F.leaky_relu(self.second(hidden), SLOPE)
        picture, light = self.third(hidden).split([_COLOURS * _SMALL**2, _COLOURS], 1)
        x = self.to_middle(self.coarse(picture.reshape(-1, _COLOURS, _SMALL, _SMALL)))
        x = F.conv2d(self.to_fine(self.middle(x)), self.last_weight, self.last_bias, padding=1)
        values = x.flatten(2).softmax(2).reshape(x.shape)
        return values, F.softplus(light + _UNIT)
