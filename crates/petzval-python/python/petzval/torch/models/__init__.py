"""Every network that Petzval trains, as a torch module: weights in, weights out, ONNX.

    >>> weights = petzval.Weights.load("run", camera="end-to-end")
    >>> module = petzval.torch.models.from_weights(weights)
    >>> petzval.torch.models.to_weights(module).save("network.safetensors")

Modules give the outputs of Petzval's networks (`petzval.Weights.run`) but for the rounding of sums. Detectors of two stages are torchvision's own
`FasterRCNN`, so they and `Fcos` need torchvision.
"""

from __future__ import annotations

from torch import nn

from ..._errors import InputError, Place
from ...weights import Weights
from ._base import PetzvalModule, as_weights
from .detectors import Fcos, faster_rcnn, is_faster_rcnn
from .onnx import to_onnx
from .pictures import Naf, Restoration, RestorationNaf, Segmenter, UNet
from .proxies import IspProxy, OpticsProxy

__all__ = [
    "Fcos",
    "IspProxy",
    "Naf",
    "OpticsProxy",
    "PetzvalModule",
    "Restoration",
    "RestorationNaf",
    "Segmenter",
    "UNet",
    "faster_rcnn",
    "from_weights",
    "to_onnx",
    "to_weights",
]

_MODULES: dict[str, type[PetzvalModule]] = {
    module.kind: module for module in (UNet, Restoration, RestorationNaf, Segmenter, IspProxy, OpticsProxy, Fcos)
}


def from_weights(weights: Weights) -> nn.Module:
    """The torch module of a network, on the CPU, in evaluation mode: torchvision's `FasterRCNN` for ``"faster-rcnn"``, a module of this package
    for every other kind.

    Raises:
        ImportError: The network is a detector, and torchvision is not installed.
    """
    if not isinstance(weights, Weights):
        raise InputError(f"weights is {weights!r}; give petzval.Weights", place=Place(key="weights", value=repr(weights)))
    if weights.kind == "faster-rcnn":
        return faster_rcnn(weights)
    return _MODULES[weights.kind].from_weights(weights)


def to_weights(module: nn.Module) -> Weights:
    """The weights of a module of this package, or of torchvision's `FasterRCNN` on a backbone that Petzval has: ``resnet18``, ``resnet50``,
    ``mobilenet_v2`` or that of `faster_rcnn`.

    Petzval divides by ``sqrt(variance + 1e-5)`` in a frozen batch normalisation, as torchvision does by default.

    Raises:
        InputError: Petzval has no such network; the message names a weight.
    """
    if isinstance(module, PetzvalModule):
        return module.to_weights()
    if is_faster_rcnn(module):
        return as_weights(module, "faster-rcnn")
    hint = "give a module of petzval.torch.models, or torchvision's FasterRCNN"
    raise InputError(f"module is a {type(module).__name__}", place=Place(key="module", value=type(module).__name__), hint=hint)
