"""Development: equal to the jobs to the bit, with derivatives like differences."""

import copy
import pickle
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz
from petzval import jobs

NAN = float("nan")
SHAPE = (32, 48)


def scene() -> np.ndarray:
    """Linear light ``[y, x, 3]``: slopes, stripes, a disc and a dark half."""
    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]] / np.array(SHAPE)[:, None, None]
    stripes = 0.5 + 0.5 * np.sin(20 * y + 12 * x)
    disc = np.where(np.hypot(y - 0.5, x - 0.6) < 0.2, 0.7, 0.0)
    red, green, blue = 0.1 + 0.5 * x + 0.2 * stripes, 0.2 + 0.3 * y + 0.4 * disc, 0.15 + 0.5 * (1 - x) + 0.2 * disc
    return np.where(x < 0.4, 0.2, 1.0)[..., None] * np.stack([red, green, blue], axis=-1)


def mosaic() -> np.ndarray:
    """Digital numbers of 12 bits, ``[y, x]``, with noise; the first pixel is green."""
    light = scene()
    planes = np.array([[1, 0], [2, 1]])[np.indices(SHAPE)[0] % 2, np.indices(SHAPE)[1] % 2]
    own = np.take_along_axis(light, planes[..., None], axis=-1)[..., 0] * np.array([0.6, 1.0, 0.7])[planes]
    noise = np.random.default_rng(5).normal(size=SHAPE) * np.sqrt(own / 8000 + 1e-6)
    return np.clip(np.round(64 + 3000 * (own + noise)), 0, 4095).astype(np.uint16)


INFO = pz.FrameInfo(
    bits=12,
    cfa="GRBG",
    black_dn=64.0,
    white_dn=3064.0,
    response=(0.6, 1.0, 0.7),
    noise=(1 / 8000, 1e-6),
    gain_ev=1.5,
    colour_matrix=[[1.6, -0.4, -0.2], [-0.2, 1.5, -0.3], [0.0, -0.6, 1.6]],
    shading=1.0 - 0.2 * np.hypot(*np.mgrid[-1:1:40j, -1:1:40j]) ** 2 * np.ones((3, 1, 1)),
    warp=np.stack(np.mgrid[-1:1:5j, -1:1:5j]),
)

CALIBRATION = f"""
black_dn = 64.0
white_dn = 3064.0
response = [0.6, 1.0, 0.7]
gain_ev = 1.5
colour_matrix = [[1.6, -0.4, -0.2], [-0.2, 1.5, -0.3], [0.0, -0.6, 1.6]]
noise = {{ shot = {1 / 8000}, read = 1e-6 }}

[shading]
rows = 40
cols = 40
planes = {np.asarray(INFO.shading).reshape(3, -1).tolist()}

[warp]
rows = 5
cols = 5
planes = {np.asarray(INFO.warp).reshape(2, -1).tolist()}
"""


@pytest.fixture
def raw_file(tmp_path: Path) -> Path:
    path = tmp_path / "frame.npy"
    np.save(path, mosaic())
    (tmp_path / "frame.npy.toml").write_text('bits = 12\ncfa = "GRBG"\ncalibration = "camera.toml"\n')
    (tmp_path / "camera.toml").write_text(CALIBRATION)
    return path


def png(path: Path) -> np.ndarray:
    """The values of a PNG file of three colours, ``[y, x, 3]``."""
    data, at, packed = path.read_bytes(), 8, b""
    width, height, bits = struct.unpack(">IIB", data[16:25])
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        packed += data[at + 8 : at + 8 + length] if kind == b"IDAT" else b""
        at += 12 + length
    pixel = 3 * bits // 8
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * pixel)
    above, out = np.zeros(width * pixel, int), []
    for kind, *row in rows.astype(int):
        line = np.array(row)
        for i in range(len(line)):
            a, b, c = line[i - pixel] if i >= pixel else 0, above[i], above[i - pixel] if i >= pixel else 0
            nearest = min((a, b, c), key=lambda v, p=a + b - c: abs(p - v))
            line[i] = (line[i] + (0, a, b, (a + b) // 2, nearest)[kind]) % 256
        above = line
        out.append(line)
    return np.array(out, np.uint8).reshape(-1).view(">u1" if bits == 8 else ">u2").reshape(height, width, 3)


@pytest.mark.parametrize(("preset", "bits"), [("neutral", 8), ("quality", 16), ("automotive", 8)])
def test_pictures_are_those_of_the_job(raw_file: Path, preset: str, bits: int) -> None:
    request = {"raws": [raw_file], "isp": preset, "bits": bits, "set": ["sharpen.amount=1.1"], "out": raw_file.parent / "out"}
    wanted = png(Path(jobs.run("isp-develop", request)["pictures"][0]["picture"]))
    for given in ({"raw": raw_file}, {"raw": mosaic(), "info": INFO}, {"raw": mosaic().astype(float) + 0.3, "info": INFO}):
        picture = pz.develop(**given, preset=preset, bits=bits, sharpen_amount=1.1)
        assert picture.dtype == (np.uint8 if bits == 8 else np.uint16) and picture.shape == (*SHAPE, 3)
        np.testing.assert_array_equal(picture, wanted)
    assert wanted.std() > 0.1 * wanted.max()


@pytest.mark.parametrize("preset", ["neutral", "low-light"])
def test_parameters_are_those_of_the_job(preset: str) -> None:
    isp = pz.Isp.load(preset)
    for gain_ev in (0.0, 2.5):
        shown = jobs.run("isp-show", {"isp": preset, "gain_ev": gain_ev})["parameters"]
        assert [vars(p) for p in isp.at_gain(gain_ev).parameters.values()] == shown
        np.testing.assert_array_equal(isp.values(gain_ev), [row["value"] for row in shown])
    strength = isp.parameters["sharpen.amount"]
    assert strength.min <= strength.value <= strength.max and strength.sentence
    assert isp["sharpen.amount"] == strength.value
    assert "sharpen.amount" in isp._repr_html_() and "Isp" in repr(isp)


def test_changed_values_hold_at_every_gain_and_are_saved(tmp_path: Path) -> None:
    isp = pz.Isp.load("quality")
    changed = isp.with_({"bayer_denoise.strength": 0.25}, sharpen_amount=1.5, black_level_offset_dn=[1.0, 0.0, 0.0, -1.0])
    for gain_ev in (0.0, 4.0):
        assert changed.at_gain(gain_ev)["bayer_denoise.strength"] == 0.25
    assert isp.at_gain(4.0)["bayer_denoise.strength"] == 0.7 and isp["sharpen.amount"] == 0.6
    assert changed["black_level.offset_dn[3]"] == -1.0 and changed.demosaic == "menon"
    # What the knots of the preset set beside it stays as it was.
    assert changed.at_gain(4.0)["chroma_denoise.strength"] == isp.at_gain(4.0)["chroma_denoise.strength"]
    assert isp.with_(demosaic="malvar", domain="linear").domain == "linear"

    changed.save(tmp_path / "mine.toml")
    frame = pz.RawFrame(mosaic(), INFO)
    for again in (pz.Isp.load(tmp_path / "mine.toml"), pz.Isp.parse(changed.to_toml()), pickle.loads(pickle.dumps(changed))):
        for gain_ev in (0.0, 1.0, 4.0):
            np.testing.assert_array_equal(again.values(gain_ev), changed.values(gain_ev))
        np.testing.assert_array_equal(again.develop(frame), changed.develop(frame))
        assert again.to_toml() == changed.to_toml()


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"sensor": "imx249-fitted", "exposure_s": 0.01, "shading": np.ones((3, 5, 5)), "warp": np.zeros((2, 3, 3)), "colour_matrix": np.eye(3)},
        {"companding": ([0, 1000, 4095], [0, 1000, 60_000]), "white_dn": 50_000.0},
    ],
)
def test_a_frame_can_be_pickled_and_copied(changes: dict[str, Any]) -> None:
    known = {"bits": 12, "cfa": "GRBG", "black_level_dn": 64.0, "noise": (1e-4, 1e-6), "white_dn": 4000.0, "response": (0.5, 1.0, 0.7)}
    info = pz.FrameInfo(**(known | changes))
    frames = pz.RawFrame(mosaic(), info), pz.RawFrame.like(info)
    for frame in frames:
        for again in (pickle.loads(pickle.dumps(frame)), copy.copy(frame), copy.deepcopy(frame)):
            assert again._facts == frame._facts and np.array_equal(again.linear_dn, frame.linear_dn)
    assert np.array_equal(pz.develop(pickle.loads(pickle.dumps(frames[0]))), pz.develop(frames[0]))


def test_what_a_sensor_knows_need_not_be_stated() -> None:
    frame = pz.RawFrame(mosaic(), pz.FrameInfo(sensor="imx249-calibrated", white_e=9000, linear_gain=2.0))
    assert frame.bits == 12 and frame.shape == SHAPE and frame.gain_ev == pytest.approx(1.0)
    assert frame.noise[0] == pytest.approx(1 / 9000, rel=1e-5)
    again = pz.FrameInfo(bits=12, cfa=frame.cfa, black_dn=frame.black_dn, white_dn=frame.white_dn, response=frame.response,
                         saturation=frame.saturation, noise=frame.noise, gain_ev=frame.gain_ev)
    np.testing.assert_array_equal(pz.develop(frame), pz.develop(mosaic(), info=again))
    np.testing.assert_array_equal(frame.linear_dn, mosaic())


def test_the_smooth_form_is_close_to_the_one_in_whole_numbers() -> None:
    frame, isp = pz.RawFrame(mosaic(), INFO), pz.Isp.load("automotive")
    smooth, fixed = isp.smooth(frame), isp.develop(frame, bits=16) / 65535
    assert smooth.shape == (*SHAPE, 3) and smooth.dtype == np.float32
    # A step of the root of light is 2^-13; decisions at single pixels may differ.
    assert 10 * np.log10(1 / np.mean((np.clip(smooth, 0, 1) - fixed) ** 2)) > 52
    np.testing.assert_array_equal(isp.smooth(mosaic(), INFO), smooth)
    np.testing.assert_array_equal(isp.smooth(frame, values=isp.values(frame.gain_ev)), smooth)


def test_derivatives_are_those_of_differences() -> None:
    frame = pz.RawFrame(mosaic(), INFO)
    isp = pz.Isp.load().with_(gain_stops=0.4, tone_map_strength=0.6, purple_fringe_strength=0.5, output_contrast=1.1)
    values = isp.values()
    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    # Smooth weights: differences of the sum are then well above the rounding of 32 bits.
    weights = (np.sin(0.37 * x + 0.23 * y) + 0.2)[..., None] * np.array([1.0, 0.8, 1.2])
    by_raw, by_values = isp.pull_back(frame, weights)

    def loss(raw: Any, values: np.ndarray) -> float:
        return float((isp.smooth(raw, INFO, values=values).astype(float) * weights).sum())

    for name in ("gain.stops", "white_balance.red", "tone_map.strength", "gamma.exponent", "sharpen.amount", "output.contrast"):
        i = list(isp.parameters).index(name)
        step = np.zeros(len(values))
        step[i] = 2e-3
        difference = (loss(mosaic(), values + step) - loss(mosaic(), values - step)) / 4e-3
        # Pixels that cross a bound between the two differences leave a few per cent.
        assert by_values[i] == pytest.approx(difference, rel=0.03, abs=0.01), name
        assert difference != 0.0
    error = size = 0.0
    for i in range(0, SHAPE[0] * SHAPE[1], 67):
        pixel = np.zeros(SHAPE)
        pixel.flat[i] = 1.0
        difference = (loss(mosaic() + pixel, values) - loss(mosaic() - pixel, values)) / 2
        error, size = error + (by_raw.flat[i] - difference) ** 2, size + difference**2
    assert 0 < error < 0.01 * size


def linear(**other: Any) -> pz.LinearIsp:
    return pz.LinearIsp("imx249-fitted", white_e=9000, exposure_s=0.005, linear_gain=2.0, **other)


@pytest.mark.parametrize("domain", ["linear", "stabilised"])
def test_linear_development_gives_light_and_derivatives(domain: Any) -> None:
    isp = linear(demosaic="malvar", domain=domain, colour_matrix=[[1.4, -0.2, -0.2], [-0.1, 1.2, -0.1], [0.0, -0.3, 1.3]])
    raw = mosaic().astype(np.float32)
    shade = np.clip(1.0 - 0.3 * scene(), 0.1, 1.0).astype(np.float32)
    weights = np.cos(0.3 * np.arange(raw.size * 3)).reshape(*SHAPE, 3)
    picture = isp.develop(raw, shade)
    assert picture.shape == (*SHAPE, 3) and picture.dtype == np.float32
    by_raw, by_shade = isp.pull_back(raw, weights, shade)

    def loss(raw: np.ndarray, shade: np.ndarray) -> float:
        return float((isp.develop(raw, shade).astype(float) * weights).sum())

    random = np.random.default_rng(2)
    along, across = random.normal(size=SHAPE), random.normal(size=(*SHAPE, 3))
    difference = (loss(raw + 0.5 * along, shade) - loss(raw - 0.5 * along, shade)) / 1.0
    assert (by_raw * along).sum() == pytest.approx(difference, rel=2e-3)
    difference = (loss(raw, shade + 1e-3 * across) - loss(raw, shade - 1e-3 * across)) / 2e-3
    assert (by_shade * across).sum() == pytest.approx(difference, rel=2e-3)
    again = pickle.loads(pickle.dumps(isp))
    np.testing.assert_array_equal(again.develop(raw, shade), picture)


def test_linear_development_of_flat_light_is_flat() -> None:
    frame = pz.RawFrame(mosaic(), pz.FrameInfo(sensor="imx249-fitted", white_e=9000, exposure_s=0.005, linear_gain=2.0))
    planes = np.indices(SHAPE).sum(0) % 2
    answers = np.array(frame.response)
    # RGGB: red at even rows and columns, blue at odd ones.
    own = np.where(planes == 1, answers[1], np.where(np.indices(SHAPE)[0] % 2 == 0, answers[0], answers[2]))
    if frame.cfa.replace("/", "") != "RGGB":
        pytest.skip("the sensor has another array")
    raw = frame.black_dn + 0.25 * own * (frame.white_dn - frame.black_dn)
    np.testing.assert_allclose(linear().develop(raw), 0.25, atol=1e-5)


def test_wrong_arguments_are_exceptions(raw_file: Path) -> None:
    raw, isp, frame = mosaic(), pz.Isp.load(), pz.RawFrame(mosaic(), INFO)
    values = isp.values()
    weights = np.ones((*SHAPE, 3))

    def info(**changes: Any) -> pz.FrameInfo:
        return pz.FrameInfo(**{**vars(INFO), **changes})

    calls = {
        "no info": lambda: pz.develop(raw),
        "info twice": lambda: pz.develop(frame, info=INFO),
        "no file": lambda: pz.develop("none.npy"),
        "negative": lambda: pz.develop(raw.astype(int) - 2000, info=INFO),
        "not finite": lambda: pz.develop(raw * NAN, info=INFO),
        "too large": lambda: pz.develop(raw + 4096, info=INFO),
        "odd side": lambda: pz.develop(raw[:-1], info=INFO),
        "small": lambda: pz.develop(raw[:8, :8], info=INFO),
        "empty": lambda: pz.develop(raw[:0], info=INFO),
        "three axes": lambda: pz.develop(raw[None], info=INFO),
        "no pixels": lambda: isp.develop(pz.RawFrame.like(INFO)),
        "smooth without pixels": lambda: isp.smooth(pz.RawFrame.like(INFO)),
        "text": lambda: pz.develop([["a"]], info=INFO),
        "bits of the picture": lambda: pz.develop(frame, bits=9),
        "negative bits": lambda: pz.develop(frame, bits=-8),
        "preset": lambda: pz.develop(frame, preset="qualiti"),
        "preset text": lambda: pz.Isp.parse("[settings.sharpen]\namount = 99.0"),
        "preset key": lambda: pz.Isp.parse("[settings.sharpen]\namonut = 1.0"),
        "parameter": lambda: pz.develop(frame, sharpen_amonut=1.0),
        "range": lambda: isp.with_(sharpen_amount=99.0),
        "nan": lambda: isp.with_(sharpen_amount=NAN),
        "word": lambda: isp.with_(sharpen_amount="much"),
        "count": lambda: isp.with_(black_level_offset_dn=[1.0, 2.0]),
        "list": lambda: isp.with_(sharpen_amount=[1.0, 2.0]),
        "demosaic": lambda: isp.with_(demosaic="best"),  # type: ignore[arg-type]
        "domain": lambda: isp.with_(domain="log"),  # type: ignore[arg-type]
        "gain": lambda: isp.at_gain(NAN),
        "gain of values": lambda: isp.values(float("inf")),
        "save": lambda: isp.save(raw_file.parent / "none" / "x.toml"),
        "values": lambda: isp.smooth(frame, values=values[:-1]),
        "values range": lambda: isp.smooth(frame, values=values + 1e3),
        "values nan": lambda: isp.smooth(frame, values=values * NAN),
        "smooth nan": lambda: isp.smooth(raw * NAN, INFO),
        "smooth shape": lambda: isp.smooth(raw[None], INFO),
        "smooth side": lambda: isp.smooth(raw[:, :-1], INFO),
        "smooth estimate": lambda: isp.smooth(raw, info(auto_balance=True)),
        "cotangent": lambda: isp.pull_back(frame, weights[:-1]),
        "cotangent nan": lambda: isp.pull_back(frame, weights * NAN),
        "array": lambda: pz.develop(raw, info=info(cfa="RGBB")),
        "array name": lambda: pz.develop(raw, info=info(cfa="bayer")),
        "no bits": lambda: pz.develop(raw, info=info(bits=None)),
        "bits": lambda: pz.develop(raw, info=info(bits=40)),
        "black": lambda: pz.develop(raw, info=info(black_dn=-1.0)),
        "black nan": lambda: pz.develop(raw, info=info(black_dn=NAN)),
        "white": lambda: pz.develop(raw, info=info(white_dn=10.0)),
        "response": lambda: pz.develop(raw, info=info(response=(1.0, 1.0))),
        "response range": lambda: pz.develop(raw, info=info(response=(0.0, 1.0, 1.0))),
        "noise": lambda: pz.develop(raw, info=info(noise=(-1.0, 0.0))),
        "matrix": lambda: pz.develop(raw, info=info(colour_matrix=np.eye(2))),
        "shading": lambda: pz.develop(raw, info=info(shading=np.zeros((3, 9, 9)))),
        "shading planes": lambda: pz.develop(raw, info=info(shading=np.ones((2, 9, 9)))),
        "warp": lambda: pz.develop(raw, info=info(warp=np.ones((9, 9)))),
        "companding": lambda: pz.develop(raw, info=info(companding=([], []))),
        "companding order": lambda: pz.develop(raw, info=info(companding=([0, 5, 3], [0, 5, 9]))),
        "sensor": lambda: pz.develop(raw, info=info(sensor="imx9999")),
        "electrons": lambda: pz.develop(raw, info=info(white_e=1000.0)),
        "negative electrons": lambda: pz.develop(raw, info=info(sensor="imx249-fitted", white_e=-1.0)),
        "linear sensor": lambda: pz.LinearIsp("imx9999", white_e=1.0),
        "linear electrons": lambda: pz.LinearIsp("imx249-fitted", white_e=0.0),
        "linear time": lambda: pz.LinearIsp("imx249-fitted", white_e=1.0, exposure_s=-1.0),
        "linear row": lambda: pz.LinearIsp("imx249-fitted", white_e=1.0, row=-1),
        "linear floor": lambda: linear(shading_floor=0.0),
        "linear demosaic": lambda: linear(demosaic="best"),
        "linear mono": lambda: pz.LinearIsp("imx250-mono", white_e=9000, demosaic="malvar"),
        "linear nan": lambda: linear().develop(raw * NAN),
        "linear shape": lambda: linear().develop(raw[None]),
        "linear shade": lambda: linear().develop(raw, np.ones(SHAPE)),
        "linear empty": lambda: linear().develop(raw[:0]),
        "linear cotangent": lambda: linear().pull_back(raw, weights[..., :2]),
        "no gradient": lambda: linear(demosaic="rcd").pull_back(raw, weights),
    }
    before, silent = sorted(raw_file.parent.iterdir()), []
    for name, call in calls.items():
        try:
            call()
        except (pz.InputError, TypeError, ValueError, OverflowError) as error:
            assert str(error), name
        else:
            silent.append(name)
    assert silent == []
    assert sorted(raw_file.parent.iterdir()) == before
    with pytest.raises(pz.InputError, match=r"did you mean sharpen\.amount"):
        isp.with_(sharpen_amonut=1.0)
    with pytest.raises(pz.InputError, match="between 0 and 4"):
        isp.with_(sharpen_amount=5.0)
    with pytest.raises(pz.InputError, match="row 3, column 4") as caught:
        wrong = raw.astype(float)
        wrong[3, 4] = NAN
        pz.develop(wrong, info=INFO)
    assert caught.value.place.key == "raw"
