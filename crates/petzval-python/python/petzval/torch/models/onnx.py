"""Networks as ONNX files."""

from __future__ import annotations

import os
import warnings
from typing import Any

import torch
from torch import Tensor, nn

from ..._errors import InputError, Place
from .detectors import Fcos, is_faster_rcnn
from .pictures import Restoration, Segmenter, UNet
from .proxies import IspProxy, OpticsProxy

# The version of ONNX's operators: of all that is needed the newest came with 16.
_OPSET = 18


def to_onnx(
    module: nn.Module,
    path: str | os.PathLike[str],
    *,
    height: int = 256,
    width: int = 256,
    batch: int = 1,
    is_dynamic: bool = False,
) -> None:
    """Writes a network as an ONNX file, for onnxruntime and others.

    Inputs and outputs have the names of `petzval.Weights.run`, but that a detector takes one ``picture`` ``[3, y, x]`` and gives ``boxes``,
    ``labels`` and ``scores``, as the module does. The exporter of detectors is the one over TorchScript; all else needs onnxscript.

    Args:
        module: What `from_weights` gives, on the CPU, in evaluation mode.
        path: The file.
        height: Rows of the pictures.
        width: Columns of the pictures.
        batch: Pictures at once; a detector takes one.
        is_dynamic: Whether the file takes other heights, widths and batches, too. Both sides must then be multiples of the unit of the network:
            ``2**levels``, and twice that of a proxy of an ISP. `Fcos` takes pictures of one size alone.

    Raises:
        InputError: The module is none of these, or a size is out of range.
    """
    for key, value in (("height", height), ("width", width), ("batch", batch)):
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise InputError(f"{key} is {value!r}; give a whole number, 1 or above", place=Place(key=key, value=repr(value)))
    if isinstance(module, Fcos) or is_faster_rcnn(module):
        if batch != 1 or (is_dynamic and isinstance(module, Fcos)):
            hint = "leave out batch, and is_dynamic for Fcos"
            raise InputError(f"a detector takes one picture at a time: batch is {batch}", place=Place(key="batch", value=str(batch)), hint=hint)
        _detector_to_onnx(module, path, height, width, is_dynamic)
        return

    def random(*shape: int) -> Tensor:
        return torch.rand(shape)

    side, columns, of_batch = (torch.export.Dim(name, min=1, max=1 << 16) for name in ("y", "x", "batch"))
    unit = 1
    if isinstance(module, UNet):
        unit, names, outputs = module.unit, {"pictures": module.in_channels}, ["finished"]
    elif isinstance(module, Segmenter):
        unit, names, outputs = module.unit, {"pictures": 3}, ["logits"]
    elif isinstance(module, Restoration):
        unit, names, outputs = module.unit, {"restored": 3, "developed": 3, "field": 1, "noise": 1}, ["finished"]
    elif isinstance(module, IspProxy):
        unit, names, outputs = module.trunk.unit, {"raw": 4}, ["picture"]
        if height % 2 or width % 2:
            raise InputError(f"height and width are {height} and {width}; a mosaic has even sides", place=Place(key="height", value=str(height)))
        height, width = height // 2, width // 2
    elif isinstance(module, OpticsProxy):
        names, outputs = {}, ["values", "illumination"]
    else:
        hint = "give a module of petzval.torch.models, or torchvision's FasterRCNN"
        raise InputError(f"module is a {type(module).__name__}", place=Place(key="module", value=type(module).__name__), hint=hint)
    if is_dynamic and (height % unit or width % unit):
        raise InputError(f"height and width are {height} and {width}; a dynamic file needs multiples of {unit}", place=Place(key="height"))
    inputs = {name: random(batch, of, height, width) for name, of in names.items()}
    shapes: dict[str, Any] = {name: {0: of_batch, 2: unit * side, 3: unit * columns} for name in names}
    if isinstance(module, IspProxy):
        inputs["theta"], shapes["theta"] = random(batch, module.hidden_weight.shape[0]), {0: of_batch}
    if isinstance(module, OpticsProxy):
        inputs["inputs"], shapes["inputs"] = random(batch, module.first.weight.shape[0]), {0: of_batch}
    with warnings.catch_warnings(), torch.no_grad():
        # The exporter warns of its own future.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module,
            tuple(inputs.values()),
            os.fspath(path),
            dynamo=True,
            external_data=False,
            opset_version=_OPSET,
            input_names=list(inputs),
            output_names=outputs,
            dynamic_shapes=tuple(shapes.values()) if is_dynamic else None,
            verbose=False,
        )


class _OnePicture(nn.Module):
    """A detector of one picture, as an ONNX file has it."""

    def __init__(self, detector: nn.Module) -> None:
        super().__init__()
        self.detector = detector

    def forward(self, picture: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        found = self.detector([picture])[0]
        return found["boxes"], found["labels"], found["scores"]


def _detector_to_onnx(module: nn.Module, path: str | os.PathLike[str], height: int, width: int, is_dynamic: bool) -> None:
    with warnings.catch_warnings(), torch.no_grad():
        # The exporter over TorchScript is the one that can export torchvision's choice of boxes, which is data.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            _OnePicture(module).eval(),
            (torch.rand(3, height, width),),
            os.fspath(path),
            dynamo=False,
            opset_version=_OPSET,
            input_names=["picture"],
            output_names=["boxes", "labels", "scores"],
            dynamic_axes={"picture": {1: "y", 2: "x"}} if is_dynamic else {name: {0: "found"} for name in ("boxes", "labels", "scores")},
        )
