import warnings
from pathlib import Path

import numpy as np
import pytest

import petzval as pz

TINY = """
name = "tiny lights"
task = "traffic-light"
[psf]
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
kind = "geometric"
[street]
windows = 2
held_out = 1
samples = 1
[training]
steps = 1
batch = 1
crop = 96
[scoring]
crop = 96
scores = ["ap50"]
[[variant]]
name = "nominal"
[[variant.stage]]
moves = ["network"]
"""


@pytest.fixture(scope="module")
def lights(tmp_path_factory: pytest.TempPathFactory) -> pz.Run:
    folder = tmp_path_factory.mktemp("lights") / "run"
    with warnings.catch_warnings():
        # PSFs of so small a grid lose light.
        warnings.simplefilter("ignore", pz.PetzvalWarning)
        pz.jobs.run("design", {"run": {"new": {"experiment": {"toml": TINY}, "out": folder}}})
    return pz.Run(folder)


def test_objects_are_those_of_the_job(lights: pz.Run, tmp_path: Path) -> None:
    detector = pz.Detector.load(lights)
    picture = next(picture for picture in lights.pictures if picture.state == "truth")
    found = detector.find(picture.path)
    request = {"detector": {"run": {"run": lights.path}}, "images": [picture.path], "least_score": 0.0, "out": tmp_path}
    wanted = pz.jobs.run("detect", request)["pictures"][0]["found"]
    assert len(found) == len(wanted) > 3
    assert set(found.classes) <= set(detector.classes)
    np.testing.assert_allclose(found.boxes_px, [row["bbox"] for row in wanted], atol=1e-3)
    np.testing.assert_allclose(found.scores, [row["score"] for row in wanted], atol=1e-6)
    assert list(found.classes) == [row["class"] for row in wanted]
    assert np.all(np.diff(found.scores) <= 0)
    np.testing.assert_allclose(found.corners_px[:, 2:] - found.corners_px[:, :2], found.boxes_px[:, 2:], atol=1e-3)
    assert found.rows[0]["class"] == found.classes[0] and found.rows[0]["left_px"] == found.boxes_px[0, 0]
    # Sure objects are the first of all; an array is the same picture as its file.
    least = float(found.scores[2])
    sure = pz.Detector.load(lights.path, "nominal").find(picture.light(), least_score=least)
    assert len(sure) == int((found.scores >= least).sum())
    np.testing.assert_allclose(sure.boxes_px, found.boxes_px[: len(sure)], atol=1e-3)
    assert detector.find(picture.path, least_score=1.0).boxes_px.shape == (0, 4)
    for score in (-0.1, 1.5, float("nan")):
        with pytest.raises(pz.InputError, match="least_score"):
            detector.find(picture.path, least_score=score)
    with pytest.raises(pz.InputError, match="of shape"):
        detector.find(np.zeros((4, 4)))
    with pytest.raises(pz.InputError, match="finished are nominal"):
        pz.Detector.load(lights, "no such")


def test_a_wrong_detector_is_refused(tmp_path: Path) -> None:
    with pytest.raises(pz.InputError, match="not a run folder"):
        pz.Detector.load(tmp_path)
    file = tmp_path / "weights.safetensors"
    file.write_bytes(b"no weights")
    with pytest.raises(pz.InputError, match="weights.safetensors"):
        pz.Detector.from_weights(file)
    with pytest.raises(pz.InputError, match="classes"):
        pz.Detector.from_weights(file, classes=0)
    with pytest.raises(pz.InputError, match="backbone"):
        pz.Detector.from_weights(file, backbone="resnet")  # type: ignore[arg-type]
