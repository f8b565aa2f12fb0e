"""A torch module as the network of a design."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
nn = torch.nn


def _restorer():
    from petzval.torch.network import Network

    class Restorer(Network):
        def module(self, channels, width=4, dropout=0.0):
            first, last = nn.Conv2d(channels, width, 3, padding=1), nn.Conv2d(width, 3, 3, padding=1)
            return nn.Sequential(first, nn.GELU(), nn.Dropout(dropout), last)

    return Restorer


def test_derivatives_are_those_of_torch_and_lower_the_loss() -> None:
    torch.set_num_threads(1)
    network = _restorer()(channels=5, seed=3)
    draw = np.random.default_rng(1)
    x, target = (draw.random((2, planes, 8, 8), dtype=np.float32) for planes in (5, 3))

    def loss() -> float:
        return float(((network.forward(x) - target) ** 2).mean())

    first = loss()
    for _ in range(30):
        error = network.forward(x) - target
        back = network.backward(2 * error / error.size)
        network.step(0.02)
    assert back.shape == x.shape and back.dtype == np.float32
    assert loss() < 0.5 * first
    # By the input, against a central difference.
    direction = draw.standard_normal(x.shape).astype(np.float32)
    cotangent = 2 * (network.forward(x) - target) / target.size
    along = float((network.backward(cotangent) * direction).sum())
    values = []
    for sign in (1, -1):
        values.append(float(((network.forward(x + sign * 1e-2 * direction) - target).astype(float) ** 2).mean()))
    assert (values[0] - values[1]) / 2e-2 == pytest.approx(along, rel=2e-2)


def test_a_loaded_network_goes_on_with_the_same_bits() -> None:
    torch.set_num_threads(1)
    x = np.random.default_rng(1).random((1, 5, 8, 8), dtype=np.float32)
    # Dropout draws from the random numbers of the network.
    make = _restorer()

    def steps(network, count: int) -> None:
        for _ in range(count):
            network.backward(network.forward(x) - 0.5)
            network.step(0.01)

    whole = make(channels=5, seed=3, dropout=0.3)
    steps(whole, 3)
    kept = whole.save()
    torch.rand(7)
    steps(whole, 3)
    resumed = make(channels=5, seed=8, dropout=0.3)
    resumed.load(kept)
    assert resumed.save() == kept
    steps(resumed, 3)
    assert resumed.save() == whole.save() != kept
    # The same seed is the same network, whatever torch has drawn meanwhile.
    assert make(channels=5, seed=3).save() == make(channels=5, seed=3).save() != make(channels=5, seed=4).save()
