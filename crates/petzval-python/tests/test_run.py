import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz


@pytest.fixture(scope="module")
def run(run_folder: Path) -> pz.Run:
    return pz.Run(run_folder)


def test_figures_are_those_of_the_folder(run: pz.Run, run_folder: Path) -> None:
    assert run.cameras == ("nominal", "spot-optimised", "end-to-end") and run.is_finished
    kept = json.loads((run_folder / "metrics.json").read_text())
    assert run.metrics == kept
    assert [row["camera"] for row in run.rows] == list(run.cameras)
    assert [row["psnr_db"] for row in run.rows] == [row["psnr_db"] for row in kept["rows"]]
    assert len(run.picture_rows) == 3 * len(kept["rows"][0]["pictures"])
    assert run.facts["record"]["version"] and "cooke" in run.name.lower()
    events = list(run.events())
    lines = (run_folder / "events.jsonl").read_text().splitlines()
    assert len(events) == len(lines) and events[0]["losses"] == json.loads(lines[0])["losses"]


def test_lenses_weights_and_pictures_are_found(run: pz.Run, run_folder: Path) -> None:
    assert set(run.lenses) == set(run.cameras)
    for row in run.rows:
        assert run.lens(row["camera"]).efl_mm == pytest.approx(row["efl_mm"], rel=1e-9)
    assert run.lens().efl_mm == pytest.approx(run.lens("nominal").efl_mm, rel=1e-6)
    assert run.weights["nominal"] == run_folder / "cameras" / "nominal" / "network.safetensors"
    truths = [picture for picture in run.pictures if picture.state == "truth"]
    outputs = [picture for picture in run.pictures if (picture.camera, picture.state) == ("end-to-end", "output")]
    assert [p.index for p in truths] == [p.index for p in outputs] == [0, 1, 2]
    truth, output = truths[0].light(), outputs[0].light()
    assert truth.shape == output.shape == (64, 64, 3)
    shown = run._repr_html_()
    assert "psnr_db" in shown and "<svg" in shown


def test_a_camera_takes_what_apply_takes(run: pz.Run, run_folder: Path, tmp_path: Path) -> None:
    camera = run.camera("end-to-end")
    scene = np.random.default_rng(1).random((60, 96, 3), dtype=np.float32)
    scene = np.repeat(np.repeat(scene, 20, 0), 20, 1)
    quick = camera.take(scene, seed=2)
    assert quick.picture.shape == (*camera.size, 3) and quick.read == {}
    assert 0 <= quick.picture.min() and quick.picture.max() <= 1
    np.testing.assert_array_equal(quick.picture, quick.shown)
    # The job takes the same picture from a file.
    light = run.pictures[0].path
    request = {"run": run_folder, "images": [light], "cameras": ["end-to-end"], "seed": 2, "out": tmp_path}
    applied = pz.read_picture(pz.jobs.run("apply", request)["pictures"][0]["picture"])
    # Its file has 8 bits.
    assert np.abs(camera.take(light, seed=2).shown - _encoded(applied)).max() < 0.51 / 255
    assert camera.lens.to_toml() == run.lens("end-to-end").to_toml()

    raw = np.full((64, 64), 1000, dtype=np.uint16)
    developed = camera.develop(raw)
    assert developed.picture.shape == (64, 64, 3)
    wrong: list[Any] = [raw[0], raw.astype(float), raw.astype(np.int64) - 2000, np.zeros((0, 4), np.uint16), np.zeros((4000, 64), np.uint16)]
    for bad in [*wrong, "none.tiff", None]:
        with pytest.raises(pz.InputError):
            camera.develop(bad)
    with pytest.raises(pz.InputError, match="no such place"):
        camera.take(scene, place="left")  # type: ignore[arg-type]
    with pytest.raises(pz.InputError, match=r"picture of shape"):
        camera.take(np.zeros((4, 4)))


def _encoded(light: np.ndarray) -> np.ndarray:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def test_the_report_is_written_again(run_folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run_folder, copy)
    (copy / "report.html").unlink()
    page = pz.Run(copy).report()
    assert page == copy / "report.html" and "nominal" in page.read_text()


def test_what_is_no_run_is_refused(run: pz.Run, run_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(pz.InputError, match="it has no config.toml"):
        pz.Run(tmp_path)
    with pytest.raises(pz.InputError, match="no such folder"):
        pz.Run(tmp_path / "none")
    for call in (run.lens, run.camera):
        with pytest.raises(pz.InputError, match="the run has nominal, spot-optimised, end-to-end"):
            call("no such")
    with pytest.raises(pz.InputError, match="no detector"):
        pz.Detector.load(run)
    copy = tmp_path / "copy"
    shutil.copytree(run_folder, copy)
    (copy / "metrics.json").unlink()
    shutil.rmtree(copy / "cameras" / "end-to-end")
    unfinished = pz.Run(copy)
    assert unfinished.cameras == ("nominal", "spot-optimised") and not unfinished.is_finished
    with pytest.raises(pz.InputError, match="not finished"):
        _ = unfinished.metrics
    assert "<svg" in unfinished._repr_html_()
    lens = copy / "cameras" / "nominal" / "lens.toml"
    lens.write_text(lens.read_text() + "# changed\n")
    with pytest.raises(pz.InputError, match="lens.toml"):
        unfinished.camera("nominal")
    with pytest.raises(pz.InputError, match="lens.toml"):
        unfinished.lens("nominal")
    with pytest.raises(pz.InputError, match="lens.toml"):
        _ = unfinished.weights
    with pytest.warns(pz.PetzvalWarning, match="lens.toml"):
        meant = pz.Run(copy, accept_changed=["cameras/nominal/lens.toml"])
        assert meant.lens("nominal").surfaces == pz.Run(run_folder).lens("nominal").surfaces


def test_edited_figures_are_refused(run_folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run_folder, copy)
    figures = copy / "metrics.json"
    figures.write_text(figures.read_text().replace('"seed": 1', '"seed": 2', 1) + " ")
    with pytest.raises(pz.InputError, match="metrics.json is not as the run wrote it"):
        _ = pz.Run(copy).metrics
    with pytest.warns(pz.PetzvalWarning, match="metrics.json"):
        assert pz.Run(copy, accept_changed=["metrics.json"]).metrics["rows"]


def test_files_that_may_differ_are_in_the_run(run_folder: Path) -> None:
    one = "cameras/nominal/lens.toml"
    assert pz.Run(run_folder, accept_changed=one).accept_changed == (one,)
    for wrong in ("lens.toml", [one, "cameras/nominal/lens.tom"]):
        with pytest.raises(pz.InputError, match="the run has no such file"):
            pz.Run(run_folder, accept_changed=wrong)
        with pytest.raises(pz.InputError, match="the run has no such file"):
            pz.Run(run_folder).camera("nominal", accept_changed=wrong)


def test_the_hint_of_a_changed_file_is_python(run_folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run_folder, copy)
    lens = copy / "cameras" / "nominal" / "lens.toml"
    lens.write_text(lens.read_text() + "\n")
    with pytest.raises(pz.InputError) as refused:
        pz.Run(copy).lens("nominal")
    assert '`accept_changed=["cameras/nominal/lens.toml"]`' in refused.value.hint


def test_a_notebook_shows_a_run_with_an_edited_lens(run_folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run_folder, copy)
    last = pz.Run(copy).cameras[-1]
    lens = copy / "cameras" / last / "lens.toml"
    lens.write_text(lens.read_text() + "\n")
    shown = pz.Run(copy)._repr_html_()
    assert "seed 1" in shown and f"cameras/{last}/lens.toml is not as the run wrote it" in shown


def test_steps_of_a_shortened_file_are_refused(run_folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run_folder, copy)
    events = copy / "events.jsonl"
    lines = events.read_text().splitlines(keepends=True)
    events.write_text("".join(lines[: len(lines) // 2]))
    with pytest.raises(pz.InputError, match="events.jsonl is not as the run wrote it"):
        list(pz.Run(copy).events())
    with pytest.warns(pz.PetzvalWarning, match="events.jsonl"):
        assert len(list(pz.Run(copy, accept_changed="events.jsonl").events())) == len(lines) // 2


def test_a_file_is_no_run(tmp_path: Path) -> None:
    lens = tmp_path / "lens.zmx"
    lens.write_text("NAME lens\n")
    with pytest.raises(pz.InputError, match="it is a file"):
        pz.Run(lens)
