"""A lens, its spots and its sharpness, and a picture through it. Needs NumPy."""

# %% Read a lens, and look at it.
import numpy as np

import petzval as pz

LENS = "cooke-triplet-nominal"  # or the path of your own: .zmx, .seq, .json, .toml

lens = pz.Lens.load(LENS)
lens.layout_svg("layout.svg")
lens  # a notebook shows the layout

# %% Spots and MTF by exact tracing.
print("RMS spot radius, um, by field:", lens.spots().rms_um.round(2))
print("sagittal MTF at 20 and 40 cycles/mm:", *lens.mtf(per_mm=[20, 40]).sagittal.round(3), sep="\n")

# %% A picture through lens, sensor and development.
scene = np.kron(np.indices((6, 8)).sum(0) % 2, np.ones((40, 40)))[..., None].repeat(3, -1)
camera = pz.Camera(lens, "imx249-fitted", exposure_e=16_000, size=(240, 320), place="centre")
frames = camera.take(scene, seed=1)
print("raw:", frames.raw.shape, frames.raw.dtype, "developed:", frames.developed.shape, frames.developed.dtype)
frames.save("shot", overwrite=True)
frames  # a notebook shows the picture
