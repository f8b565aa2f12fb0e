import json
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"

pytestmark = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="only beside the sources")


def run_example(name: str, folder: Path) -> str:
    done = subprocess.run([sys.executable, EXAMPLES / name], cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_lens_is_looked_at_and_takes_a_picture(tmp_path: Path) -> None:
    said = run_example("hello_lens.py", tmp_path)
    assert "RMS spot radius" in said and "(240, 320) uint16" in said
    assert (tmp_path / "layout.svg").read_text().startswith("<svg") and any((tmp_path / "shot").iterdir())


def test_tolerances_are_tables(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    said = run_example("tolerances.py", tmp_path)
    assert "50%" in said and "90%" in said and (tmp_path / "worst.toml").is_file()


def test_a_sensor_is_measured(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    assert "system gain" in run_example("emva_sheet.py", tmp_path)
    assert (tmp_path / "sheet.html").is_file() and "gain_dn_per_e" in (tmp_path / "my-sensor.toml").read_text()


def test_psfs_are_labelled_and_kept(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    assert "the same values: True" in run_example("psfs_as_xarray.py", tmp_path)


def test_figures_of_a_run_are_shown(tmp_path: Path, run_folder: Path) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib")
    shutil.copytree(run_folder, tmp_path / "run")
    assert "end-to-end" in run_example("run_metrics.py", tmp_path)
    assert (tmp_path / "losses.png").is_file()


def test_a_notebook_has_the_cells_of_its_script_and_their_output() -> None:
    # Make them again by `python examples/write_notebooks.py` where this fails.
    maker = runpy.run_path(str(EXAMPLES / "write_notebooks.py"))
    names = maker["names"]()
    assert names == sorted(path.stem for path in EXAMPLES.glob("*.ipynb"))
    for name in names:
        notebook = json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))
        kept = [(cell["cell_type"], "".join(cell["source"])) for cell in notebook["cells"]]
        assert kept == maker["cells"]((EXAMPLES / f"{name}.py").read_text(encoding="utf-8")), name
        outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
        assert outputs and all(output["output_type"] != "error" for output in outputs), name
