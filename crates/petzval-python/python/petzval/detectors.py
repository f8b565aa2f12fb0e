"""Detectors: pictures go in, boxes come out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _petzval, jobs
from ._arguments import made_by
from ._pictures import Picture, given
from ._watch import Progress, watch
from .cameras import _known
from .runs import Run

__all__ = ["Detections", "Detector"]


@dataclass(frozen=True)
class Detections:
    """Objects that were found in a picture, best first.

    Attributes:
        boxes_px: Left edge, upper edge, width and height, pixels of the picture, ``[object, 4]``.
        classes: Names of the classes.
        scores: How sure the detector is, 0 to 1, ``[object]``.
    """

    boxes_px: NDArray[np.float32]
    classes: tuple[str, ...]
    scores: NDArray[np.float32]

    @property
    def corners_px(self) -> NDArray[np.float32]:
        """Left, upper, right and lower edge, ``[object, 4]``: the order of torchvision."""
        upper_left, size = self.boxes_px[:, :2], self.boxes_px[:, 2:]
        return np.concatenate([upper_left, upper_left + size], axis=1)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each object."""
        names = ("left_px", "upper_px", "width_px", "height_px")
        return [
            {"class": name, "score": float(score), **dict(zip(names, box.tolist(), strict=True))}
            for name, score, box in zip(self.classes, self.scores, self.boxes_px, strict=True)
        ]

    def __len__(self) -> int:
        return len(self.classes)


class Detector:
    """A detector with its weights. Make it with `load` or `from_weights`."""

    def __init__(self, core: _petzval.Detector) -> None:
        self._core = made_by(core, _petzval.Detector, "petzval.Detector.load(RUN) or petzval.Detector.from_weights(FILE)")

    @classmethod
    def load(
        cls,
        run: Run | str | os.PathLike[str],
        camera: str | None = None,
        *,
        device: str | None = None,
        accept_changed: Sequence[str] = (),
        progress: Progress = False,
    ) -> Detector:
        """The detector of a finished camera of a run.

        Args:
            run: The run, or its folder.
            camera: Name of the camera; the last finished one if left out.
            device: Where tensors live; that of the command if left out.
            accept_changed: Files or folders of the run, by their path below it, that may differ from their digests.
            progress: ``True`` for a bar, or a function that takes every event.

        Raises:
            InputError: It is no run, its cameras have no detector, or there is no such camera.
        """
        folder = run.path if isinstance(run, Run) else run
        source = {"run": _known(run=folder, camera=camera)}
        return cls._open(source, device, accept_changed, progress)

    @classmethod
    def from_weights(
        cls,
        file: str | os.PathLike[str],
        *,
        backbone: Literal["small", "resnet18", "resnet50", "mobilenet-v2"] | None = None,
        classes: int | None = None,
        shorter_side: int | None = None,
        longer_side: int | None = None,
        device: str | None = None,
        progress: Progress = False,
    ) -> Detector:
        """A Faster R-CNN by weights under the names of torchvision. What is left out has the default of ``petzval detect``.

        Args:
            file: The file, safetensors.
            backbone: Backbone of the weights.
            classes: Classes of the weights, without the background.
            shorter_side: Pixels to which the shorter side of a picture is scaled.
            longer_side: Most pixels that the longer side may have after that.
            device: Where tensors live.
            progress: ``True`` for a bar, or a function that takes every event.

        Raises:
            InputError: The file does not hold such weights.
        """
        sides = _known(shorter_side=shorter_side, longer_side=longer_side)
        weights = _known(file=file, backbone=backbone, classes=classes) | sides
        return cls._open({"weights": weights}, device, (), progress)

    @classmethod
    def _open(
        cls, source: dict[str, Any], device: str | None, accept_changed: Sequence[str], progress: Progress
    ) -> Detector:
        request = jobs._json({"detector": source})
        with watch(progress) as watching:
            return cls(_petzval.Detector(request, device, list(accept_changed), watching))

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of its classes; of weights of torchvision the numbers that torchvision gives them."""
        return tuple(self._core.classes())

    def find(self, picture: Picture, *, least_score: float = 0.0, progress: Progress = False) -> Detections:
        """The objects in a picture, best first.

        Args:
            picture: A path, or an array ``[y, x, 3]``: ``uint8`` is sRGB-encoded, floats are linear light where 1 is white.
            least_score: Least score of an object, 0 to 1.
            progress: ``True`` for a bar, or a function that takes every event.

        Raises:
            InputError: The picture or the score is wrong.
        """
        with watch(progress) as watching:
            boxes, classes, scores = self._core.find(given(picture), least_score, watching)
        return Detections(boxes_px=boxes, classes=tuple(classes), scores=scores)

    def __repr__(self) -> str:
        return f"<Detector of {', '.join(self.classes[:8])}{', ...' if len(self.classes) > 8 else ''}>"
