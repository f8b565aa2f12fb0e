"""Point-spread functions over field and colour as a labelled array, and as a file that `petzval simulate --psfs` takes. Needs xarray."""

# %% Exact PSFs at 13 fields.
import numpy as np

import petzval as pz

lens = pz.Lens.load("cooke-triplet-nominal")
bank = pz.psf(lens, fields_deg=np.linspace(0, 15, 13), wavelengths_um=[0.62, 0.55, 0.486], grid=128, pitch_um=1.0)
bank  # a notebook shows the PSFs

# %% By name instead of by index.
labelled = bank.to_xarray()
peak = labelled.sel(wavelength_um=0.55, method="nearest").max(["y_um", "x_um"])
print("peak of the green PSF by field:", peak.values.round(5))

# %% The file, and back.
bank.save("psfs")
again = pz.PsfBank.load("psfs")
print("the same values:", np.array_equal(again.values, bank.values))
