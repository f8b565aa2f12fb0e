"""A network of your own behind a lens that moves: both learn from one loss, by exact gradients. Needs PyTorch."""

# %% A lens whose free numbers are a parameter, and a small network.
import torch
import torch.nn.functional as F

import petzval as pz
import petzval.torch as pt

torch.manual_seed(0)
torch.set_num_threads(1)
start = pz.Lens.load("cooke-triplet-nominal")
glass = pt.Lens(start, start.variables())
network = torch.nn.Sequential(torch.nn.Conv2d(3, 16, 5, padding=2), torch.nn.ReLU(), torch.nn.Conv2d(16, 3, 5, padding=2))
optimizer = torch.optim.Adam([{"params": network.parameters(), "lr": 2e-3}, {"params": glass.parameters(), "lr": 2e-2}])

# %% Light through the lens, noise of the sensor, and the network; one backward pass for all.
WINDOW, WHITE_E = 64, 16_000.0
losses = []
for step in range(60):
    texture = F.interpolate(torch.rand(4, 3, 24, 24), size=(WINDOW + 64, WINDOW + 64), mode="bilinear")
    psfs = glass.psf(fields_deg=[0, 6, 12], wavelengths_um=[0.62, 0.55, 0.486], grid=64, pitch_um=5.86, pupil_cells=32)
    light = pt.render(texture, psfs, pixel_um=5.86, patches=(2, 2), shape=(480, 480), row=(step * 61) % 400, column=(step * 97) % 400, border=32)
    noisy = light + (light.clamp(min=0) / WHITE_E).sqrt() * torch.randn_like(light)
    target = texture[..., 32:-32, 32:-32]
    loss = F.mse_loss(noisy + network(noisy), target) + glass.penalty()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    losses.append(float(loss.detach()))

# %% What came of it.
first, last = (sum(part) / len(part) for part in (losses[:10], losses[-10:]))
print(f"mean loss of the first ten steps {first:.5f}, of the last ten {last:.5f}")
designed = glass.lens()
designed.save("designed.toml")
print("RMS spot radius, um, before:", start.spots().rms_um.round(1), "after:", designed.spots().rms_um.round(1))
