import pytest

import petzval as pz


@pytest.fixture
def glass(triplet: pz.Lens):
    torch = pytest.importorskip("torch")
    import petzval.torch as pt

    torch.set_num_threads(1)
    return pt.Lens(triplet)
