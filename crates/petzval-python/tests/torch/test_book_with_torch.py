"""The Python of the manual that needs PyTorch runs."""

from pathlib import Path

import pytest
from book import BOOK, names, run

pytestmark = pytest.mark.skipif(not BOOK.is_dir(), reason="only beside the sources")
pytest.importorskip("torch")


@pytest.mark.parametrize("page", names(with_torch=True))
def test_the_python_of_a_page_runs_with_torch(page: str, tmp_path: Path) -> None:
    found = run(page, tmp_path, with_torch=True)
    if page.endswith("/python.md"):
        assert found["psfs"].values.shape == (3, 3, 32, 32) and float(found["loss"].detach()) > 0
        assert found["module"].kind == found["weights"].kind
