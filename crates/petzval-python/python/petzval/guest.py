"""A network and a loss of your own in ``petzval design``: what their classes must have.

An experiment names them by module and class::

    task = "python"

    [network]
    kind = "python"

    [python.network]
    class = "my_nets:Restorer"
    options = { width = 8 }

    [python.task]
    class = "my_nets:Edges"

    [scoring]
    scores = ["edge_error", "psnr_db"]

Python finds the module on its import path, or in the folder where Petzval runs; never in the folder of a run. The command starts a process for the
classes, by the interpreter that the environment variable ``PETZVAL_PYTHON`` names, else by ``python3``; it needs NumPy. What classes print there becomes notes
of the job. `petzval.jobs.run` calls them in its own process; a class of a notebook is ``"__main__:Restorer"``. Both ways give the same bits.

A class need not inherit from the protocols below. PyTorch users take `petzval.torch.network.Network`, which has all methods.

Arrays are ``float32``, row-major, ``[batch, plane, y, x]``; pictures are sRGB-encoded, about 0..1. What a method gives back may be of any float type. An
exception ends the run with the place in the class; so does NaN, an infinity, and an array of the wrong shape. The last checkpoint stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Required, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Network", "Score", "Task"]


class Network(Protocol):
    """A network behind the development. It owns its weights, its optimiser and its random numbers.

    Its input ``x`` is ``[batch, channels, y, x]``:

    ========= =============================================================================================
    planes    what they hold
    ========= =============================================================================================
    0, 1, 2   the picture to finish: restored where the experiment restores (``development.restore``)
    3         distance from the optical axis: 0 on it, 1 in the corner of the sensor
    4         standard deviation of the noise in the square root of light, in roots of white
    5, 6, 7   the developed picture before restoration; only where the experiment restores
    ========= =============================================================================================

    A network that changes nothing returns ``x[:, :3]``. Windows have the side ``training.crop`` in training and ``scoring.crop`` in scores; other commands
    give whole frames, of any size.
    """

    def __init__(self, *, channels: int, seed: int, **options: Any) -> None:
        """Makes the network at its start, the same for the same arguments.

        Args:
            channels: Planes of the input: 8, or 5 where the experiment does not restore.
            seed: The seed of the experiment.
            options: Those of ``python.network``.
        """

    def forward(self, x: NDArray[np.float32]) -> ArrayLike:
        """The finished pictures ``[batch, 3, y, x]``. The same in training and in scores."""

    def backward(self, cotangent: NDArray[np.float32]) -> ArrayLike:
        """Derivatives of the loss by the input of the last `forward`, in its shape.

        Keeps the derivatives by the weights for `step`, in place of those of earlier calls: after a step of the lens none follows.

        Args:
            cotangent: Derivatives by what `forward` returned, ``[batch, 3, y, x]``.
        """

    def step(self, rate: float) -> None:
        """Moves the weights down the derivatives of the last `backward`.

        Args:
            rate: The learning rate of the schedule at this step.
        """

    def save(self) -> bytes:
        """Everything that `load` needs to go on with the same bits: weights, moments of the optimiser, state of random numbers."""

    def load(self, state: bytes) -> None:
        """Takes over what `save` returned, here or in another process."""


class Score(TypedDict, total=False):
    """What the report says of a score."""

    higher_is_better: Required[bool]
    definition: str
    """How it is computed, in one sentence."""
    title: str
    """Heading; the name where it is left out."""
    unit: str
    decimals: int
    """Digits after the decimal point in tables; 4 where it is left out."""


class Task(Protocol):
    """Loss and scores of pictures. Windows are those of the task ``image-quality``; ``scoring.scores`` names scores of the class and usual ones."""

    scores: Mapping[str, Score]
    """Every score by its name; may be empty."""

    def __init__(self, **options: Any) -> None:
        """Makes the task from the options of ``python.task``."""

    def loss(
        self, pictures: NDArray[np.float32], targets: NDArray[np.float32]
    ) -> tuple[float, ArrayLike]:
        """The loss of a batch, and its derivatives by the pictures.

        Args:
            pictures: Finished pictures, ``[batch, 3, y, x]``.
            targets: The scenes that they show, without blur and noise.

        Returns:
            The mean over the batch, and an array in the shape of the pictures.
        """

    def score(self, pictures: NDArray[np.float32], targets: NDArray[np.float32]) -> Mapping[str, float]:
        """Each of `scores`, and no other, for one finished picture, ``[1, 3, y, x]``. That of a camera is the mean over its pictures."""
