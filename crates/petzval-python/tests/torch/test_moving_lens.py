import re
import subprocess
import sys
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

EXAMPLE = Path(__file__).parents[2] / "examples" / "moving_lens.py"


@pytest.mark.skipif(not EXAMPLE.is_file(), reason="only beside the sources")
def test_a_network_and_a_lens_learn_together(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, EXAMPLE], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    found = re.search(r"first ten steps ([0-9.]+), of the last ten ([0-9.]+)", done.stdout)
    assert found is not None, done.stdout
    assert float(found[2]) < 0.7 * float(found[1]), done.stdout
    assert (tmp_path / "designed.toml").is_file()
