"""What a newcomer gets wrong: the error names the argument, whatever type its value has."""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz

NAN = float("nan")


def _calls(lens: pz.Lens, folder: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Wrong calls, by the key of the error."""
    bank = pz.psf(lens, fields_deg=[0, 7], grid=32, pitch_um=4, pupil_cells=16)
    sensor, light, mapping = pz.Sensor.load("imx249-fitted"), np.ones((64, 64)), dict[str, Any]()
    # A mask says which values do not count.
    masked = np.ma.masked_array(light, mask=light > 2)
    masked[3, 4] = np.ma.masked
    yield "picture", lambda: pz.rendering.render(masked, bank, pixel_um=4.0)
    yield "picture", lambda: pz.Camera(lens, sensor).take(np.ma.stack([masked] * 3, axis=-1))
    yield "per_mm", lambda: lens.mtf(per_mm=masked[3])
    # One thing made by a path alone, as in other packages.
    yield "Lens", lambda: pz.Lens("my.zmx")  # type: ignore[arg-type]
    yield "Sensor", lambda: pz.Sensor("imx249-fitted")  # type: ignore[arg-type]
    yield "Isp", lambda: pz.Isp("quality")  # type: ignore[arg-type]
    yield "Detector", lambda: pz.Detector("run")  # type: ignore[arg-type]
    for wrong in (3, None, b"cooke-triplet-nominal", [lens]):
        yield "name", lambda wrong=wrong: pz.Lens.load(wrong)
        yield "name", lambda wrong=wrong: pz.Sensor.load(wrong)
        yield "path", lambda wrong=wrong: pz.PsfBank.load(wrong)
        yield "folder", lambda wrong=wrong: pz.Run(wrong)
        yield "folder", lambda wrong=wrong: bank.save(wrong)
    yield "text", lambda: pz.Lens.parse(None)  # type: ignore[arg-type]
    yield "path", lambda: lens.layout_svg(folder / "none" / "layout.svg")
    yield "px_per_mm", lambda: lens.layout_svg(px_per_mm=-1)
    yield "surface", lambda: lens.with_("first", radius_mm=3.0)  # type: ignore[arg-type]
    yield "surface", lambda: lens.with_(True, radius_mm=3.0)
    yield "surface", lambda: lens.with_(radius_mm=3.0)
    yield "glass", lambda: lens.with_(0, glass="N-BK7")  # type: ignore[arg-type]
    yield "radius_mm", lambda: lens.with_(0, radius_mm="a")  # type: ignore[arg-type]
    for values in ("20", ["a"], [[1, 2], [3, 4]], [1j], object()):
        yield "per_mm", lambda values=values: lens.mtf(per_mm=values)
        yield "fields_deg", lambda values=values: lens.spots(values)
        yield "fields_deg", lambda values=values: pz.psf(lens, fields_deg=values)
        yield "wavelengths_um", lambda values=values: pz.psf(lens, wavelengths_um=values)
    yield "lens", lambda: pz.psf("cooke-triplet-nominal")  # type: ignore[arg-type]
    for grid in (64.0, "64", None, True, -4):
        yield "grid", lambda grid=grid: pz.psf(lens, grid=grid)
        yield "pupil_cells", lambda grid=grid: pz.psf(lens, pupil_cells=grid)
    yield "pitch_um", lambda: pz.psf(lens, pitch_um="1")  # type: ignore[arg-type]
    yield "kind", lambda: pz.psf(lens, kind=None)  # type: ignore[arg-type]
    yield "progress", lambda: pz.psf(lens, progress=3)  # type: ignore[arg-type]
    yield "cancel", lambda: pz.psf(lens, cancel=3)  # type: ignore[arg-type]
    yield "variables[0]", lambda: lens.variables("radius")  # type: ignore[arg-type]
    yield "variables[0]", lambda: lens.variables([(0, "radius_mm", 10, 12)])  # type: ignore[list-item]
    yield "variables[0]", lambda: lens.variables([pz.Variable(0, "radius_mm", 12.0, 10.0)])
    yield "variables[0].min", lambda: lens.variables([pz.Variable(0, "radius_mm", None, 10.0)])  # type: ignore[arg-type]
    for efl in ("hold", 3.0, None, True):
        yield "efl", lambda efl=efl: lens.variables(efl=efl)
    yield "goal", lambda: lens.optimize(goal=[1])  # type: ignore[arg-type]
    yield "values", lambda: pz.PsfBank.of(np.ones((3, 32, 32)), pitch_um=1, field_radius_mm=[0])
    yield "channels[0]", lambda: pz.PsfBank.of(np.ones((1, 1, 32, 32)), pitch_um=1, field_radius_mm=[0], channels=["r"])  # type: ignore[list-item]
    yield "pitch_um", lambda: pz.PsfBank.of(np.ones((1, 1, 32, 32)), pitch_um=mapping, field_radius_mm=[0])  # type: ignore[arg-type]
    yield "fields", lambda: bank.picture_png(fields=2.5)  # type: ignore[arg-type]
    yield "psfs", lambda: pz.Camera(lens, psfs=bank)  # type: ignore[arg-type]
    yield "restore", lambda: pz.Camera(lens, restore="yes")  # type: ignore[arg-type]
    yield "electrons", lambda: sensor.expose("light")
    yield "time_s", lambda: sensor.expose(light, time_s="1")  # type: ignore[arg-type]
    yield "wavelengths_um", lambda: pz.Glass("N-BK7").index(["a"])
    yield "glasses[0]", lambda: pz.Glass("N-BK7", glasses=[3])  # type: ignore[list-item]
    yield "name", lambda: pz.Glass(5)  # type: ignore[arg-type]
    yield "psfs", lambda: pz.render(light, "psf", pixel_um=5)  # type: ignore[arg-type]
    yield "picture", lambda: pz.render("photo.png", bank, pixel_um=5)
    yield "pixel_um", lambda: pz.render(light, bank, pixel_um="5")  # type: ignore[arg-type]
    yield "request", lambda: pz.jobs.run("lens-show", [1])  # type: ignore[arg-type]
    yield "request", lambda: pz.jobs.run("lens-tolerance", {"lens": "cooke-triplet-nominal", "trials": NAN})
    yield "request", lambda: pz.jobs.run("lens-show", {"lens": object()})
    yield "threads", lambda: pz.set_threads(-1)
    yield "threads", lambda: pz.set_threads("a")  # type: ignore[arg-type]
    yield "name", lambda: pz.Weights.built_in("any-lens")


def test_wrong_arguments_are_named(triplet: pz.Lens, tmp_path: Path) -> None:
    for number, (key, call) in enumerate(_calls(triplet, tmp_path)):
        with pytest.raises(pz.InputError) as caught:
            call()
        error = caught.value
        assert error.place.key == key and error.message and error.hint, (number, key, error)
    assert list(tmp_path.iterdir()) == []


def test_a_warning_shows_the_line_of_the_caller(tmp_path: Path) -> None:
    text = pz.Lens.load("cooke-triplet-nominal").to_toml()
    lens = pz.Lens.parse(text)
    with pytest.warns(pz.PetzvalWarning) as found:
        # More fields than the grid has light for.
        pz.jobs.run("psf", {"lens": {"toml": lens.to_toml()}, "grid": 16, "pitch_um": 1.0, "fields": 2, "out": tmp_path / "psf"})
    assert found and all(warning.filename == __file__ for warning in found)


def test_numbers_of_numpy_are_numbers(triplet: pz.Lens) -> None:
    by_numpy = pz.psf(triplet, grid=np.int64(16), pitch_um=np.float32(4.0), fields_deg=np.float32(5), pupil_cells=np.uint8(16))
    assert np.array_equal(by_numpy.values, pz.psf(triplet, grid=16, pitch_um=4.0, fields_deg=[5.0], pupil_cells=16).values)
    assert triplet.with_(np.int32(0), radius_mm=np.float64(12.0)).surfaces[0].radius_mm == 12.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pz.set_threads(np.int64(0))
