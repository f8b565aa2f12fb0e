"""Exposure of a sensor in plain PyTorch, with the modes of noise of Petzval and their gradients."""

from __future__ import annotations

from typing import get_args

import torch
from torch import Tensor

from .._arguments import count
from ..sensors import NoiseMode, Sensor
from ._patches import checked, wrong

__all__ = ["expose"]

RATE_FLOOR_E = 0.05
"""Smallest rate, electrons, by which derivatives divide: lower ones would be noisy."""


def expose(
    electrons: Tensor,
    sensor: Sensor,
    *,
    seed: int | torch.Generator,
    mode: NoiseMode = "gaussian",
    time_s: float = 0.0,
    linear_gain: float = 1.0,
    row: int = 0,
    column: int = 0,
) -> Tensor:
    """Raw frames of a sensor, differentiable by the electrons.

    The model is that of `Sensor`, with the fixed pattern of its specimen. Noise comes from a `torch.Generator`: its mean and variance are Petzval's
    on every device, its draws are those of the device. A published score takes the noise of `Sensor.expose`.

    Negative electrons count as none, without a gradient; those that are not finite make their pixel NaN.

    Args:
        electrons: Mean photoelectrons, ``[batch, 1, y, x]``: of each pixel behind its own filter; or ``[batch, 3, y, x]``: what red, green and blue
            light give a green pixel, which the filter array then samples. Float32 or float64.
        sensor: The sensor.
        seed: Seed of the noise, or a generator of the tensor's device, which goes on.
        mode: How shot noise is drawn, and its derivative by the mean number of electrons ``lambda``:

            - ``exact``: ``N`` from Poisson; derivative 0.
            - ``dequantised``: ``N + t - 1/2``, t uniform; ``t + (1 - t) (N + r - lambda) / r`` with ``r = max(lambda, 0.05)``.
            - ``half_step``: ``N + 1/2``; 1.
            - ``straight_through``: ``N``; 1.
            - ``gaussian``: ``lambda + sqrt(lambda) z``, z normal; ``1 + z / (2 sqrt(r))``.
            - ``off``: ``lambda``; 1. No noise and no rounding at all.
        time_s: Exposure time, s, which sets the electrons of the dark current.
        linear_gain: Linear gain above the system gain; one of `Sensor.gain_steps`, if there are any.
        row: Sensor row of the first pixel. It sets the phase of the filter array and the fixed pattern.
        column: Sensor column of the first pixel.

    Returns:
        Digital numbers ``[batch, 1, y, x]``, whole unless the mode is ``off``. Rounding passes gradients unchanged; a full well and a converter
        at its limits block them.

    Raises:
        InputError: An argument is out of its range, or the frame leaves the sensor.
    """
    electrons = checked("electrons", electrons)
    if not isinstance(sensor, Sensor):
        raise wrong("sensor", repr(sensor), f"is of the type {type(sensor).__name__}", "petzval.Sensor.load(NAME) gives one")
    row, column = count("row", row), count("column", column)
    if electrons.shape[1] not in (1, 3):
        raise wrong("electrons", f"of shape {tuple(electrons.shape)}", "has the wrong shape", "give [batch, 1 or 3, y, x]")
    if mode not in get_args(NoiseMode):
        raise wrong("mode", repr(mode), "there is no such mode of noise", ", ".join(get_args(NoiseMode)))
    height, width = int(electrons.shape[-2]), int(electrons.shape[-1])
    # The sensor itself refuses settings, and a last pixel that it does not have.
    sensor.mean_dn([[0.0]], time_s=time_s, linear_gain=linear_gain, row=row + height - 1, column=column + width - 1)
    draw = _Draw(seed, electrons)

    # Each filter passes its share of the light.
    light = electrons if electrons.shape[1] == 1 else (electrons * _response(sensor, electrons, row, column)).sum(1, keepdim=True)
    is_known = torch.isfinite(light)
    known = torch.where(is_known, light, torch.zeros_like(light)).clamp(min=0.0)
    # Light frees charge with each pixel's own response, and dark current adds to it.
    offset_e, response, dark_e_per_s = _pattern(sensor, electrons, row, column)
    rate = known * response + (sensor.dark_current_e_per_s + dark_e_per_s) * time_s
    collected = _count_electrons(rate, mode, draw)

    # Clip the charge at the full well, add offsets and the noise of reading, and amplify.
    charge = torch.where(collected < sensor.full_well_e, collected, torch.full_like(collected, sensor.full_well_e))
    charge = charge + sensor.read_noise_mean_e + offset_e
    electronics: Tensor | float = sensor.electronics_mean_dn
    if mode != "off":
        shared = sensor.nonuniformity
        charge = charge + sensor.read_noise_e * draw.normal(charge.shape)
        electronics = electronics + sensor.electronics_noise_dn * draw.normal(charge.shape)
        for noise_e, shape in (
            (shared.get("row_noise_e", 0.0), (*charge.shape[:-1], 1)),
            (shared.get("column_noise_e", 0.0), (*charge.shape[:-2], 1, charge.shape[-1])),
        ):
            charge = charge + noise_e * draw.normal(shape) if noise_e else charge
    signal = sensor.gain_dn_per_e * linear_gain * charge + sensor.black_level_dn

    # Convert to whole numbers within the range; electronics noise behind the converter is rounded a second time.
    def convert(value: Tensor) -> Tensor:
        value = value.clamp(0.0, 2.0**sensor.bits - 1.0)
        return value if mode == "off" else _with_derivative(value.detach().round(), value, 1.0)

    if sensor.electronics == "after_adc":
        dn = convert(convert(signal) + electronics)
    else:
        dn = convert(signal + electronics)
    return torch.where(is_known, dn, torch.full_like(dn, torch.nan))


class _Draw:
    """Random numbers of the device and type of a tensor."""

    def __init__(self, seed: int | torch.Generator, like: Tensor) -> None:
        if not isinstance(seed, torch.Generator):
            seed = torch.Generator(like.device).manual_seed(count("seed", seed))
        elif seed.device.type != like.device.type:
            raise wrong("seed", f"a generator of {seed.device}", "is on another device", f"make it with torch.Generator({str(like.device)!r})")
        self._generator, self._like = seed, like

    def normal(self, shape: tuple[int, ...]) -> Tensor:
        return torch.randn(shape, generator=self._generator, device=self._like.device, dtype=self._like.dtype)

    def uniform(self, shape: tuple[int, ...]) -> Tensor:
        return torch.rand(shape, generator=self._generator, device=self._like.device, dtype=self._like.dtype)

    def counts(self, rate: Tensor) -> Tensor:
        return torch.poisson(rate.detach(), generator=self._generator)


def _count_electrons(rate: Tensor, mode: NoiseMode, draw: _Draw) -> Tensor:
    """Electrons from their rate, with the derivative of the mode."""
    if mode == "off":
        return rate
    mean = rate.detach()
    floor = mean.clamp(min=RATE_FLOOR_E)
    if mode == "gaussian":
        z = draw.normal(mean.shape)
        return _with_derivative(mean + mean.sqrt() * z, rate, 1.0 + z / (2.0 * floor.sqrt()))
    counts = draw.counts(mean)
    if mode == "dequantised":
        t = draw.uniform(mean.shape)
        return _with_derivative(counts + t - 0.5, rate, t + (1.0 - t) * (counts + (floor - mean)) / floor)
    if mode == "half_step":
        return _with_derivative(counts + 0.5, rate, 1.0)
    return _with_derivative(counts, rate, 0.0 if mode == "exact" else 1.0)


def _with_derivative(value: Tensor, by: Tensor, slope: Tensor | float) -> Tensor:
    """A value that has this derivative by a tensor."""
    return value + slope * (by - by.detach())


def _response(sensor: Sensor, electrons: Tensor, row: int, column: int) -> Tensor:
    """Electrons of each pixel per electron of a green one, ``[colour, y, x]``."""
    tile = torch.from_numpy(sensor.response).to(electrons.device, electrons.dtype).permute(2, 0, 1)
    rows = (row + torch.arange(electrons.shape[-2], device=electrons.device)) % tile.shape[1]
    columns = (column + torch.arange(electrons.shape[-1], device=electrons.device)) % tile.shape[2]
    return tile[:, rows[:, None], columns[None, :]]


def _pattern(sensor: Sensor, electrons: Tensor, row: int, column: int) -> tuple[Tensor | float, Tensor | float, Tensor | float]:
    """Offset in electrons, response, and dark current in electrons per second of each pixel, ``[y, x]``."""
    if not any(value for key, value in sensor.nonuniformity.items() if key != "specimen"):
        return 0.0, 1.0, 0.0
    fixed = sensor.fixed_pattern((int(electrons.shape[-2]), int(electrons.shape[-1])), row=row, column=column)
    offset_e, response, dark_e_per_s = (
        torch.from_numpy(of).to(electrons.device, electrons.dtype) for of in (fixed.offset_e, fixed.response, fixed.dark_e_per_s)
    )
    return offset_e, response, dark_e_per_s
