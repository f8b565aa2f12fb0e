"""Banks of PSFs as files, and banks from arrays of a user: the jobs of Petzval take both."""

import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz

NAN = float("nan")


@pytest.fixture(scope="module")
def bank(triplet: pz.Lens) -> pz.PsfBank:
    return pz.psf(triplet, fields_deg=[0.0, 7.0, 14.0], wavelengths_um=[0.486, 0.55, 0.62], grid=32, pitch_um=4.0)


def _same(a: pz.PsfBank, b: pz.PsfBank, tolerance: float = 0.0) -> None:
    np.testing.assert_allclose(a.values, b.values, rtol=tolerance, atol=tolerance * 1e-2)
    for name in ("illumination", "fields_deg", "wavelengths_um", "captured", "field_radius_mm", "chief_mm"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for name in ("pitch_um", "kind", "pupil_cells", "pupil_error", "lens", "channels", "source", "rotationally_symmetric"):
        assert getattr(a, name) == getattr(b, name), name
    assert a.image_scale_mm == b.image_scale_mm or (np.isnan(a.image_scale_mm) and np.isnan(b.image_scale_mm))


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 0.0), ("float32", 1e-7), (np.float16, 2e-3)])
def test_a_bank_that_is_saved_is_loaded(bank: pz.PsfBank, tmp_path: Path, dtype: Any, tolerance: float) -> None:
    bank.save(tmp_path / "new" / "bank", dtype=dtype)
    assert np.load(tmp_path / "new" / "bank" / "psf.npy").dtype == np.dtype(dtype)
    for path in ("new/bank", "new/bank/psf.json"):
        _same(pz.PsfBank.load(tmp_path / path), bank, tolerance)
    assert sorted(p.name for p in (tmp_path / "new" / "bank").iterdir()) == ["illumination.npy", "psf.json", "psf.npy"]


def test_arrays_of_numpy_in_any_order_are_loaded(bank: pz.PsfBank, tmp_path: Path) -> None:
    bank.save(tmp_path)
    for values in (np.asfortranarray(bank.values), bank.values.astype(">f8"), np.asfortranarray(bank.values.astype(">f4"))):
        np.save(tmp_path / "psf.npy", values)
        np.testing.assert_allclose(pz.PsfBank.load(tmp_path).values, bank.values, rtol=1e-7, atol=1e-12)


def test_what_the_command_writes_is_loaded_and_simulated(tmp_path: Path) -> None:
    out = tmp_path / "psf"
    request = {"lens": "cooke-triplet-nominal", "out": out, "fields": 3, "grid": 32, "pitch_um": 4.0, "pupil_cells": 32, "pupil_error": 2.0}
    axes = pz.jobs.run("psf", request)["axes"]
    loaded = pz.PsfBank.load(out)
    np.testing.assert_array_equal(loaded.values, np.load(out / "psf.npy"))
    np.testing.assert_array_equal(loaded.fields_deg, axes["field_deg"])
    assert (loaded.channels, loaded.lens) == (("red", "green", "blue"), axes["lens"])
    # Saved once more, it is the same.
    loaded.save(tmp_path / "again")
    _same(pz.PsfBank.load(tmp_path / "again"), loaded)


def _png(path: Path, gray: np.ndarray) -> Path:
    """Writes a picture of one plane."""
    rows = b"".join(b"\0" + row.tobytes() for row in gray.astype(np.uint8))

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", gray.shape[1], gray.shape[0], 8, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
    return path


def test_an_own_bank_takes_the_pictures_of_a_simulation(tmp_path: Path) -> None:
    # A bright square, spread by round Gaussians on a monochrome sensor.
    square = np.zeros((80, 80))
    square[33:48, 33:48] = 255
    photo = _png(tmp_path / "square.png", square)

    def second_moment_um2(sigma_um: float) -> float:
        y = np.linspace(-72, 72, 49)
        psf = 100.0 * np.exp(-(y[:, None] ** 2 + y[None, :] ** 2) / (2 * sigma_um**2))
        values = np.broadcast_to(psf, (2, 1, 49, 49))
        own = pz.PsfBank.of(values, pitch_um=3.0, field_radius_mm=[0.0, 7.0], source="a Gaussian")
        np.testing.assert_allclose(own.values.sum((2, 3)), 1.0, rtol=1e-12)
        folder = tmp_path / str(sigma_um)
        own.save(folder / "bank")
        request = {"images": [photo], "psfs": folder / "bank", "sensor": "imx250-mono", "place": "centre", "size": [80, 80]}
        pz.jobs.run("simulate", {**request, "no_noise": True, "picture_format": "npy", "out": folder})
        light = np.load(folder / "square-developed.npy")[1].astype(float)
        y, x = np.indices(light.shape)
        light /= light.sum()
        variance = (light * (x - (light * x).sum()) ** 2).sum() + (light * (y - (light * y).sum()) ** 2).sum()
        return float(variance) * 3.45**2

    # Variances of a convolution add.
    added = second_moment_um2(15.0) - second_moment_um2(5.0)
    assert added == pytest.approx(2 * (15.0**2 - 5.0**2), rel=0.03)


def test_a_bank_of_arrays_keeps_what_is_said_of_it(tmp_path: Path) -> None:
    values = np.random.default_rng(1).uniform(size=(2, 3, 5, 5))
    light = [[1.0, 1.0, 1.0], [0.5, 0.6, 0.7]]
    own = pz.PsfBank.of(
        values.astype(np.float32),
        pitch_um=2.0,
        field_radius_mm=[0, 3],
        illumination=light,
        fields_deg=(0.0, 10.0),
        channels=("blue", "green", "red"),
        kind="measured",
    )
    own.save(tmp_path)
    _same(pz.PsfBank.load(tmp_path), own)
    np.testing.assert_array_equal(own.illumination, light)
    assert np.isnan(own.wavelengths_um).all() and np.isnan(own.captured).all()
    axes = json.loads((tmp_path / "psf.json").read_text())
    assert axes["channels"] == ["blue", "green", "red"] and "wavelengths_um" not in axes and "captured" not in axes


def test_defects_of_arrays_name_the_argument(bank: pz.PsfBank, tmp_path: Path) -> None:
    good: dict[str, Any] = {"values": np.ones((2, 3, 4, 4)), "pitch_um": 1.0, "field_radius_mm": [0.0, 1.0]}
    negative, dark, not_finite = np.ones((2, 3, 4, 4)), np.ones((2, 3, 4, 4)), np.ones((2, 3, 4, 4))
    negative[1, 2, 3, 0], dark[1, 0], not_finite[0, 1, 2, 2] = -1e-3, 0.0, NAN
    for name, value, says in (
        ("values", np.ones((2, 3, 4)), r"\[field, wavelength, y, x\]"),
        ("values", np.ones((2, 3, 4, 5)), "not as many rows as columns"),
        ("values", np.ones((0, 3, 4, 4)), "shape"),
        ("values", negative, "row 3, column 0"),
        ("values", dark, "field 1, wavelength 0 sums to 0"),
        ("values", not_finite, "NaN"),
        ("values", "x", "give numbers"),
        ("pitch_um", 0.0, "not between"),
        ("pitch_um", -1.0, "not between"),
        ("pitch_um", NAN, "not finite"),
        ("field_radius_mm", [0.0], "1 numbers, and the array has 2 fields"),
        ("field_radius_mm", [0.0, -1.0], "no distance"),
        ("field_radius_mm", [0.0, NAN], "not finite"),
        ("illumination", np.ones((3, 2)), "give"),
        ("illumination", -np.ones((2, 3)), "numbers from 0"),
        ("wavelengths_um", [550.0, 1.0, 1.0], "in um"),
        ("wavelengths_um", [0.5], "1 entries"),
        ("fields_deg", [0.0, 200.0], "below 180"),
    ):
        with pytest.raises(pz.InputError, match=says) as caught:
            pz.PsfBank.of(**(good | {name: value}))
        assert caught.value.place.key == name, (name, says)
    for wrong in ({"pitch_um": None}, {"pitch_um": "1"}, {"channels": ["red", "green", "infrared"]}, {"kind": "rays"}):
        with pytest.raises(pz.InputError):
            pz.PsfBank.of(**(good | wrong))
    with pytest.raises(pz.InputError, match="numpy.float16, numpy.float32"):
        bank.save(tmp_path / "new", dtype=np.int32)
    with pytest.raises(pz.InputError, match="sums to"):
        replace(bank, values=2.0 * bank.values).save(tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_defects_of_files_name_file_and_key(bank: pz.PsfBank, tmp_path: Path) -> None:
    bank.save(tmp_path)
    good = (tmp_path / "psf.json").read_text()
    for key, value, says in (
        ("version", 7, "younger"),
        ("pitch_um", -4.0, "not between"),
        ("field_radius_mm", [0.0], "1 numbers"),
        ("row_axis", "x", "turn the rows"),
        ("gird", 3, "no such key"),
    ):
        (tmp_path / "psf.json").write_text(json.dumps(json.loads(good) | {key: value}))
        with pytest.raises(pz.InputError, match=says) as caught:
            pz.PsfBank.load(tmp_path)
        assert (caught.value.place.key, caught.value.place.path) == (key, tmp_path / "psf.json")
    (tmp_path / "psf.json").write_text(good)
    np.save(tmp_path / "psf.npy", bank.values[:, :2])
    with pytest.raises(pz.InputError, match=r"illumination\.npy.*shape \[3, 3\]"):
        pz.PsfBank.load(tmp_path)
    np.save(tmp_path / "psf.npy", np.ones(3, dtype=int))
    with pytest.raises(pz.InputError, match=r"psf\.npy.*type"):
        pz.PsfBank.load(tmp_path)
    for nothing in (tmp_path / "none", tmp_path / "psf.npy"):
        with pytest.raises(pz.InputError):
            pz.PsfBank.load(nothing)
    # Four wavelengths are a bank, and no camera takes them.
    four = pz.PsfBank.of(np.ones((1, 4, 4, 4)), pitch_um=4.0, field_radius_mm=[0.0])
    four.save(tmp_path / "four")
    photo = _png(tmp_path / "gray.png", np.full((8, 8), 90))
    with pytest.raises(pz.InputError, match="three colours"):
        pz.jobs.run("simulate", {"images": [photo], "psfs": tmp_path / "four", "out": tmp_path / "s"})
