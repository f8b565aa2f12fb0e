"""The Python of the manual that needs PyTorch runs."""

from pathlib import Path

import pytest
from book import BOOK, pages, run

pytestmark = pytest.mark.skipif(not BOOK.is_dir(), reason="only beside the sources")
pytest.importorskip("torch")


def test_the_page_of_the_package_with_torch(tmp_path: Path) -> None:
    blocks = [block for block in pages()["book/src/how-to/python.md"] if "torch" in block]
    assert len(blocks) >= 2
    names = run(blocks, tmp_path)
    assert names["psfs"].values.shape == (3, 3, 32, 32) and float(names["loss"].detach()) > 0
    assert names["module"].kind == names["weights"].kind
