import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="only beside the sources")


def test_a_loop_for_another_lens_takes_that_of_petzval(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    done = subprocess.run([sys.executable, EXAMPLES / "deeplens_loop.py"], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    error = re.search(r"PSF error ([\d.]+) %", done.stdout)
    losses = re.search(r"first five steps ([\d.]+), of the last five ([\d.]+)", done.stdout)
    # Against PSFs of a dense trace in NumPy.
    assert error is not None and float(error[1]) < 1.0
    assert losses is not None and float(losses[2]) < 0.9 * float(losses[1])
