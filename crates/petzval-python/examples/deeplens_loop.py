"""A training loop for a lens of DeepLens, with one of Petzval in its place: the loop stays as it is. Needs PyTorch.

``python deeplens_loop.py`` has Petzval's lens, ``python deeplens_loop.py deeplens`` that of DeepLens, where deeplens-core is installed.
"""

# %% A lens of Petzval with the methods of `deeplens.GeoLens` that the loop calls.
import json
import math
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from deeplens_side_by_side import DENSE, GRID, PITCH_UM, WAVELENGTHS_UM, Dense, blurred, for_deeplens, indices_of
from torch import Tensor

import petzval as pz
import petzval.torch as pt


class PetzvalLens:
    """A lens that takes points ``[point, 3]`` as `deeplens.GeoLens` does: x and y from -1 to 1 over the sensor, on its y axis here."""

    obj_depth = -math.inf

    def __init__(self, start: pz.Lens, *, sensor_mm: float, wvln_rgb: tuple[float, ...]) -> None:
        self.foclen, self.sensor_size, self.wvln_rgb = start.efl_mm, (sensor_mm, sensor_mm), wvln_rgb
        self.glass = pt.Lens(start, start.variables())

    def get_optimizer(self, lr: float) -> torch.optim.Optimizer:
        """Adam for all free numbers."""
        return torch.optim.Adam(self.glass.parameters(), lr=lr)

    def psf_rgb(self, points: Tensor, ks: int) -> Tensor:
        """PSFs ``[point, colour, y, x]``; y grows upwards."""
        fields = (points[:, 1] * self.sensor_size[1] / 2 / self.foclen).arctan().rad2deg()
        psfs = self.glass.psf(fields_deg=fields.tolist(), wavelengths_um=self.wvln_rgb, grid=ks, pitch_um=PITCH_UM, pupil_cells=32)
        return psfs.values.flip(-2).float()

    def loss_reg(self) -> tuple[Tensor, dict[str, float]]:
        """What limits of the lens are violated."""
        return self.glass.penalty(), {}


# %% The lens, of one program or of the other.
start, side_mm = pz.Lens.load("cooke-triplet-nominal"), 2048 * PITCH_UM / 1000
if "deeplens" in sys.argv:
    from deeplens import GeoLens

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "lens.json").write_text(json.dumps(for_deeplens()))
        lens: Any = GeoLens(filename=f"{folder}/lens.json", device=torch.device("cpu"), primary_wvln=start.reference_um, wvln_rgb=WAVELENGTHS_UM)
    optimizer = lens.get_optimizer(lrs=[1e-3, 1e-4, 0, 0])
else:
    lens = PetzvalLens(start, sensor_mm=side_mm, wvln_rgb=WAVELENGTHS_UM)
    optimizer = lens.get_optimizer(lr=1e-2)

# %% The loop: light through the lens, a network that restores, one loss for both.
torch.manual_seed(0)
torch.set_num_threads(1)
pz.set_threads(1)
points = torch.tensor([[0.0, y, lens.obj_depth] for y in (0.0, 0.35, 0.7, 1.0)])
network = torch.nn.Sequential(torch.nn.Conv2d(3, 16, 5, padding=2), torch.nn.ReLU(), torch.nn.Conv2d(16, 3, 5, padding=2))
learner = torch.optim.Adam(network.parameters(), lr=2e-3)
first, losses, cpu, wall = None, [], [], []
for step in range(22):
    begun, now = time.process_time(), time.perf_counter()
    psf = lens.psf_rgb(points=points, ks=GRID)
    first = psf.detach().numpy() if first is None else first
    truth = F.interpolate(torch.rand(len(points), 3, 32, 32), size=(128, 128), mode="bilinear")
    seen = blurred(truth, psf)
    noisy = seen + 0.01 * torch.randn_like(seen)
    error = F.mse_loss(noisy + network(noisy), truth)
    loss = error + 0.02 * lens.loss_reg()[0]
    optimizer.zero_grad()
    learner.zero_grad()
    loss.backward()
    optimizer.step()
    learner.step()
    losses.append(float(error.detach()))
    cpu.append(1000 * (time.process_time() - begun))
    wall.append(1000 * (time.perf_counter() - now))
peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

# %% Time, and how far the first PSFs are from those of a dense trace.
theirs = "deeplens" in sys.argv
dense = Dense(indices_of(start), -lens.obj_depth, [1 / s.radius_mm for s in start.surfaces])
fields = [float(y) * side_mm / 2 / float(lens.foclen) for y in points[:, 1]]
exact = dense.bank(1 if theirs else 2, side=DENSE // 2, fields=fields)[0]
assert first is not None
apart = np.abs(first[:, :, ::-1] - exact).sum((-2, -1)).mean()
# Two steps warm up.
times = f"{np.median(cpu[2:]):.0f} ms of CPU time a step, {np.min(wall[2:]):.0f} ms at best by the clock, {peak_mb:.0f} MB"
print(f"{'DeepLens' if theirs else 'Petzval'}: {times}; PSF error {100 * apart:.2f} %")
print(f"squared error of the first five steps {np.mean(losses[:5]):.5f}, of the last five {np.mean(losses[-5:]):.5f}")
