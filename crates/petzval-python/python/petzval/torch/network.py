"""A torch module as the network of ``petzval design``."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

__all__ = ["Network"]


class Network:
    """The methods of `petzval.guest.Network` around a module and an optimiser.

    A subclass says which::

        class Restorer(petzval.torch.network.Network):
            def module(self, channels, width=16):
                return nn.Sequential(nn.Conv2d(channels, width, 3, padding=1), nn.GELU(), nn.Conv2d(width, 3, 3, padding=1))

    Each object has random numbers of its own, from the seed of the experiment. ``torch.set_num_threads(1)`` in the module of the class makes results
    independent of the number of cores.

    Attributes:
        device: Where the module works. Bits are the same from run to run where torch's are.
    """

    device: str = "cpu"

    def __init__(self, *, channels: int, seed: int, **options: Any) -> None:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self._module = self.module(channels, **options).to(self.device)
            self._random = torch.get_rng_state()
        self._optimizer = self.optimizer(self._module)

    def module(self, channels: int, **options: Any) -> torch.nn.Module:
        """The module: ``[batch, channels, y, x]`` in, ``[batch, 3, y, x]`` out."""
        raise NotImplementedError("a network says in `module` what it is")

    def optimizer(self, module: torch.nn.Module) -> torch.optim.Optimizer:
        """The optimiser; its learning rate is set before every step."""
        return torch.optim.Adam(module.parameters())

    def forward(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """See `petzval.guest.Network.forward`."""
        self._input = torch.from_numpy(x).to(self.device).requires_grad_()
        with torch.random.fork_rng(devices=[]):
            torch.set_rng_state(self._random)
            self._output = self._module(self._input)
            self._random = torch.get_rng_state()
        finished: NDArray[np.float32] = self._output.detach().cpu().numpy()
        return finished

    def backward(self, cotangent: NDArray[np.float32]) -> NDArray[np.float32]:
        """See `petzval.guest.Network.backward`."""
        self._optimizer.zero_grad()
        self._output.backward(torch.from_numpy(cotangent).to(self.device))
        by_input = self._input.grad
        assert by_input is not None, "the output of the module does not depend on its input"
        found: NDArray[np.float32] = by_input.cpu().numpy()
        return found

    def step(self, rate: float) -> None:
        """See `petzval.guest.Network.step`."""
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        self._optimizer.step()

    def save(self) -> bytes:
        """See `petzval.guest.Network.save`."""
        kept = io.BytesIO()
        state = {"module": self._module.state_dict(), "optimizer": self._optimizer.state_dict(), "random": self._random}
        torch.save(state, kept)
        return kept.getvalue()

    def load(self, state: bytes) -> None:
        """See `petzval.guest.Network.load`."""
        found = torch.load(io.BytesIO(state), map_location="cpu", weights_only=True)
        self._module.load_state_dict(found["module"])
        self._optimizer.load_state_dict(found["optimizer"])
        self._random = found["random"]
