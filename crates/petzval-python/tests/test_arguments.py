"""What a newcomer gets wrong: the error names the argument, whatever type its value has."""

import copy
import pickle
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
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
    yield "tensors['a']", lambda: pz.Weights({"a": "b"})  # type: ignore[dict-item]
    yield from _calls_of_sensors(sensor)
    yield from _calls_of_frames()
    yield from _calls_of_renderers(lens, sensor, bank)
    yield from _calls_of_cameras(lens, sensor)
    for wrong in (3, None, "a\udcff"):
        yield "text", lambda wrong=wrong: pz.Lens.parse(wrong)
        yield "text", lambda wrong=wrong: pz.Sensor.parse(wrong)
        yield "text", lambda wrong=wrong: pz.Isp.parse(wrong)
        yield "path", lambda wrong=wrong: pz.read_picture(wrong)
    yield "name", lambda: pz.Lens.load("none.toml")
    yield "name", lambda: pz.Sensor.load("none.toml")
    yield "name", lambda: pz.jobs.schema(3)  # type: ignore[arg-type]
    yield "path_mm", lambda: pz.Glass("N-BK7").transmission([0.5], path_mm="a")  # type: ignore[arg-type]
    space = lens.variables()
    yield "lens", lambda: space.coordinates_of("a")  # type: ignore[arg-type]
    yield "x", lambda: space.lens_at("a")
    yield "x", lambda: space.penalty(space.start + 0j)
    yield "DesignSpace", lambda: pz.DesignSpace(3)  # type: ignore[arg-type]


def _calls_of_sensors(sensor: pz.Sensor) -> Iterator[tuple[str, Callable[[], Any]]]:
    for gain in (-1, 0, NAN, "a", None):
        yield "linear_gain", lambda gain=gain: sensor.white_level_dn(gain)
        yield "linear_gain", lambda gain=gain: sensor.light_capacity_e(linear_gain=gain)
        yield "linear_gain", lambda gain=gain: pz.Wiener.of_exposure(sensor, white_e=9000, linear_gain=gain)
    for time in (-5, NAN, "a"):
        yield "time_s", lambda time=time: sensor.light_capacity_e(time_s=time)
    for size in (5, (5,), "ab", (1, 2, 3)):
        yield "size", lambda size=size: sensor.dark(size=size)
        yield "size", lambda size=size: sensor.fixed_pattern(size)
    yield "path", lambda: sensor.save(3)  # type: ignore[arg-type]
    yield "values", lambda: sensor.with_(full_well_e=NAN)
    yield "mode", lambda: sensor.expose_with_derivative([[1.0]], "x")  # type: ignore[arg-type]
    yield "row", lambda: pz.LinearIsp(sensor, white_e=9000, row=1.5)  # type: ignore[arg-type]
    yield "white_e", lambda: pz.LinearIsp(sensor, white_e=None)  # type: ignore[arg-type]
    yield "raw", lambda: pz.LinearIsp(sensor, white_e=9000).develop("a")


def _calls_of_frames() -> Iterator[tuple[str, Callable[[], Any]]]:
    info = pz.FrameInfo(bits=12, cfa="RGGB", black_level_dn=64, noise=(1e-4, 1e-6), response=(0.5, 1.0, 0.7))
    raw, isp = np.full((16, 16), 100), pz.Isp.load()
    masked = np.ma.masked_array(raw, mask=raw > 0)
    for numbers in (masked, raw + 0j, raw > 3, raw[None], None, "a"):
        yield "values", lambda numbers=numbers: pz.RawFrame(numbers, info)
        if not isinstance(numbers, str):
            yield "raw", lambda numbers=numbers: pz.develop(numbers, info=info)
    for about in ({"bits": 12}, None, "a"):
        yield "info", lambda about=about: pz.RawFrame(raw, about)
        yield "info", lambda about=about: pz.RawFrame.like(about)
    yield "bits", lambda: pz.RawFrame(raw, pz.FrameInfo(bits="12", cfa="RGGB"))  # type: ignore[arg-type]
    yield "cfa", lambda: pz.RawFrame(raw, pz.FrameInfo(bits=12, cfa=3))  # type: ignore[arg-type]
    yield "auto_balance", lambda: pz.RawFrame(raw, pz.FrameInfo(bits=12, cfa="RGGB", auto_balance=1))  # type: ignore[arg-type]
    for key, knots in (("companding", ([0, 1],)), ("companding", 3), ("companding[0]", (0, 1)), ("companding[0][1]", ([0, "a"], [0, 4]))):
        yield key, lambda knots=knots: pz.RawFrame(raw, pz.FrameInfo(bits=12, cfa="RGGB", companding=knots))
    for bits in (8.0, "8", True):
        yield "bits", lambda bits=bits: pz.develop(raw, info=info, bits=bits)
    yield "sharpen_amount", lambda: isp.with_(sharpen_amount="big")  # type: ignore[arg-type]
    yield "demosaic", lambda: isp.with_(demosaic=3)  # type: ignore[arg-type]
    yield "changes", lambda: isp.with_(3)  # type: ignore[arg-type]
    yield "gain_ev", lambda: isp.at_gain("a")  # type: ignore[arg-type]


def _calls_of_renderers(lens: pz.Lens, sensor: pz.Sensor, bank: pz.PsfBank) -> Iterator[tuple[str, Callable[[], Any]]]:
    light = np.ones((64, 64, 3))
    for kind in (np.uint16, np.int64, bool, object, complex):
        yield "picture", lambda kind=kind: pz.render(light.astype(kind), bank, pixel_um=4.0)
        yield "picture", lambda kind=kind: pz.restore(light.astype(kind), bank, pixel_um=4.0)
    yield "distortion", lambda: pz.render(light, bank, pixel_um=4.0, distortion="a")  # type: ignore[arg-type]
    yield "wiener", lambda: pz.restore(light, bank, pixel_um=4.0, wiener=0.01)  # type: ignore[arg-type]
    yield "noise", lambda: pz.restore(light, bank, pixel_um=4.0, wiener=pz.Wiener(noise="a"))
    yield "patches", lambda: pz.render(light, bank, pixel_um=4.0, patches="ab")  # type: ignore[arg-type]
    yield "blend_error", lambda: pz.patches_for(bank, (64, 64), pixel_um=4.0, blend_error="a")  # type: ignore[arg-type]
    yield "psfs.field_radius_mm", lambda: pz.render(light, pz.FieldPsfs(bank.values, ["a"], 2.0), pixel_um=4.0)
    yield "psfs", lambda: pz.render(light, pz.FieldPsfs(np.ones((16, 16)), [0.0], 2.0), pixel_um=4.0)
    yield "ideal_mm", lambda: pz.Distortion([0, 1], [0, "a"])
    yield "lens", lambda: pz.Distortion.of("a", sensor)  # type: ignore[arg-type]
    yield "sensor", lambda: pz.Distortion.of(lens, "a")  # type: ignore[arg-type]
    yield "sensor", lambda: pz.Wiener.of_exposure("a", white_e=9000)  # type: ignore[arg-type]
    # A bank that the renderer would refuse is neither made nor saved.
    yield "field_radius_mm", lambda: pz.PsfBank.of(np.ones((3, 1, 16, 16)), pitch_um=1, field_radius_mm=[2, 1, 0])
    turned = replace(bank, chief_mm=bank.chief_mm[::-1])
    yield "field_radius_mm", lambda: turned.save("none")


def _calls_of_cameras(lens: pz.Lens, sensor: pz.Sensor) -> Iterator[tuple[str, Callable[[], Any]]]:
    scene = np.ones((8, 8, 3))
    yield "noise", lambda: pz.Camera(lens, sensor, noise="no")  # type: ignore[arg-type]
    yield "distortion", lambda: pz.Camera(lens, sensor, distortion=0)  # type: ignore[arg-type]
    yield "white_e", lambda: pz.Camera(lens, sensor, exposure_e=5, white_e=7)
    yield "no_noise", lambda: pz.Camera(lens, sensor, no_noise=True)
    yield "sensor", lambda: pz.Camera(lens, pz.Sensor)  # type: ignore[arg-type]
    yield "name", lambda: pz.Camera(lens, sensor).take(scene, name=3)  # type: ignore[arg-type]
    yield "picture", lambda: pz.Camera(lens, sensor).take("a\udcff.png")
    yield "Frame", lambda: pz.Frames(3)  # type: ignore[arg-type]


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
    raw, known = np.full((16, 16), 100), {"cfa": "RGGB", "black_level_dn": np.float32(64), "black_dn": 64, "white_dn": 4000, "noise": (1e-4, 1e-6), "response": (0.5, 1, 0.7)}
    assert pz.RawFrame(raw, pz.FrameInfo(bits=np.int64(12), auto_balance=np.False_, **known)).bits == 12
    assert pz.LinearIsp("imx249-fitted", white_e=9000, row=np.int64(1)) == pz.LinearIsp("imx249-fitted", white_e=9000, row=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pz.set_threads(np.int64(0))


def test_what_is_equal_by_its_text_is_equal(triplet: pz.Lens, tmp_path: Path) -> None:
    isp, glass = pz.Isp.load("quality"), pz.Glass("N-BK7")
    for one, other in ((triplet, triplet.focused()), (isp, isp.with_(sharpen_amount=0.7)), (glass, pz.Glass("N-SF6"))):
        again = pickle.loads(pickle.dumps(one))
        assert again == one and hash(again) == hash(one) and one != other and one != 3
    triplet.save(tmp_path / "lens.toml")
    isp.save(tmp_path / "isp.toml")
    assert pz.Lens.load(tmp_path / "lens.toml") == triplet and pz.Isp.load(tmp_path / "isp.toml") == isp


def test_what_holds_arrays_is_equal_to_itself(triplet: pz.Lens) -> None:
    bank = pz.psf(triplet, fields_deg=[0, 7], grid=16, pitch_um=8, pupil_cells=16)
    for one, other in ((bank, replace(bank)), (triplet.spots(), triplet.spots()), (triplet.mtf(20), triplet.mtf(20)), (triplet.wavefront(), triplet.wavefront())):
        assert one == one and one != other and one in [other, one] and hash(one) == hash(one)


def test_an_error_keeps_its_fields_in_a_pickle() -> None:
    with pytest.raises(pz.InputError) as caught:
        pz.Sensor.load("none.toml")
    error = caught.value
    assert error.place.path == Path("none.toml") and error.hint and str(error).count(error.hint) == 1
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert vars(again) == vars(error) and str(again) == str(error)
