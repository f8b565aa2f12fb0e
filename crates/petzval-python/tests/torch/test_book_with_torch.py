"""The Python of the manual that needs PyTorch runs."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from book import BOOK, ROOT, pages, run

pytestmark = pytest.mark.skipif(not BOOK.is_dir(), reason="only beside the sources")
pytest.importorskip("torch")


def test_the_page_of_the_package_with_torch(tmp_path: Path) -> None:
    blocks = [block for block in pages()["book/src/how-to/python.md"] if "torch" in block]
    assert len(blocks) >= 2
    names = run(blocks, tmp_path)
    assert names["psfs"].values.shape == (3, 3, 32, 32) and float(names["loss"].detach()) > 0
    assert names["module"].kind == names["weights"].kind


def test_the_page_for_researchers(tmp_path: Path) -> None:
    """A lens and photographs of a user; one step in place of sixty."""
    image = pytest.importorskip("PIL.Image")
    shutil.copy(ROOT / "crates/petzval/tests/lenses/double-gauss.zmx", tmp_path)
    (tmp_path / "photos").mkdir()
    texture = np.random.default_rng(1).integers(0, 256, (21, 24, 3), dtype=np.uint8)
    image.fromarray(texture).resize((240, 210)).save(tmp_path / "photos" / "texture.png")
    blocks = pages()["book/src/start/researcher.md"]
    assert "STEPS, LOOKS = 60, 8" in blocks[1]
    names = run([block.replace("STEPS, LOOKS = 60, 8", "STEPS, LOOKS = 1, 1") for block in blocks], tmp_path)
    assert names["bank"].values.shape == (3, 3, 64, 64)
    moved, start = names["pz"].Lens.load(tmp_path / "moved.toml"), names["lens"]
    assert abs(moved.efl_mm / start.efl_mm - 1) < 1e-6 and moved.surfaces[0].radius_mm != start.surfaces[0].radius_mm
