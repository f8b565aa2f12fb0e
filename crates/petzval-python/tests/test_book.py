"""The Python of the manual runs. What needs PyTorch is in ``torch/test_book_with_torch.py``."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from book import BOOK, ROOT, pages, run

import petzval as pz

pytestmark = pytest.mark.skipif(not BOOK.is_dir(), reason="only beside the sources")


def test_every_page_with_python_is_run_somewhere() -> None:
    # That of light-path/isp.md is the program of an external ISP, which Petzval starts; that of how-to/cluster.md needs Ray and Snakemake.
    elsewhere = {"book/src/light-path/isp.md", "book/src/how-to/cluster.md"}
    here = {"book/src/light-path/psf.md", "book/src/how-to/python.md", "crates/petzval-python/README.md", "book/src/start/researcher.md"}
    assert set(pages()) == elsewhere | here


def test_the_page_of_the_package(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = [block for block in pages()["book/src/how-to/python.md"] if "torch" not in block]
    assert blocks
    run(blocks, tmp_path)
    assert "(4, 3, 64, 64) uint16 (120, 160, 3)" in capsys.readouterr().out


def test_the_page_of_psfs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pz.jobs.run("psf", {"lens": "cooke-triplet-nominal", "out": tmp_path / "psf-nominal"})
    names = run(pages()["book/src/light-path/psf.md"], tmp_path, psfs=np.ones((3, 3, 32, 32)))
    assert names["psf"].shape == (13, 3, 128, 128)
    # Printed on the page, which was written on another machine.
    printed = [float(word) for word in capsys.readouterr().out.split()]
    np.testing.assert_allclose(printed, [15.76639035485971, 6.634, 6.634], rtol=1e-9)
    assert pz.PsfBank.load(tmp_path / "own").channels == ("red", "green", "blue")


def test_the_readme(tmp_path: Path) -> None:
    shutil.copy(ROOT / "crates/petzval/tests/lenses/double-gauss.zmx", tmp_path)
    names = run(pages()["crates/petzval-python/README.md"], tmp_path)
    assert names["bank"].values.shape == (5, 3, 128, 128)
    assert (tmp_path / "layout.svg").is_file() and names["worst"]["report"]
