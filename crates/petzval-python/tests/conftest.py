import pytest

import petzval as pz

TRIPLET = "cooke-triplet-nominal"


@pytest.fixture(scope="session")
def triplet() -> pz.Lens:
    return pz.Lens.load(TRIPLET)
