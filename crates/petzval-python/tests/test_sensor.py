import pickle

import numpy as np
import pytest

import petzval as pz

NAN = float("nan")


@pytest.fixture(scope="module")
def sensor() -> pz.Sensor:
    return pz.Sensor.load("imx249-fitted")


@pytest.fixture(scope="module")
def uneven(sensor: pz.Sensor) -> pz.Sensor:
    """A specimen whose pixels differ."""
    pattern = {"specimen": 5, "dsnu_pixel_e": 20.0, "prnu_pixel_percent": 2.0, "prnu_row_percent": 1.0, "hot_pixel_share": 0.01}
    return sensor.with_(nonuniformity={**pattern, "hot_pixel_e_per_s": 4000.0})


def test_its_numbers_are_those_of_its_file(sensor: pz.Sensor) -> None:
    assert sensor.shape == (1200, 1920) and sensor.cfa == "RGGB" and sensor.bits == 12
    assert (sensor.gain_dn_per_e, sensor.full_well_e, sensor.pixel_um) == (0.14, 33723.0, 5.86)
    assert sensor.relative_qe == (0.82, 1.0, 1.25) and sensor.electronics == "before_adc"
    assert sensor.response.shape == (2, 2, 3) and sensor.response[1, 1].tolist() == [0.0, 0.0, 1.25]
    assert sensor.white_level_dn() == 4095.0
    # (W - BL - mu_el) / K - mu_r, less the dark current.
    capacity_e = (4095 - 119 - 1.15) / 0.14 - 3.25 - 2.5
    assert sensor.light_capacity_e(time_s=0.1) == pytest.approx(capacity_e, abs=1e-6)
    assert "imx" in repr(sensor).lower() and "33723" in sensor._repr_html_()


def test_saved_and_loaded_it_is_the_same(uneven: pz.Sensor, tmp_path) -> None:
    uneven.save(tmp_path / "sensor.toml")
    again = pz.Sensor.load(tmp_path / "sensor.toml")
    assert again == uneven and hash(again) == hash(uneven)
    assert pickle.loads(pickle.dumps(uneven)) == uneven
    assert pz.Sensor.parse(uneven.to_toml()).nonuniformity == uneven.nonuniformity


def test_a_changed_sensor_is_another_one(sensor: pz.Sensor) -> None:
    other = sensor.with_(full_well_e=1000, cfa="RG/GB", gain_steps=[1.0, 2.0], name="small", bits=np.int64(10))
    assert (other.full_well_e, other.cfa, other.gain_steps, other.name, other.bits) == (1000.0, "RGGB", (1.0, 2.0), "small", 10)
    assert sensor.full_well_e == 33723.0 and other != sensor
    assert other.expose(np.full((4, 4), 1e6), linear_gain=2.0).max() <= 1023


def test_noise_belongs_to_seed_frame_and_pixel(uneven: pz.Sensor) -> None:
    electrons = np.random.default_rng(0).uniform(0.0, 3000.0, (40, 61))
    whole = uneven.expose(electrons, seed=3, frame=7, time_s=0.02)
    assert whole.dtype == np.uint16 and whole.shape == (40, 61)
    part = uneven.expose(electrons[11:30, 20:51], seed=3, frame=7, time_s=0.02, row=11, column=20)
    np.testing.assert_array_equal(part, whole[11:30, 20:51])
    np.testing.assert_array_equal(uneven.expose(electrons.tolist(), seed=3, frame=7, time_s=0.02), whole)
    np.testing.assert_array_equal(uneven.expose(np.repeat(electrons, 2, 1)[:, ::2], seed=3, frame=7, time_s=0.02), whole)
    for other in ({"seed": 4, "frame": 7}, {"seed": 3, "frame": 8}):
        assert np.mean(uneven.expose(electrons, time_s=0.02, **other) != whole) > 0.8


@pytest.mark.parametrize("electrons", [0.0, 8.0, 900.0, 15000.0])
def test_moments_are_those_of_emva_1288(sensor: pz.Sensor, electrons: float) -> None:
    n, gain, time_s = 400 * 500, 2.0 if electrons < 5000 else 1.0, 0.2
    dn = sensor.expose(np.full((400, 500), electrons), seed=1, time_s=time_s, linear_gain=gain).astype(np.float64)
    rate, scale = electrons + 25.0 * time_s, 0.14 * gain
    mean = scale * (rate + 3.25) + 119.0 + 1.15
    variance = scale**2 * (rate + 4.0**2) + 0.92**2 + 1.0 / 12.0
    # Four standard errors, of a variance for nearly normal noise.
    assert dn.mean() == pytest.approx(mean, abs=4 * np.sqrt(variance / n))
    assert dn.var() == pytest.approx(variance, abs=4 * variance * np.sqrt(2.2 / n))
    noiseless = sensor.mean_dn(np.full((3, 3), electrons), time_s=time_s, linear_gain=gain)
    np.testing.assert_allclose(noiseless, mean, rtol=1e-6)


def test_dark_frames_have_no_light(sensor: pz.Sensor) -> None:
    dark = sensor.dark(seed=2, time_s=1.0, size=(200, 300))
    np.testing.assert_array_equal(dark, sensor.expose(np.zeros((200, 300)), seed=2, time_s=1.0))
    assert dark.mean() == pytest.approx(119.0 + 1.15 + 0.14 * (25.0 + 3.25), abs=4 * 1.6 / np.sqrt(dark.size))


def test_the_filter_array_samples_coloured_light(sensor: pz.Sensor) -> None:
    light = np.random.default_rng(1).uniform(0.0, 5000.0, (9, 13, 3)).astype(np.float32)
    for cfa in ("RGGB", "GBRG", "WR/GW", "GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG"):
        own = sensor.with_(cfa=cfa)
        tile = own.response
        rows, columns = (3 + np.arange(9)) % tile.shape[0], (8 + np.arange(13)) % tile.shape[1]
        behind = (light * tile[rows[:, None], columns[None, :]]).sum(2)
        coloured, plain = (own.mean_dn(of, row=3, column=8) for of in (light, behind))
        np.testing.assert_allclose(coloured, plain, rtol=1e-5)


def test_the_fixed_pattern_shows_in_the_mean(uneven: pz.Sensor) -> None:
    fixed = uneven.fixed_pattern((30, 40), row=5, column=6)
    assert fixed.offset_e.std() == pytest.approx(20.0, rel=0.1) and (fixed.dark_e_per_s > 0).mean() < 0.05
    mean = uneven.mean_dn(np.full((30, 40), 2000.0), time_s=0.1, row=5, column=6)
    rate = 2000.0 * fixed.response + (25.0 + fixed.dark_e_per_s) * 0.1
    np.testing.assert_allclose(mean, 0.14 * (rate + 3.25 + fixed.offset_e) + 119.0 + 1.15, rtol=1e-5)


def test_the_derivative_is_that_of_differences(uneven: pz.Sensor) -> None:
    electrons = np.random.default_rng(2).uniform(10.0, 20000.0, (8, 9))
    _, slope = uneven.expose_with_derivative(electrons, "off")
    up, down = (uneven.mean_dn(electrons + step) for step in (50.0, -10.0))
    np.testing.assert_allclose(slope, (up - down) / 60.0, rtol=2e-4)
    full = uneven.expose_with_derivative(np.full((2, 2), 1e6), "straight_through")[1]
    assert np.all(full == 0.0)
    assert np.all(uneven.expose_with_derivative(electrons, "exact")[1] == 0.0)


def test_a_defect_of_a_file_has_its_place(sensor: pz.Sensor, tmp_path) -> None:
    lines = sensor.to_toml().splitlines()
    line = next(i for i, text in enumerate(lines) if text.startswith("full_well_e"))
    lines[line] = "full_well_e = -5.0"
    path = tmp_path / "broken.toml"
    path.write_text("\n".join(lines))
    with pytest.raises(pz.InputError, match="full well") as caught:
        pz.Sensor.load(path)
    place = caught.value.place
    assert (place.path, place.line, place.key) == (path, line + 1, "full_well_e")
    with pytest.raises(pz.InputError, match=f"line {line + 1}"):
        pz.Sensor.parse("\n".join(lines))


def test_wrong_arguments_are_exceptions(sensor: pz.Sensor, tmp_path) -> None:
    flat = np.ones((4, 4))
    for bad in (np.ones(4), np.ones((4, 4, 2)), np.ones((4, 4, 4)), np.ones((1, 4, 4, 3)), np.ones((0, 4)), flat * NAN, -flat, flat * np.inf, flat * 1e40):
        with np.errstate(over="ignore"), pytest.raises(pz.InputError, match="electrons|size"):
            sensor.expose(bad)
    for bad in ("x", None, [[1.0], [1.0, 2.0]], object()):
        with pytest.raises((TypeError, ValueError)):
            sensor.expose(bad)
    for setting in (
        {"seed": -1},
        {"seed": 1.5},
        {"seed": 2**64},
        {"frame": -1},
        {"row": 1197},
        {"column": 10**9},
        {"row": -1},
        {"time_s": -1.0},
        {"time_s": NAN},
        {"linear_gain": 0.0},
        {"linear_gain": NAN},
    ):
        with pytest.raises(pz.InputError, match=next(iter(setting))):
            sensor.expose(flat, **setting)
    with pytest.raises(pz.InputError, match="linear_gain") as caught:
        sensor.with_(gain_steps=[1.0, 4.0]).expose(flat, linear_gain=2.9)
    assert "4" in caught.value.hint and caught.value.place.value == "2.9"
    with pytest.raises(pz.InputError, match="electrons"):
        sensor.expose(-flat)
    with pytest.raises(pz.InputError, match="mode"):
        sensor.expose_with_derivative(flat, "poisson")  # type: ignore[arg-type]
    for values in ({"full_well": 1.0}, {"full_well_e": NAN}, {"full_well_e": "x"}, {"cfa": "RGXB"}, {"bits": 99}, {"name": object()}, {"name": None}):
        with pytest.raises(pz.InputError):
            sensor.with_(**values)
    for name in ("no-such-sensor", "", tmp_path, "a\0b", tmp_path / "none.toml"):
        with pytest.raises(pz.InputError):
            pz.Sensor.load(name)
    for text in ("", "x", "name = 1", "\0"):
        with pytest.raises(pz.InputError):
            pz.Sensor.parse(text)
    with pytest.raises(pz.InputError):
        sensor.save(tmp_path / "none" / "sensor.toml")
    for size in ((0, 4), (-1, 4), (1201, 4), (10**12, 10**12)):
        with pytest.raises(pz.InputError):
            sensor.fixed_pattern(size)
        with pytest.raises(pz.InputError):
            sensor.dark(size=size)
    assert list(tmp_path.iterdir()) == []
