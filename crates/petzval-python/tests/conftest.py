from importlib.util import find_spec

import pytest

import petzval as pz

# Without PyTorch, `import torch` finds the folder of its tests, which is no PyTorch.
_TORCH = find_spec("torch")
collect_ignore = [] if _TORCH is not None and _TORCH.origin is not None else ["torch"]

TRIPLET = "cooke-triplet-nominal"


@pytest.fixture(scope="session")
def triplet() -> pz.Lens:
    return pz.Lens.load(TRIPLET)
