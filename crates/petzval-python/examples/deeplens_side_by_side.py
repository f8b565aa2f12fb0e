"""The same end-to-end step in DeepLens and in Petzval: time, memory, and errors of PSFs and of a gradient. Needs PyTorch, and for the rows of
DeepLens deeplens-core, which needs Python 3.12. It takes about twenty minutes of CPU time.

Both programs have the Cooke triplet, four fields, three wavelengths, and PSFs of 64 x 64 cells of 3.45 um. What follows the PSFs is the
same code: pictures are blurred by FFT, a small network restores them, and lens and network take a step of Adam. Each setting is timed in a process
of its own, on one thread and on two. PSFs are compared with those of a dense trace in NumPy below, which has the refractive indices and the object
distance of the program that it judges, and with those of the same program at a million rays. Gradients are compared with central differences of
the dense trace, and of the same program in float64.
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
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import petzval as pz

LENS, GRID, PITCH_UM, SURFACE = "cooke-triplet-nominal", 64, 3.45, 3
lens = pz.Lens.load(LENS)

# Fields are tangents. Green is the reference wavelength: DeepLens then takes its chief rays from the rays of the green PSF.
WAVELENGTHS_UM, FIELDS = (0.656, lens.reference_um, 0.486), (0.0, 0.07, 0.14, 0.2)
PARTS, STEPS, WARM_UP, DRAWS, DENSE = 5, 20, 2, 4, 1000


@dataclass(frozen=True)
class Setting:
    """A row of the tables: a program and how many rays it takes."""

    name: str
    program: str
    number: int  # pupil cells a side of Petzval, rays a PSF of DeepLens
    float64: bool = False
    chief_rays: int = 8192  # from which DeepLens takes the one nearest to the middle of the stop: 8192 is its default
    is_timed: bool = True


PETZVAL = [Setting(f"Petzval, {n} x {n} pupil cells", "petzval", n) for n in (16, 32, 64, 128)]
PETZVAL_DENSE = Setting(f"Petzval, {DENSE} x {DENSE}", "petzval", DENSE, is_timed=False)
DEEPLENS = [
    *(Setting(f"DeepLens, {n} rays", "deeplens", n) for n in (512, 2048, 8192, 32768)),
    Setting("DeepLens, 8192 rays, float64", "deeplens", 8192, float64=True),
    Setting("DeepLens, 65536 rays, chief rays too", "deeplens", 65536, chief_rays=65536),
]
DEEPLENS_DENSE = Setting(f"DeepLens, {DENSE**2} rays", "deeplens", DENSE**2, float64=True, chief_rays=DENSE**2, is_timed=False)
# What is shown of each program in the last line: its default.
PETZVAL_SHOWN, DEEPLENS_SHOWN = PETZVAL[2], DEEPLENS[2]

# Limits of what is checked: the PSF error of `PETZVAL_SHOWN`, its gradient against its own central differences, and the two programs' indices.
WORST_PSF, WORST_GRADIENT, WORST_INDEX = 0.005, 1e-6, 1e-5


# %% A dense trace in NumPy: every ray by itself, Newton's method on the surfaces, hard edges, and a bilinear splat.
@dataclass
class Dense:
    """A lens before an object at a distance, mm, which may be infinite. `indices` has the index behind each surface by wavelength.

    PSFs are about its chief rays, or about those of another lens. The stop has its radius, as in DeepLens, or with `holds_pupil` the one that gives
    the entrance pupil its diameter, as in Petzval: the aperture of the lens is that diameter.
    """

    indices: dict[float, list[float]]
    distance_mm: float
    curvatures: list[float]
    centred_by: Dense | None = None
    holds_pupil: bool = False

    def stop_mm(self) -> float:
        """The radius of the stop: half of the entrance pupil times the height at the stop of a paraxial ray that enters at height 1."""
        y, slope, before = 1.0, 0.0, 1.0
        for surface, c, behind in zip(lens.surfaces, self.curvatures, self.indices[lens.reference_um], strict=True):
            if surface.is_stop:
                return y * lens.entrance_pupil_mm / 2 if self.holds_pupil else surface.semi_diameter_mm
            slope = (before * slope - y * c * (behind - before)) / behind
            y, before = y + slope * surface.thickness_mm, behind
        raise ValueError("the lens has no stop")

    def trace(self, wavelength_um: float, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where rays ``[3, ray]`` cross the stop and reach the image, and which of them do."""
        alive, before, at_stop, stop_mm = np.ones(o.shape[1], dtype=bool), 1.0, o[:2], self.stop_mm()
        for surface, c, behind in zip(lens.surfaces, self.curvatures, self.indices[wavelength_um], strict=True):
            t = -o[2] / d[2]
            for _ in range(6):
                p = o + t * d
                sag, slope = _sag(p[0] ** 2 + p[1] ** 2, c, surface)
                t = t - (p[2] - sag) / (d[2] - slope * (p[0] * d[0] + p[1] * d[1]))
            p = o + t * d
            r2 = p[0] ** 2 + p[1] ** 2
            _, slope = _sag(r2, c, surface)
            alive &= r2 <= (stop_mm if surface.is_stop else surface.semi_diameter_mm) ** 2
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


def end_to_end(psfs_of: Any, optimizer_of: Any, *, with_parts: bool) -> dict[str, float]:
    """Time of a step, and with `with_parts` of PSFs, and of PSFs with their gradient, ms."""
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
    found["step_ms"], found["step_wall_ms"] = _times_ms(step, STEPS)
    # Before the parts: they hold no more than a step does, and a process never gives its peak back.
    found["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if with_parts:
        with torch.no_grad():
            found["forward_ms"], _ = _times_ms(psfs_of, PARTS)
        found["both_ms"], _ = _times_ms(both_ways, PARTS)
    return found


def _times_ms(work: Any, times: int) -> tuple[float, float]:
    """The median of CPU time, of all threads together, and the shortest wall time, which other work on the machine disturbs least."""
    for _ in range(WARM_UP):
        work()
    cpu, wall = [], []
    for _ in range(times):
        at, now = time.process_time(), time.perf_counter()
        work()
        cpu.append(1000 * (time.process_time() - at))
        wall.append(1000 * (time.perf_counter() - now))
    return float(np.median(cpu)), float(np.min(wall))


# %% Petzval.
class Petzval:
    """PSFs, gradients and times of Petzval."""

    def __init__(self, setting: Setting) -> None:
        self.how: dict[str, Any] = {
            "fields_deg": [math.degrees(math.atan(t)) for t in FIELDS],
            "wavelengths_um": WAVELENGTHS_UM,
            "grid": GRID,
            "pitch_um": PITCH_UM,
            "pupil_cells": setting.number,
        }

    def times(self, *, with_parts: bool) -> dict[str, float]:
        """Times of a step for all free numbers of the lens, and of its parts."""
        import torch

        import petzval.torch as pt

        glass = pt.Lens(lens, lens.variables())

        def optimizer_of(network: Any) -> Any:
            return torch.optim.Adam([{"params": network.parameters(), "lr": 1e-3}, {"params": glass.parameters(), "lr": 1e-3}])

        return end_to_end(lambda: glass.psf(**self.how).values, optimizer_of, with_parts=with_parts)

    def psfs(self) -> tuple[list[np.ndarray], dict[str, Any]]:
        """PSFs."""
        import petzval.torch as pt

        return [pt.Lens(lens, lens.variables()).psf(**self.how).values.detach().numpy()], {}

    def gradients(self) -> dict[str, list[float]]:
        """Derivatives by one curvature, 1/mm: by PyTorch, and the same beside a central difference."""
        import torch

        import petzval.torch as pt

        radius = lens.surfaces[SURFACE].radius_mm
        one = pt.Lens(lens, lens.variables([pz.Variable(SURFACE, "radius_mm", radius - 2, radius + 2)], efl="free", focus="fixed"))
        spot(one.psf(**self.how).values).backward()
        x, h = one.x.detach().clone(), 1e-5
        found, values, curvatures = float(one.x.grad[0]), [], []
        for moved in (x + h, x - h):
            with torch.no_grad():
                one.x.copy_(moved)
                values.append(float(spot(one.psf(**self.how).values)))
            curvatures.append(1 / one.space.lens_at(moved.numpy()).surfaces[SURFACE].radius_mm)
        by_curvature = (curvatures[0] - curvatures[1]) / (2 * h)
        return {"by_torch": [found / by_curvature], "beside": [found], "by_differences": [(values[0] - values[1]) / (2 * h)]}


# %% DeepLens.
class DeepLens:
    """The same of DeepLens, several times over, as its rays are random."""

    def __init__(self, setting: Setting) -> None:
        import torch
        from deeplens.geolens_pkg import psf_compute

        psf_compute.SPP_PSF = setting.chief_rays
        self.setting = setting
        self.theirs = self.load(torch.float64 if setting.float64 else torch.float32)

    def load(self, dtype: Any) -> Any:
        """The lens."""
        import torch
        from deeplens import GeoLens

        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "lens.json").write_text(json.dumps(for_deeplens()))
            return GeoLens(
                filename=f"{folder}/lens.json", device=torch.device("cpu"), dtype=dtype, primary_wvln=lens.reference_um, wvln_rgb=WAVELENGTHS_UM
            )

    def points(self, theirs: Any) -> Any:
        """The fields, as shares of half of the sensor, by the focal length."""
        import torch

        half = theirs.sensor_size[1] / 2
        return torch.tensor([[0.0, t * theirs.foclen / half, theirs.obj_depth] for t in FIELDS], dtype=theirs.dtype)

    def times(self, *, with_parts: bool) -> dict[str, float]:
        """Times of a step for curvatures, distances and aspheres, and of its parts."""
        points = self.points(self.theirs)
        optimizer = self.theirs.get_optimizer(lrs=[1e-5, 1e-6, 0.0, 1e-9])

        def optimizer_of(network: Any) -> Any:
            optimizer.add_param_group({"params": network.parameters(), "lr": 1e-3})
            return optimizer

        return end_to_end(lambda: self.theirs.psf_rgb(points, ks=GRID, spp=self.setting.number).flip(-2), optimizer_of, with_parts=with_parts)

    def psfs(self) -> tuple[list[np.ndarray], dict[str, Any]]:
        """PSFs, and the indices and the object distance that they have."""
        import torch

        drawn = []
        for seed in range(DRAWS if self.setting.is_timed else 1):
            torch.manual_seed(seed)
            with torch.no_grad():
                fields = [self.theirs.psf_rgb(point[None], ks=GRID, spp=self.setting.number) for point in self.points(self.theirs)]
            drawn.append(torch.cat(fields).flip(-2).double().numpy())  # y away from the axis
        indices = [[float(s.mat2.ior(colour)) for s in self.theirs.surfaces] for colour in WAVELENGTHS_UM]
        return drawn, {"indices": indices, "distance_mm": -float(self.theirs.obj_depth)}

    def gradients(self) -> dict[str, list[float]]:
        """Derivatives by one curvature, 1/mm: by PyTorch, and in float64 beside central differences, for the same rays."""
        import torch

        by_torch = [self.gradient(self.theirs, seed) for seed in range(DRAWS)]
        double, h = self.load(torch.float64), 1e-6
        c = double.surfaces[SURFACE].c
        beside, by_differences = [self.gradient(double, seed) for seed in range(DRAWS)], []
        for seed in range(DRAWS):
            values = []
            for by in (h, -h):
                with torch.no_grad():
                    c.add_(by)
                    values.append(sum(float(part) for part in self.parts(double, seed)))
                    c.sub_(by)
            by_differences.append((values[0] - values[1]) / (2 * h))
        return {"by_torch": by_torch, "beside": beside, "by_differences": by_differences}

    def gradient(self, theirs: Any, seed: int) -> float:
        """The derivative by PyTorch for one draw of rays."""
        theirs.get_optimizer()  # turns derivatives on
        theirs.surfaces[SURFACE].c.grad = None
        for part in self.parts(theirs, seed):
            part.backward()
        return float(theirs.surfaces[SURFACE].c.grad)

    def parts(self, theirs: Any, seed: int) -> Any:
        """The loss field by field, which takes a quarter of the memory."""
        import torch

        torch.manual_seed(seed)
        for point in self.points(theirs):
            yield spot(theirs.psf_rgb(point[None], ks=GRID, spp=self.setting.number).double()) / len(FIELDS)


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
def one(number: str, threads: str, folder: str) -> None:
    """Measures a setting, or with no threads its errors, and writes what it found."""
    import torch

    setting = SETTINGS[int(number)]
    torch.set_num_threads(max(int(threads), 1))
    pz.set_threads(max(int(threads), 1))
    program = Petzval(setting) if setting.program == "petzval" else DeepLens(setting)
    found: dict[str, Any] = {}
    if int(threads):
        found = program.times(with_parts=int(threads) == 1)
    else:
        psfs, found = program.psfs()
        np.save(Path(folder) / "psfs.npy", np.stack(psfs))
        found |= program.gradients() if setting.is_timed else {}
    (Path(folder) / "found.json").write_text(json.dumps(found))


SETTINGS = [*PETZVAL, PETZVAL_DENSE, *DEEPLENS, DEEPLENS_DENSE]


def measured(setting: Setting) -> dict[str, Any]:
    """What processes found: times by threads, then PSFs and gradients."""
    all_found: dict[str, Any] = {"setting": setting}
    print(setting.name, file=sys.stderr, flush=True)
    for threads in (1, 2, 0) if setting.is_timed else (0,):
        with tempfile.TemporaryDirectory() as folder:
            words = [sys.executable, __file__, str(SETTINGS.index(setting)), str(threads), folder]
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
            found: dict[str, Any] = json.loads((Path(folder) / "found.json").read_text())
            if threads:
                all_found[f"on_{threads}"] = found
            else:
                all_found |= {**found, "psfs": np.load(Path(folder) / "psfs.npy")}
    return all_found


# %% The tables.
def reference(indices: dict[float, list[float]], distance_mm: float, order: int, *, holds_pupil: bool) -> tuple[np.ndarray, float, float]:
    """PSFs of the dense trace ``[order, field, wavelength, y, x]``, and its gradient by the curvature from central differences.

    Cells of the first order are those of the program that is judged; those of the second hold the light that falls on them. The second gradient
    is that of PSFs whose grid stays where it is when the chief ray moves, as in DeepLens; it is no number where the pupil is held, as in Petzval.
    """
    curvatures = [1 / s.radius_mm for s in lens.surfaces]
    start = Dense(indices, distance_mm, curvatures, holds_pupil=holds_pupil)
    h = 1e-4  # 1/mm: steps of 1e-6 have an error of 1 %, as few rays pass the hard edge of the stop

    def gradient(centred_by: Dense | None) -> float:
        up, down = ([c + by * (i == SURFACE) for i, c in enumerate(curvatures)] for by in (h, -h))
        values = [spot(Dense(indices, distance_mm, moved, centred_by, holds_pupil).bank(order)) for moved in (up, down)]
        return float(values[0] - values[1]) / (2 * h)

    return start.bank(order, 0), gradient(None), math.nan if holds_pupil else gradient(start)


def apart(psfs: np.ndarray, truth: np.ndarray) -> float:
    """PSF error: the sum of absolute differences of PSFs of unit sum, mean of all PSFs and draws."""
    return float(np.abs(psfs - truth).sum((-2, -1)).mean())


def percent(shares: Any, decimals: int = 2) -> str:
    """The mean in percent, with the standard deviation of one draw."""
    shares = 100 * np.atleast_1d(shares)
    return f"{shares.mean():.{decimals}f}" + (f" +- {shares.std(ddof=1):.{decimals}f}" if len(shares) > 1 else "")


def off(found: dict[str, Any]) -> np.ndarray:
    """How far the gradient by PyTorch is from central differences of the same program, as a share."""
    shares: np.ndarray = np.array(found["beside"]) / np.array(found["by_differences"]) - 1
    return shares


def show(rows: list[dict[str, Any]], own: np.ndarray, truth: np.ndarray, slope: float, held: float) -> None:
    """Rows of errors of one program, against its own dense PSFs and against those of the dense trace."""
    for found in rows:
        line = f"{found['setting'].name:<38}" + "".join(f"{100 * apart(found['psfs'], of):>9.2f}" for of in (own, *truth))
        if found["setting"].is_timed:
            by_torch = np.array(found["by_torch"])
            line += f"{percent(by_torch / slope - 1):>18}{'' if math.isnan(held) else percent(by_torch / held - 1):>18}"
            worst = np.abs(off(found)).max()
            line += f"{percent(off(found)):>18}" if worst > 1e-4 else f"{f'{100 * worst:.0e}':>18}"
        print(line)


def main() -> str | None:
    """All settings as tables, errors in percent and times in ms. The answer is what is wrong, or none."""
    # Processes are measured before this one takes memory: the peak of a new process begins at that of the one which starts it.
    alone = "import resource, torch; print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
    torch_mb = float(subprocess.run([sys.executable, "-c", alone], check=True, capture_output=True, text=True).stdout)
    ours = [measured(setting) for setting in (*PETZVAL, PETZVAL_DENSE)]
    theirs = [measured(setting) for setting in (*DEEPLENS, DEEPLENS_DENSE)] if find_spec("deeplens") else []

    print(f"{'':<38}{'PSFs':>9}{'and back':>9}{'step':>10}{'wall':>9}{'2 threads':>11}{'MB':>7}")
    for found in (*ours[:-1], *theirs[:-1]):
        single, pair = found["on_1"], found["on_2"]
        line = f"{found['setting'].name:<38}{single['forward_ms']:>9.1f}{single['both_ms']:>9.1f}{single['step_ms']:>10.1f}"
        print(f"{line}{single['step_wall_ms']:>9.1f}{pair['step_wall_ms']:>11.1f}{single['peak_mb']:>7.0f}")
    print(f"PSFs, and back, step: median CPU time of PSFs, of PSFs with their gradient, of {STEPS} steps, on one thread")
    print("wall, 2 threads: the shortest step by the clock on one thread, and on two, whose CPU time says little: a thread that waits is busy")
    print(f"MB: peak memory of a process with one thread; {torch_mb:.0f} MB of it are an import of PyTorch")

    indices = indices_of(lens)
    truth, *slopes = reference(indices, math.inf, order=2, holds_pupil=True)
    coarse = Dense(indices, math.inf, [1 / s.radius_mm for s in lens.surfaces]).bank(2, side=DENSE // 2)
    print(f"dense trace: {DENSE} x {DENSE} rays; PSFs of a quarter of them differ by {100 * apart(coarse, truth[:1]):.3f} %")
    print(f"{'':<38}{'own':>9}{'trace':>9}{'pixels':>9}{'gradient':>18}{'held':>18}{'own':>18}")
    show(ours, ours[-1]["psfs"], truth, *slopes)
    shown = next(found for found in ours if found["setting"] is PETZVAL_SHOWN)
    error, gradient = apart(shown["psfs"], truth[0]), float(np.abs(off(shown)).max())
    wrong = [f"the PSF error of Petzval is {100 * error:.2f} %"] if error > WORST_PSF else []
    wrong += [f"a gradient of Petzval is off by {gradient:.1e}"] if gradient > WORST_GRADIENT else []
    if theirs:
        own = dict(zip(WAVELENGTHS_UM, theirs[0]["indices"], strict=True))
        their_truth, *their_slopes = reference(own, theirs[0]["distance_mm"], order=1, holds_pupil=False)
        show(theirs, theirs[-1]["psfs"], their_truth, *their_slopes)
        differ = max(abs(a - b) for w in own for a, b in zip(indices[w], own[w], strict=True))
        wrong += [f"indices of the two programs differ by {differ:.1e}"] if differ > WORST_INDEX else []
        print(f"indices of the two programs differ by {differ:.1e} at most")
    else:
        print("DeepLens is not installed, and its rows are left out: pip install deeplens-core, in Python 3.12")
    print("PSF errors: own, against the same program at a million rays; trace, against the dense trace with cells that share a ray as those of the")
    print("program do; pixels, against the light that falls on each cell. Gradients: against those of the dense trace, of one in which the grid of a")
    print("PSF does not follow the chief ray (held), and central differences of the same program in float64 (own)")
    cells = PETZVAL_SHOWN.number
    words = [f"Petzval {pz.__version__}, {cells} x {cells} cells: {shown['on_1']['step_ms']:.0f} ms a step, PSF error {100 * error:.2f} %"]
    if theirs:
        shown = next(found for found in theirs if found["setting"] is DEEPLENS_SHOWN)
        error = apart(shown["psfs"], their_truth[0])
        words.append(f"DeepLens {version('deeplens-core')}, {DEEPLENS_SHOWN.number} rays: {shown['on_1']['step_ms']:.0f} ms, {100 * error:.2f} %")
    words.append(f"PyTorch {version('torch')}, NumPy {np.__version__}, Python {sys.version.split()[0]}")
    print("; ".join(words))
    return "; ".join(wrong) or None


if __name__ == "__main__":
    one(*sys.argv[1:]) if len(sys.argv) == 4 else sys.exit(main())
