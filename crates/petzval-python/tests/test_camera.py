import copy
import pickle
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz

NAN = float("nan")


@pytest.fixture(scope="module")
def camera(triplet: pz.Lens) -> pz.Camera:
    return pz.Camera(triplet, "imx249-calibrated", exposure_e=16_000, isp="quality", restore=True, place="centre", size=(64, 96), distortion=False)


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    y, x = np.mgrid[0:64, 0:96]
    picture = np.stack([0.5 + 0.3 * np.sin(0.3 * x), 0.4 + 0.2 * np.cos(0.2 * y), 0.3 + 0 * x], axis=-1)
    return (255 * picture).astype(np.uint8)


@pytest.fixture(scope="module")
def frames(camera: pz.Camera, scene: np.ndarray) -> pz.Frames:
    return camera.take(scene, seed=3)


def test_frames_have_every_stage_as_an_array(frames: pz.Frames) -> None:
    assert frames.raw.shape == (64, 96) and frames.raw.dtype == np.uint16
    assert frames.restored is not None and frames.finished is not None
    for picture in (frames.irradiance, frames.illumination, frames.developed, frames.restored):
        assert picture.shape == (64, 96, 3) and picture.dtype == np.float32
    for encoded in (frames.finished, frames.picture):
        assert encoded.shape == (64, 96, 3) and encoded.dtype == np.uint8
    assert frames.facts["white_e"] == 16_000 and frames.facts["bits"] == 12
    assert frames.facts["saturated_share"] == 0.0
    # Development undoes exposure and shading: the picture is the light on the pixels over that of its place.
    light = frames.irradiance / frames.illumination
    assert np.abs(frames.developed - light)[4:-4, 4:-4].mean() < 0.02
    assert np.abs(frames.restored - frames.developed).max() > 1e-3


def test_facts_are_the_given_numbers_and_frames_say_that_they_cannot_be_pickled(triplet: pz.Lens) -> None:
    taken = pz.Camera(triplet, "imx249-fitted", size=(16, 16), time_s=0.005, gain=1.1).take(np.full((16, 16, 3), 0.5))
    assert taken.facts["time_s"] == 0.005 and taken.facts["linear_gain"] == 1.1
    with pytest.raises(TypeError, match="take its arrays"):
        pickle.dumps(taken)
    assert np.array_equal(copy.deepcopy(taken).raw, taken.raw)


def test_a_path_and_an_array_are_the_same_picture(camera: pz.Camera, frames: pz.Frames, scene: np.ndarray, tmp_path: Path) -> None:
    saved = frames.save(tmp_path / "a", raw_format="npy", picture_format="npy")
    assert set(saved) == {"raw", "sidecar", "calibration", "developed", "isp"}
    np.testing.assert_array_equal(np.load(saved["raw"]), frames.raw)
    assert frames.restored is not None
    np.testing.assert_array_equal(np.load(saved["developed"]).transpose(1, 2, 0), frames.restored)
    with pytest.raises(pz.InputError, match="exists already"):
        frames.save(tmp_path / "a", raw_format="npy")
    frames.save(tmp_path / "a", raw_format="npy", overwrite=True)

    # The picture of the ISP as a file is a photograph as well as its array.
    by_array = camera.take(frames.finished, seed=1)
    by_path = camera.take(saved["isp"], seed=1)
    np.testing.assert_array_equal(by_array.raw, by_path.raw)
    light = pz.read_picture(saved["isp"])
    np.testing.assert_array_equal(camera.take(light, seed=1).raw, by_path.raw)
    strided = np.asfortranarray(light.astype(np.float64))
    np.testing.assert_array_equal(camera.take(strided, seed=1).raw, by_path.raw)


def test_the_camera_takes_what_the_job_takes(camera: pz.Camera, frames: pz.Frames, tmp_path: Path) -> None:
    photo = frames.save(tmp_path / "photo")["isp"]
    request = {**camera.request, "images": [photo], "seed": 7, "raw_format": "npy", "picture_format": "npy", "out": tmp_path / "job"}
    pz.jobs.run("simulate", request)
    taken = camera.take(photo, seed=7)
    np.testing.assert_array_equal(np.load(tmp_path / "job" / f"{photo.stem}-raw.npy"), taken.raw)
    assert taken.restored is not None
    developed = np.load(tmp_path / "job" / f"{photo.stem}-developed.npy").transpose(1, 2, 0)
    np.testing.assert_array_equal(developed, taken.restored)


def test_psfs_are_traced_once_and_a_camera_goes_to_other_processes(camera: pz.Camera, frames: pz.Frames, scene: np.ndarray) -> None:
    again = pickle.loads(pickle.dumps(camera))
    start = time.perf_counter()
    first = again.take(scene, seed=3)
    opened = time.perf_counter()
    second = again.take(scene, seed=3)
    np.testing.assert_array_equal(first.raw, frames.raw)
    np.testing.assert_array_equal(second.raw, frames.raw)
    assert time.perf_counter() - opened < 0.9 * (opened - start)


def test_noise_follows_the_seed(camera: pz.Camera, frames: pz.Frames, scene: np.ndarray) -> None:
    again, other = camera.take(scene, seed=3), camera.take(scene, seed=4)
    np.testing.assert_array_equal(again.raw, frames.raw)
    assert (other.raw != frames.raw).mean() > 0.5
    first, second = camera.take_all([scene, scene], seed=3, names=["one", "two"])
    assert (first.name, second.name) == ("one", "two")
    np.testing.assert_array_equal(first.raw, frames.raw)
    assert (second.raw != frames.raw).mean() > 0.5
    quiet = pz.Camera("cooke-triplet-nominal", "imx249-calibrated", exposure_e=16_000, size=(64, 96), distortion=False, noise=False)
    still = [quiet.take(scene, seed=seed) for seed in (1, 2)]
    np.testing.assert_array_equal(still[0].raw, still[1].raw)
    assert still[0].finished is None and still[0].restored is None


def test_a_sensor_may_be_its_text(scene: np.ndarray, tmp_path: Path) -> None:
    class Own:
        def to_toml(self) -> str:
            return (tmp_path / "own" / "sensor.toml").read_text()

    pz.jobs.run("init", {"out": tmp_path / "own"})
    taken = pz.Camera(sensor=Own(), size=(32, 32), distortion=False).take(scene)
    assert taken.raw.shape == (32, 32)


def test_a_saturated_frame_is_a_warning(scene: np.ndarray) -> None:
    bright = pz.Camera(exposure_e=100_000, size=(32, 32), distortion=False)
    with pytest.warns(pz.PetzvalWarning, match="`white_e` [0-9]+"):
        frames = bright.take(np.full((32, 32, 3), 0.9))
    assert frames.facts["saturated_share"] > 0.5


@pytest.mark.parametrize(
    ("picture", "says"),
    [
        (np.zeros((4, 4)), r"of shape \[4, 4\]"),
        (np.zeros((4, 4, 4)), r"of shape \[4, 4, 4\]"),
        (np.zeros((0, 4, 3)), r"of shape \[0, 4, 3\]"),
        (np.zeros((4, 4, 3), dtype=np.int64), "of type int64"),
        (np.zeros((4, 4, 3), dtype=complex), "of type complex128"),
        (np.full((4, 4, 3), NAN), r"picture\[0, 0, 0\] nan"),
        (np.full((4, 4, 3), -0.5), r"picture\[0, 0, 0\] -0.5"),
        (np.full((4, 4, 3), 1e300), r"picture\[0, 0, 0\] 1e\+300"),
        ([[[0.0], [0.0, 1.0]]], "picture"),
        (None, "picture"),
        ("no-such.png", "no-such.png"),
        ("scene:no-such", "no-such"),
    ],
)
def test_what_is_no_picture_is_refused(camera: pz.Camera, picture: Any, says: str) -> None:
    with pytest.raises(pz.InputError, match=says) as caught:
        camera.take(picture)
    assert caught.value.hint


def test_wrong_cameras_are_refused(triplet: pz.Lens, scene: np.ndarray, tmp_path: Path) -> None:
    keys: list[dict[str, Any]] = [
        {"lens": "no-such-lens"},
        {"sensor": "no-such-sensor"},
        {"isp": "no-such-isp"},
        {"exposure_e": -1.0},
        {"exposure_e": 0.0},
        {"time_s": -1.0},
        {"gain": 0.0},
        {"size": (1, 1)},
        {"size": (10**6, 10**6)},
        {"samples": 0},
        {"samples": 9},
        {"place": "left"},
        {"restore": -1.0},
        {"psfs": tmp_path},
        {"no_such_key": 1},
        {"sensor": "imx250-mono", "isp": "quality"},
    ]
    for key in keys:
        with pytest.raises(pz.InputError):
            pz.Camera(**({"lens": triplet} | key)).take(scene)
    with pytest.raises(ValueError):
        pz.Camera(exposure_e=NAN).take(scene)
    with pytest.raises(pz.InputError, match="seed"):
        pz.Camera(seed=1)
    with pytest.raises(pz.InputError, match="one name for each array"):
        pz.Camera().take_all([scene, scene], names=["a"])
    with pytest.raises(pz.InputError):
        pz.read_picture(tmp_path / "none.png")
    assert list(tmp_path.iterdir()) == []


def test_no_warning_comes_of_a_plain_picture(camera: pz.Camera, scene: np.ndarray) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        camera.take(scene)
