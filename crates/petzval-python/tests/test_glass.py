import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz


def test_the_index_is_that_of_the_catalogue() -> None:
    glass = pz.Glass("N-BK7")
    # Schott: nd 1.51680, Vd 64.17.
    assert (round(glass.nd, 5), round(glass.vd, 2)) == (1.5168, 64.17)
    lines = glass.figures["lines"]
    um = [line["um"] for line in lines]
    np.testing.assert_allclose(glass.index(um), [line["index"] for line in lines], rtol=1e-14)
    assert glass.index(0.5875618) == pytest.approx(glass.nd, abs=1e-12)
    assert glass.index(np.float32([[0.5, 0.6]])).shape == (1, 2)
    low, high = glass.range_um
    assert low < 0.4 < 0.7 < high
    through = glass.transmission([0.55], path_mm=10.0)
    assert 0.99 < through[0] <= 1.0
    np.testing.assert_allclose(glass.transmission([0.4], path_mm=20.0), glass.transmission([0.4], path_mm=10.0) ** 2, rtol=1e-9)


def test_glasses_are_found_by_index_and_abbe_number() -> None:
    found = pz.Glass.find(1.62, 60.3, count=3)
    assert len(found) == 3 and "N-SK16" in {glass.name for glass in found}
    schott = pz.Glass.find(1.5168, 64.17, count=1, maker="schott")[0]
    assert schott.maker.lower() == "schott" and schott.name == "N-BK7"
    assert pickle.loads(pickle.dumps(schott)).nd == schott.nd
    rows = pz.Glass.rows("schott")
    assert len(rows) > 100 and {"name", "maker", "nd", "vd"} <= set(rows[0])


@pytest.mark.parametrize("um", [[0.1], [550.0], [-0.5], [float("nan")], [], "x", [[0.5], [0.5, 0.6]], [1j]])
def test_wrong_wavelengths_are_refused(um: Any) -> None:
    with pytest.raises((pz.InputError, ValueError, TypeError, np.exceptions.ComplexWarning)):
        pz.Glass("N-BK7").index(um)


def test_wrong_glasses_are_refused(tmp_path: Path) -> None:
    with pytest.raises(pz.InputError, match="N-BK7"):
        pz.Glass("N-BK77")
    with pytest.raises(pz.InputError):
        pz.Glass("N-BK7", glasses=[tmp_path / "none.agf"])
    with pytest.raises(pz.InputError, match="nd"):
        pz.Glass.find(0.5, 60.0)
    with pytest.raises(pz.InputError):
        pz.Glass.find(1.5, 60.0, maker="no such maker")
    with pytest.raises(pz.InputError, match="path_mm"):
        pz.Glass("N-BK7").transmission([0.5], path_mm=-1.0)


def test_built_in_lenses_and_sensors_are_listed() -> None:
    lenses, sensors = pz.list_lenses(), pz.list_sensors()
    assert "cooke-triplet-nominal" in {row["name"] for row in lenses}
    assert "imx249-calibrated" in {row["name"] for row in sensors}
    assert all(row["pixel_um"] > 0 for row in sensors)


def test_a_data_set_is_checked_and_converted(tmp_path: Path) -> None:
    from petzval import data

    voc = tmp_path / "voc"
    (voc / "Annotations").mkdir(parents=True)
    (voc / "JPEGImages").mkdir()
    frames = pz.Camera(size=(32, 48), distortion=False).take(np.full((32, 48, 3), 0.4), name="a")
    frames.save(voc / "JPEGImages")
    for path in list((voc / "JPEGImages").iterdir()):
        path.rename(path.with_name("a.png")) if path.name == "a-developed.png" else path.unlink()
    (voc / "Annotations" / "a.xml").write_text(
        "<annotation><filename>a.png</filename><size><width>48</width><height>32</height><depth>3</depth></size>"
        "<object><name>car</name><bndbox><xmin>5</xmin><ymin>6</ymin><xmax>25</xmax><ymax>20</ymax></bndbox></object></annotation>"
    )
    converted = data.convert("voc", voc, tmp_path / "coco")
    assert converted.statistics["images"] == 1 and converted.statistics["boxes"] == 1
    assert converted.linked + converted.copied == 1
    checked = data.check(tmp_path / "coco", out=tmp_path / "page")
    assert checked.annotations == converted.annotations and checked.errors == 0
    assert checked.page is not None and checked.page.is_file()
    with pytest.raises(pz.InputError, match="not empty"):
        data.convert("voc", voc, tmp_path / "coco")
    with pytest.raises(pz.InputError, match="format"):
        data.convert("docx", voc, tmp_path / "new")  # type: ignore[arg-type]
    with pytest.raises(pz.InputError):
        data.check(tmp_path / "none")
