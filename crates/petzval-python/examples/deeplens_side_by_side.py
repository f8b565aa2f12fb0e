"""The same end-to-end step in DeepLens and in Petzval: time, memory, and errors of PSFs and of a gradient. Needs PyTorch, and for the rows of
DeepLens deeplens-core, which needs Python 3.12.

Both programs have the Cooke triplet, four fields, three wavelengths, PSFs of 64 x 64 cells of 3.45 um, and one thread. What follows the PSFs is the
same code: pictures are blurred by FFT, a small network restores them, and lens and network take a step of Adam. Each setting runs in a process of
its own. Errors are those against a third program, the dense trace in NumPy below, which has the refractive indices and the object distance of the
program that it judges.
"""

# %% The setting.
from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import petzval as pz

LENS, GRID, PITCH_UM, SURFACE = "cooke-triplet-nominal", 64, 3.45, 3
WAVELENGTHS_UM, FIELDS = (0.62, 0.55, 0.486), (0.0, 0.07, 0.14, 0.2)  # fields as tangents
STEPS, DRAWS, DENSE = 5, 6, 1000
PETZVAL_CELLS = (16, 32, 64, 128)
DEEPLENS_RAYS = (512, 2048, 8192, 32768)  # 8192 is the default of DeepLens

lens = pz.Lens.load(LENS)


# %% A dense trace in NumPy: every ray by itself, Newton's method on the surfaces, hard edges, and a bilinear splat.
@dataclass
class Dense:
    """A lens before an object at a distance, mm, which may be infinite. `indices` has the index behind each surface by wavelength.

    PSFs are about its chief rays, or about those of another lens.
    """

    indices: dict[float, list[float]]
    distance_mm: float
    curvatures: list[float]
    centred_by: Dense | None = None

    def trace(self, wavelength_um: float, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where rays ``[3, ray]`` cross the stop and reach the image, and which of them do."""
        alive, before, at_stop = np.ones(o.shape[1], dtype=bool), 1.0, o[:2]
        for surface, c, behind in zip(lens.surfaces, self.curvatures, self.indices[wavelength_um], strict=True):
            t = -o[2] / d[2]
            for _ in range(6):
                p = o + t * d
                sag, slope = _sag(p[0] ** 2 + p[1] ** 2, c, surface)
                t = t - (p[2] - sag) / (d[2] - slope * (p[0] * d[0] + p[1] * d[1]))
            p = o + t * d
            r2 = p[0] ** 2 + p[1] ** 2
            _, slope = _sag(r2, c, surface)
            alive &= r2 <= surface.semi_diameter_mm**2
            at_stop = p[:2] if surface.is_stop else at_stop
            normal = np.stack([-slope * p[0], -slope * p[1], np.ones_like(slope)])
            normal /= np.linalg.norm(normal, axis=0)
            ratio, cosine = before / behind, (normal * d).sum(0)
            root = 1 - ratio**2 * (1 - cosine**2)
            alive &= root > 0
            d = ratio * d + (np.sqrt(np.maximum(root, 0)) - ratio * cosine) * normal
            o, before = p - np.array([[0.0], [0.0], [surface.thickness_mm]]), behind
        return at_stop, (o - o[2] / d[2] * d)[:2], alive & np.isfinite(o).all(0)

    def rays(self, tangent: float, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays from the object through points of the plane of the first vertex."""
        at = np.stack([x, y, np.zeros_like(x)])
        if math.isinf(self.distance_mm):
            d = np.stack([np.zeros_like(x), np.full_like(x, tangent), np.ones_like(x)])
        else:
            d = at - np.array([[0.0], [-tangent * self.distance_mm], [-self.distance_mm]])
        return at, d / np.linalg.norm(d, axis=0)

    def chief(self, tangent: float) -> tuple[float, float]:
        """Where the ray of the reference wavelength through the middle of the stop crosses the first vertex, and the image."""
        if self.centred_by is not None:
            return self.centred_by.chief(tangent)

        def at(y: float) -> tuple[float, float]:
            stop, image, _ = self.trace(lens.reference_um, *self.rays(tangent, np.zeros(1), np.array([y])))
            return float(stop[1, 0]), float(image[1, 0])

        y, step = 0.0, 1e-4
        for _ in range(20):
            y -= at(y)[0] * step / (at(y + step)[0] - at(y)[0])
        return y, at(y)[1]

    def psf(self, tangent: float, wavelength_um: float, side: int, orders: tuple[int, ...]) -> np.ndarray:
        """The PSF ``[order, y, x]`` of ``side`` x ``side`` rays over the beam, with cells of each order."""
        y0, image = self.chief(tangent)
        reach = 1.3 * lens.entrance_pupil_mm / 2
        steps = (np.arange(side) + 0.5) / side * 2 - 1
        y, x = np.meshgrid(y0 + reach * steps, reach * steps[side // 2 :], indexing="ij")  # the other half is its mirror image
        _, hit, alive = self.trace(wavelength_um, *self.rays(tangent, x.ravel(), y.ravel()))
        column, row = (1000 * (hit - np.array([[0.0], [image]])) / PITCH_UM)[:, alive] + (GRID - 1) / 2
        values = np.stack([_splat(row, column, order) for order in orders])
        values += values[..., ::-1]
        psfs: np.ndarray = values / values.sum((1, 2), keepdims=True)
        return psfs[:, :: -1 if image < 0 else 1]  # y away from the axis

    def bank(self, *orders: int, side: int = DENSE, fields: Sequence[float] = FIELDS) -> np.ndarray:
        """PSFs ``[order, field, wavelength, y, x]``."""
        psfs = [[self.psf(field, colour, side, orders) for colour in WAVELENGTHS_UM] for field in fields]
        return np.stack(psfs).transpose(2, 0, 1, 3, 4)


def _splat(row: np.ndarray, column: np.ndarray, order: int) -> np.ndarray:
    """Rays in cells ``[y, x]``: each in its own (order 0), shared by two each way (1, bilinear), or by three (2, quadratic B-spline)."""

    def shares(u: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        first = np.floor(u) if order == 1 else np.round(u)
        d = u - first
        if order == 0:
            return first.astype(int), [np.ones_like(d)]
        if order == 1:
            return first.astype(int), [1 - d, d]
        return first.astype(int) - 1, [(0.5 - d) ** 2 / 2, 0.75 - d**2, (0.5 + d) ** 2 / 2]

    (j, down), (i, across) = shares(row), shares(column)
    values = np.zeros(GRID * GRID)
    for y, by_y in enumerate(down):
        for x, by_x in enumerate(across):
            inside = (j + y >= 0) & (j + y < GRID) & (i + x >= 0) & (i + x < GRID)
            values += np.bincount(((j + y) * GRID + i + x)[inside], (by_y * by_x)[inside], GRID * GRID)
    return values.reshape(GRID, GRID)


def _sag(r2: np.ndarray, c: float, surface: pz.Surface) -> tuple[np.ndarray, np.ndarray]:
    """Height of a surface, and its derivative by the radius divided by the radius."""
    root = np.sqrt(np.maximum(1 - (1 + surface.conic) * c**2 * r2, 1e-9))
    sag, slope = c * r2 / (1 + root), c / root
    power = np.ones_like(r2)  # r^0, r^2, r^4 ...
    for order, a in enumerate(surface.asphere, start=1):
        if a:
            sag, slope = sag + a * power * r2, slope + 2 * order * a * power
        power = power * r2
    return sag, slope


def indices_of(lens: pz.Lens) -> dict[float, list[float]]:
    """The index behind each surface by wavelength, as Petzval has it."""
    glasses = {g: pz.Glass(g) for g in {s.glass for s in lens.surfaces} - {"AIR"}}

    def index(glass: str, colour: float) -> float:
        return 1.0 if glass == "AIR" else float(glasses[glass].index([colour])[0])

    return {w: [index(s.glass, w) for s in lens.surfaces] for w in (*WAVELENGTHS_UM, lens.reference_um)}


def spot(values: Any) -> Any:
    """The loss whose gradient is judged: squared distance of the light from the chief ray, cells, mean of all PSFs."""
    at = np.arange(GRID) - (GRID - 1) / 2
    weights = at[:, None] ** 2 + at[None, :] ** 2
    if not isinstance(values, np.ndarray):
        import torch

        weights = torch.from_numpy(weights)
    return (values * weights).sum((-2, -1)).mean()


# %% What follows the PSFs, the same for both.
def blurred(pictures: Any, psfs: Any) -> Any:
    """Pictures ``[field, colour, y, x]`` through PSFs of their fields and colours; black around them."""
    from torch import fft

    side = pictures.shape[-1] + GRID
    product = fft.rfft2(pictures, s=(side, side)) * fft.rfft2(psfs, s=(side, side))
    return fft.irfft2(product, s=(side, side))[..., GRID // 2 : side - GRID // 2, GRID // 2 : side - GRID // 2]


def end_to_end(psfs_of: Any, optimizer_of: Any) -> dict[str, Any]:
    """CPU time of PSFs forward, of PSFs forward and backward, and of a whole step, ms: medians of several."""
    import torch
    from torch import nn

    torch.manual_seed(0)
    network = nn.Sequential(nn.Conv2d(3, 16, 3, padding=1), nn.ReLU(), nn.Conv2d(16, 16, 3, padding=1), nn.ReLU(), nn.Conv2d(16, 3, 3, padding=1))
    optimizer = optimizer_of(network)
    truth = torch.rand(len(FIELDS), 3, 128, 128)

    def step() -> None:
        seen = blurred(truth, psfs_of().float())
        loss = (seen + network(seen) - truth).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    def both_ways() -> None:
        psfs_of().square().sum().backward()

    found = {}
    with torch.no_grad():
        found["forward_ms"] = _cpu_ms(psfs_of)
    found["both_ms"] = _cpu_ms(both_ways)
    found["step_ms"] = _cpu_ms(step)
    return found


def _cpu_ms(work: Any) -> float:
    work()
    taken = []
    for _ in range(STEPS):
        begun = time.process_time()
        work()
        taken.append(1000 * (time.process_time() - begun))
    return float(np.median(taken))


# %% Petzval.
def petzval(cells: int) -> dict[str, Any]:
    """PSFs, a gradient and times of Petzval with so many cells a side of the pupil."""
    import torch

    import petzval.torch as pt

    pz.set_threads(1)
    how: dict[str, Any] = {
        "fields_deg": [math.degrees(math.atan(t)) for t in FIELDS],
        "wavelengths_um": WAVELENGTHS_UM,
        "grid": GRID,
        "pitch_um": PITCH_UM,
        "pupil_cells": cells,
    }
    glass = pt.Lens(lens, lens.variables())
    psfs = glass.psf(**how).values.detach().numpy()

    # The gradient by one curvature.
    radius = lens.surfaces[SURFACE].radius_mm
    one = pt.Lens(lens, lens.variables([pz.Variable(SURFACE, "radius_mm", radius - 2, radius + 2)], efl="free", focus="fixed"))
    spot(one.psf(**how).values).backward()
    x, h = one.x.detach().numpy(), 1e-6
    up, down = (1 / one.space.lens_at(x + s).surfaces[SURFACE].radius_mm for s in (h, -h))
    gradient = float(one.x.grad[0]) / ((up - down) / (2 * h))

    def optimizer_of(network: Any) -> Any:
        return torch.optim.Adam([{"params": network.parameters(), "lr": 1e-3}, {"params": glass.parameters(), "lr": 1e-3}])

    timed = end_to_end(lambda: glass.psf(**how).values, optimizer_of)
    return {"psfs": [psfs], "gradients": [gradient], **timed}


# %% DeepLens.
def deeplens(rays: int, double: bool = False) -> dict[str, Any]:
    """The same of DeepLens with so many rays a PSF, several times over, as its rays are random."""
    import torch
    from deeplens import GeoLens

    path = Path(tempfile.mkdtemp()) / "lens.json"
    path.write_text(json.dumps(for_deeplens()))
    dtype = torch.float64 if double else torch.float32
    theirs = GeoLens(filename=str(path), device=torch.device("cpu"), dtype=dtype, primary_wvln=lens.reference_um)
    path.unlink()
    path.parent.rmdir()
    depth = theirs.obj_depth
    # Fields are shares of half of the sensor, by the focal length.
    points = torch.tensor([[0.0, t * theirs.foclen / (theirs.sensor_size[1] / 2), depth] for t in FIELDS], dtype=dtype)

    def psfs() -> torch.Tensor:
        found = [theirs.psf(points, wvln=colour, ks=GRID, spp=rays) for colour in WAVELENGTHS_UM]
        return torch.stack(found, 1).flip(-2)  # y away from the axis

    optimizer = theirs.get_optimizer(lrs=[1e-5, 1e-6, 0.0, 1e-9])
    drawn, gradients = [], []
    for seed in range(DRAWS):
        torch.manual_seed(seed)
        values = psfs()
        theirs.surfaces[SURFACE].c.grad = None
        spot(values.double()).backward()
        drawn.append(values.detach().double().numpy())
        gradients.append(float(theirs.surfaces[SURFACE].c.grad))

    def optimizer_of(network: Any) -> Any:
        optimizer.add_param_group({"params": network.parameters(), "lr": 1e-3})
        return optimizer

    return {
        "psfs": drawn,
        "gradients": gradients,
        "distance_mm": -float(depth),
        "indices": [[float(s.mat2.ior(colour)) for s in theirs.surfaces] for colour in (*WAVELENGTHS_UM, lens.reference_um)],
        **end_to_end(psfs, optimizer_of),
    }


def for_deeplens() -> dict[str, Any]:
    """The lens as a file of DeepLens."""
    rows = []
    for surface in lens.surfaces:
        row: dict[str, Any] = {"r": surface.semi_diameter_mm, "d_next": surface.thickness_mm, "is_aperture": surface.is_stop}
        row["mat2"] = surface.glass.lower()
        if surface.is_stop:
            row["type"] = "Aperture"
        elif any(surface.asphere):
            row |= {"type": "Aspheric", "c": 1 / surface.radius_mm, "k": surface.conic, "ai": list(surface.asphere[1:]), "use_ai2": False}
        else:
            row |= {"type": "Spheric", "c": 1 / surface.radius_mm}
        rows.append(row)
    side = 2048 * PITCH_UM / 1000
    return {"surfaces": rows, "sensor_size": [side, side], "sensor_res": [2048, 2048]}


# %% One setting in a process of its own.
def one(name: str, number: str, folder: str) -> None:
    """Measures a setting, and writes what it found."""
    import torch

    torch.set_num_threads(1)
    found = petzval(int(number)) if name == "petzval" else deeplens(int(number), double=name.endswith("64"))
    np.save(Path(folder) / "psfs.npy", np.stack(found.pop("psfs")))
    found["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    (Path(folder) / "found.json").write_text(json.dumps(found))


def measured(name: str, number: int) -> dict[str, Any]:
    """What a process found."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, __file__, name, str(number), folder], check=True, stdout=subprocess.DEVNULL)
        found: dict[str, Any] = json.loads((Path(folder) / "found.json").read_text())
        return {**found, "psfs": np.load(Path(folder) / "psfs.npy")}


def reference(indices: dict[float, list[float]], distance_mm: float, order: int) -> tuple[np.ndarray, float, float]:
    """PSFs of the dense trace ``[order, field, wavelength, y, x]``, and its gradient by the curvature from central differences.

    Cells of the first order are those of the program that is judged; those of the second hold the light that falls on them. The second gradient
    is that of PSFs whose grid stays where it is when the chief ray moves.
    """
    curvatures = [1 / s.radius_mm for s in lens.surfaces]
    start, h = Dense(indices, distance_mm, curvatures), 1e-6

    def gradient(centred_by: Dense | None) -> float:
        up, down = ([c + by * (i == SURFACE) for i, c in enumerate(curvatures)] for by in (h, -h))
        values = [spot(Dense(indices, distance_mm, moved, centred_by).bank(order)) for moved in (up, down)]
        return float(values[0] - values[1]) / (2 * h)

    return start.bank(order, 0), gradient(None), gradient(start)


def row(name: str, found: dict[str, Any], truth: np.ndarray, slope: float, held: float) -> None:
    """A row of the table."""
    # Sum of absolute differences of PSFs of unit sum, mean of all PSFs and draws.
    error, cells = (np.abs(found["psfs"] - of).sum((-2, -1)).mean() for of in truth)
    off, off_held = (np.array(found["gradients"]) / of - 1 for of in (slope, held))
    scatter = f"+- {100 * off.std(ddof=1):.2f} %" if len(off) > 1 else ""
    print(
        f"{name:<32}{100 * error:>8.2f} %{100 * cells:>8.1f} %{100 * off.mean():>10.2f} %{100 * off_held.mean():>8.2f} %{scatter:>11}"
        f"{found['forward_ms']:>11.1f}{found['both_ms']:>10.1f}{found['step_ms']:>10.1f}{found['peak_mb']:>9.0f}"
    )


def main() -> None:
    """All settings, as a table."""
    ours = indices_of(lens)
    truth, *slopes = reference(ours, math.inf, order=2)
    coarse = Dense(ours, math.inf, [1 / s.radius_mm for s in lens.surfaces]).bank(2, side=DENSE // 2)
    apart = np.abs(coarse - truth[:1]).sum((-2, -1)).mean()
    print(f"dense trace: {DENSE} x {DENSE} rays; a quarter of them differs by {100 * apart:.3f} %")
    print(f"{'':<32}{'PSF error':>10}{'pixels':>10}{'gradient':>12}{'held':>10}{'scatter':>11}{'PSFs, ms':>11}{'and back':>10}{'step, ms':>10}{'MB':>9}")
    for cells in PETZVAL_CELLS:
        row(f"Petzval, {cells} x {cells} pupil cells", measured("petzval", cells), truth, *slopes)
    if find_spec("deeplens") is None:
        print("DeepLens is not installed, and its rows are left out: pip install deeplens-core, in Python 3.12")
        return
    theirs: tuple[np.ndarray, float, float] | None = None
    for name, rays in [*(("deeplens", rays) for rays in DEEPLENS_RAYS), ("deeplens-64", 8192)]:
        found = measured(name, rays)
        if theirs is None:
            indices = dict(zip((*WAVELENGTHS_UM, lens.reference_um), found["indices"], strict=True))
            theirs = reference(indices, found["distance_mm"], order=1)
            apart = max(abs(a - b) for w in ours for a, b in zip(ours[w], indices[w], strict=True))
        row(f"DeepLens, {rays} rays{', float64' if name.endswith('64') else ''}", found, *theirs)
    print(f"indices of the two programs differ by {apart:.1e} at most")
    print("PSF error: against cells that share a ray as those of the program do; pixels: against the light that falls on each cell")
    print("gradient: against that of the dense trace; held: against one in which the grid of a PSF does not follow the chief ray")


if __name__ == "__main__":
    one(*sys.argv[1:]) if len(sys.argv) == 4 else main()
