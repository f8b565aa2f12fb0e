"""The Python of the manual runs. What needs PyTorch is in ``torch/test_book_with_torch.py``."""

from pathlib import Path

import numpy as np
import pytest
from book import BOOK, names, run

import petzval as pz

pytestmark = pytest.mark.skipif(not BOOK.is_dir(), reason="only beside the sources")


@pytest.mark.parametrize("page", names(with_torch=False))
def test_the_python_of_a_page_runs(page: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = run(page, tmp_path, with_torch=False)
    printed = capsys.readouterr().out
    # What pages print beside their blocks.
    if page.endswith("/python.md"):
        assert "(4, 3, 64, 64) uint16 (120, 160, 3)" in printed
    if page.endswith("/psf.md"):
        assert found["psf"].shape == (13, 3, 128, 128)
        np.testing.assert_allclose([float(word) for word in printed.split()], [15.76639035485971, 6.634, 6.634], rtol=1e-9)
        assert pz.PsfBank.load(tmp_path / "own").channels == ("red", "green", "blue")
    if page == "crates/petzval-python/README.md":
        assert found["bank"].values.shape == (5, 3, 128, 128)
        assert (tmp_path / "layout.svg").is_file() and found["worst"]["report"]


def test_pages_with_python_are_found() -> None:
    found = names(with_torch=False)
    assert "crates/petzval-python/README.md" in found
    assert {Path(page).name for page in found} >= {"python.md", "psf.md"}
