from importlib.util import find_spec
import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest

import petzval as pz

# Without PyTorch, `import torch` finds the folder of its tests, which is no PyTorch.
_TORCH = find_spec("torch")
collect_ignore = [] if _TORCH is not None and _TORCH.origin is not None else ["torch"]

TRIPLET = "cooke-triplet-nominal"


@pytest.fixture(scope="session")
def triplet() -> pz.Lens:
    return pz.Lens.load(TRIPLET)


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of three cameras, made in a few seconds; tests that write take a copy."""
    experiment: dict[str, Any] = tomllib.loads(pz.jobs.run("experiment-show", {"name": "cooke-triplet-image-quality"}))  # type: ignore[arg-type]
    small: dict[str, dict[str, Any]] = {
        "psf": {
            "fields": 3,
            "grid": 64,
            "kind": "geometric",
            "scoring_pupil_error": 2.0,
            "patches": [2, 2],
            "pupil_cells": 16,
            "scoring_pupil_cells": 16,
        },
        "network": {"base_channels": 4, "levels": 1},
        "training": {"steps": 2, "batch": 1, "crop": 64},
        "optics": {"steps": 1},
        "spot": {"iterations": 2},
        "scoring": {"places_per_side": 1, "crop": 64},
    }
    for table, keys in small.items():
        for key, value in keys.items():
            assert key in experiment[table], f"the experiment has no key {table}.{key} any more"
            experiment[table][key] = value
    folder = tmp_path_factory.mktemp("runs") / "run"
    with warnings.catch_warnings():
        # PSFs of so small a grid lose light.
        warnings.simplefilter("ignore", pz.PetzvalWarning)
        pz.jobs.run("design", {"run": {"new": {"experiment": experiment, "out": folder}}})
    return folder
