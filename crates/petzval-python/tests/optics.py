"""PSFs and pictures of tests."""

import numpy as np

import petzval as pz


def psfs(fields: int, colours: int, *, grid: int = 12, pitch_um: float = 3.0, corner_mm: float = 0.2, seed: int = 0) -> pz.FieldPsfs:
    """Skew blobs that grow and move with the field, dimmer off the axis."""
    random = np.random.default_rng(seed)
    at = np.arange(grid) - 0.5 * (grid - 1)
    radius = np.linspace(0.0, corner_mm, fields) if fields > 1 else np.zeros(1)
    values = np.empty((fields, colours, grid, grid))
    for f, c in np.ndindex(fields, colours):
        width = 1.2 + 0.3 * c + 1.5 * f / fields
        blob = np.exp(-((at[:, None] - 0.8 * f / fields) ** 2 + (at[None, :] / 1.5) ** 2) / (2 * width**2))
        values[f, c] = blob * random.uniform(0.5, 1.5, (grid, grid))
    values /= values.sum((2, 3), keepdims=True)
    light = 1.0 - (0.5 + 0.05 * np.arange(colours)) * (radius[:, None] / max(corner_mm, 1e-9)) ** 2
    return pz.FieldPsfs(values, radius, pitch_um, light)


def picture(height: int, width: int, colours: int, seed: int = 1) -> np.ndarray:
    """Light with sharp edges and noise, float32."""
    random = np.random.default_rng(seed)
    light = random.uniform(0.0, 0.3, (height, width, colours))
    light[height // 3 : height // 2, width // 4 :] += 0.7
    return light.astype(np.float32)
