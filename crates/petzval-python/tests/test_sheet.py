import math
from pathlib import Path

import pytest

import petzval as pz


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sensor") / "captures"
    pz.jobs.run("sensor-capture", {"sensor": "imx249-calibrated", "out": folder, "gains": [1], "size": [64, 64], "seed": 5})
    return folder


@pytest.fixture(scope="module")
def sheet(captures: Path) -> pz.Sheet:
    return pz.characterize(captures)


def test_figures_are_those_of_the_job(sheet: pz.Sheet, captures: Path) -> None:
    found = pz.jobs.run("sensor-characterize", {"dir": captures})["characterization"]
    assert sheet.characterization == found
    gain = sheet["K"]
    green = next(channel for channel in found["gains"][0]["channels"] if channel["colour"] == "green")
    row = next(row for row in green["figures"] if row["name"] == "K")
    best = row.get("corrected", row["value"])
    assert (gain.colour, gain.unit, gain.linear_gain) == ("green", row["unit"], 1.0)
    assert (gain.value, gain.standard_error) == (best["value"], best["standard_error"])
    # The sensor that was captured has this gain, within four standard errors.
    sensor = pz.jobs.run("sensor-show", {"sensor": "imx249-calibrated"})["sensor"]
    assert gain.value == pytest.approx(sensor["gain_dn_per_e"], abs=4 * gain.standard_error)


def test_rows_have_every_figure_of_every_colour(sheet: pz.Sheet) -> None:
    assert {row["colour"] for row in sheet.rows} == {"red", "green", "blue"}
    assert len(sheet.rows) == len(sheet.figures) == 3 * len(sheet)
    assert "K" in sheet and "no such" not in sheet and set(sheet) >= {"K", "sigma_d"}
    unresolved = [figure for figure in sheet.figures if math.isnan(figure.value)]
    assert all(figure.not_resolved for figure in unresolved)
    assert sheet.figure("K", colour="red").value == pytest.approx(sheet["K"].value, rel=0.2)
    pandas = pytest.importorskip("pandas")
    frame = sheet.to_frame()
    assert isinstance(frame, pandas.DataFrame) and len(frame) == len(sheet.rows)
    assert set(frame.columns) >= {"section", "name", "value", "standard_error", "unit", "meaning"}


def test_the_page_the_plots_and_the_sensor_are_kept(sheet: pz.Sheet, tmp_path: Path) -> None:
    page = sheet.save_report(tmp_path / "sheet.html").read_text()
    assert "photon" in page and page.startswith("<!DOCTYPE html>")
    assert sheet.plots["photon-transfer"].startswith("<svg")
    shown = sheet._repr_html_()
    assert "<svg" in shown and "system gain" in shown
    files = sheet.save(tmp_path / "all")
    assert {"results.json", "report.html", "sensor.toml"} <= {path.name for path in files}
    assert (tmp_path / "all" / "sensor.toml").read_text() == sheet.to_toml()
    with pytest.raises(pz.InputError, match="exists already"):
        sheet.save(tmp_path / "all")


def test_wrong_names_and_folders_are_refused(sheet: pz.Sheet, tmp_path: Path) -> None:
    with pytest.raises(pz.InputError, match="sigma_d"):
        sheet["sigma_dd"]
    with pytest.raises(pz.InputError, match="gains and colours are 1 blue"):
        sheet.figure("K", linear_gain=2.0)
    with pytest.raises(pz.InputError):
        sheet.save_report(tmp_path / "none" / "sheet.html")
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(pz.InputError):
            pz.characterize(folder)
    with pytest.raises(pz.InputError, match="pixel_um"):
        pz.characterize(tmp_path, pixel_um=-1.0)
    with pytest.raises(pz.InputError, match="`Sheet.save`"):
        pz.characterize(tmp_path, out="x")
