"""Weights of trained networks: as arrays by name, on their way out of Petzval and back, and what the networks make of arrays.

`petzval.torch.models` has a torch module for each of them.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval
from ._arguments import array_of, json_of, not_written, of_class, path_of, text
from ._errors import InputError, Place, setting
from ._watch import watch

__all__ = ["Kind", "Weights"]

Array = NDArray[np.float32]
Kind = Literal["u-net", "restoration", "restoration-naf", "segmenter", "isp-proxy", "optics-proxy", "faster-rcnn", "fcos"]

# Files of weights in the folder of a camera, and in that of a proxy.
_FILES = ("network.safetensors", "weights.safetensors")

# What a run goes on with, in the folder of the block of its network.
_CHECKPOINT = "weights.bin"
_STATE = f"blocks/network/{_CHECKPOINT}"


class Weights:
    """A trained network: its kind, its settings and its weights. Immutable.

    Kind and settings follow from the names and shapes of the weights. Weights of detectors have the names that torchvision gives to them;
    those of other networks have the names of the modules in `petzval.torch.models`.

    Args:
        tensors: All weights by name; float32, float16 or float64, which is rounded to float32.
        kind: What the network is, where its weights do not say so: a U-Net that finishes pictures and a segmenter of three classes have weights
            of the same names and shapes, which are taken for ``"u-net"``. Files of `save` and of runs say it.

    Raises:
        InputError: A weight is missing, too many, of another shape or not finite; the message names it.
    """

    def __init__(self, tensors: Mapping[str, ArrayLike], *, kind: Kind | None = None) -> None:
        with watch() as watching:
            self._core = _petzval.Network.of(_arrays("tensors", tensors), _kind(kind), watching)

    @classmethod
    def _of(cls, core: _petzval.Network) -> Weights:
        weights = cls.__new__(cls)
        weights._core = core
        return weights

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, camera: str | None = None, kind: Kind | None = None) -> Weights:
        """Reads weights.

        Args:
            path: A safetensors file: ``network.safetensors`` of a camera, ``weights.safetensors`` of a proxy, or a detector under the names of
                torchvision. Or the folder that holds one of the first two, or the folder of a run.
            camera: Which camera of a run; need not be given where the run has one.
            kind: See `Weights`.

        Raises:
            InputError: There is no such file, or it holds no weights of a network of Petzval.
        """
        file = _file(Path(path_of("path", path)), camera)
        try:
            contents = file.read_bytes()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            hint = "give a safetensors file, such as cameras/NAME/network.safetensors of a run"
            place = Place(path=file, key="path")
            raise InputError(f"{file}: {reason}", message=reason, place=place, hint=hint, kind="file") from error
        with watch() as watching:
            try:
                return cls._of(_petzval.Network.read(contents, _kind(kind), watching))
            except InputError as error:
                place = Place(path=file, key="path")
                message = error.message
                raise InputError(f"{file}: {message}", message=message, place=place, hint=error.hint, kind=error.kind) from error

    @classmethod
    def built_in(cls, name: str) -> Weights:
        """Weights that Petzval brings: ``"restoration_naf"``, or ``"restoration_naf_waves"`` for PSFs by waves.

        Raises:
            InputError: There are no such weights.
        """
        hint = '"restoration_naf" or "restoration_naf_waves"; Weights.load reads files'
        text("name", name, hint)
        with watch() as watching:
            try:
                return cls._of(_petzval.Network.built_in(name, watching))
            except InputError as error:
                raise setting("name", repr(name), "there are no built-in weights of this name", hint) from error

    @classmethod
    def drawn(cls, kind: Kind, *, seed: int = 0, **settings: int | str) -> Weights:
        """Weights with which Petzval begins a training: drawn from a seed.

        Args:
            kind: The kind of network.
            seed: 0 or above; the same seed gives the same weights.
            **settings: ``base_channels`` and ``levels`` of networks for pictures (and ``classes`` of a segmenter); ``parameters``,
                ``base_channels``, ``levels``, ``thumbnail_channels`` and ``hidden`` of a proxy of an ISP; ``inputs``, ``hidden`` and
                ``channels`` of one of optics; ``backbone`` (``"small"``, ``"resnet18"``, ``"resnet50"``, ``"mobilenet-v2"``) and ``classes`` of
                detectors.

        Raises:
            InputError: A setting is out of its range, missing, or none of this kind.
        """
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**64:
            raise setting("seed", repr(seed), "is no seed", "give a whole number, 0 to 2^64 - 1")
        spec = json_of("settings", {"kind": kind, "settings": settings}, "give finite numbers and texts")
        with watch() as watching:
            return cls._of(_petzval.Network.drawn(spec, int(seed), watching))

    @cached_property
    def _facts(self) -> dict[str, Any]:
        facts: dict[str, Any] = json.loads(self._core.facts())
        return facts

    @property
    def kind(self) -> Kind:
        """What the network is."""
        kind: Kind = self._facts["kind"]
        return kind

    @property
    def settings(self) -> dict[str, Any]:
        """Its sizes, as `drawn` takes them."""
        return dict(self._facts["settings"])

    @property
    def detector(self) -> dict[str, Any] | None:
        """All settings of a detector: anchors, thresholds, numbers of proposals; ``None`` of another network."""
        detector: dict[str, Any] | None = self._facts["detector"]
        return detector

    @cached_property
    def tensors(self) -> Mapping[str, Array]:
        """All weights by name, float32, in the order of the layers. They cannot be changed in place: see `with_`."""
        tensors = dict(self._core.tensors())
        for tensor in tensors.values():
            tensor.setflags(write=False)
        return MappingProxyType(tensors)

    def with_(self, tensors: Mapping[str, ArrayLike]) -> Weights:
        """The same network with some weights changed.

        Raises:
            InputError: There is no such weight, or it has another shape or is not finite.
        """
        unknown = next((name for name in tensors if name not in self.tensors), None)
        if unknown is not None:
            hint = f"its weights are {', '.join(list(self.tensors)[:3])}, ..."
            raise setting("tensors", repr(unknown), "there is no such weight", hint)
        return Weights({**self.tensors, **tensors}, kind=self.kind)

    def save(self, path: str | os.PathLike[str], *, names: Literal["petzval", "torchvision"] = "petzval") -> None:
        """Writes a safetensors file, whole or not at all.

        An experiment takes it as ``network.weights`` or ``detector.weights``, the description of a proxy as ``weights``, and `load` reads it. A
        file with the names of torchvision is what ``petzval detect --weights`` takes.

        Args:
            path: The file.
            names: The names of ``network.safetensors`` in runs, or those of torchvision. The latter for ``"faster-rcnn"`` on a backbone of
                torchvision alone.

        Raises:
            InputError: The file cannot be written, or torchvision has no such network.
        """
        if names not in ("petzval", "torchvision"):
            raise setting("names", repr(names), "there are no such names", 'give "petzval" or "torchvision"')
        with watch() as watching:
            contents = self._core.file(names == "torchvision", watching)
        file = Path(path_of("path", path))
        beside = file.with_name(f".{file.name}.{os.getpid()}")
        try:
            beside.write_bytes(contents)
            beside.replace(file)
        except OSError as error:
            beside.unlink(missing_ok=True)
            raise not_written(file, error) from error

    def run(self, **inputs: ArrayLike) -> dict[str, Array]:
        """What Petzval's network makes of arrays, on the processor.

        Pictures are ``[batch, channel, y, x]``, sRGB-encoded, about 0 to 1. Inputs and outputs by kind:

        * ``u-net``: ``pictures`` gives ``finished``.
        * ``restoration``, ``restoration-naf``: ``restored`` and ``developed``, ``field`` (``[batch, 1, y, x]``, 0 on the axis, 1 in the corner)
          and ``noise`` (``[batch, 1, y, x]``, standard deviation in the square root of light) give ``finished`` and ``curves`` (``[3, knot]``,
          of the restoration in front of it).
        * ``segmenter``: ``pictures`` gives ``logits``, ``[batch, class, y, x]``.
        * ``isp-proxy``: ``raw`` (``[batch, 4, y / 2, x / 2]``; red, green, green, blue; black 0, white 1) and ``theta``
          (``[batch, parameter]``) give ``picture``.
        * ``optics-proxy``: ``inputs`` (``[batch, input]``) gives ``values`` (``[batch, colour, y, x]``, each of unit sum) and ``illumination``.
        * ``faster-rcnn``, ``fcos``: ``pictures`` gives ``boxes`` (``[found, 4]``: x1, y1, x2, y2 in pixels), ``scores``, ``classes`` (from 0) and
          ``pictures`` (the number of the picture), and what the last layers say of every anchor or place: ``objectness`` and ``offsets``, or
          ``logits``, ``distances`` and ``centredness``.

        Raises:
            InputError: An input is missing, is none of this kind, has another shape or is not finite; the message names it.
        """
        with watch() as watching:
            return dict(self._core.run(_arrays("inputs", inputs), watching))

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (dict(self.tensors), self.kind)

    def __repr__(self) -> str:
        settings = ", ".join(f"{name}={value!r}" for name, value in self.settings.items())
        count = sum(tensor.size for tensor in self.tensors.values())
        return f"<Weights of a network {self.kind!r}: {settings}; {count} numbers>"


def _again(tensors: Mapping[str, ArrayLike], kind: Kind) -> Weights:
    """Weights that come out of a pickle."""
    return Weights(tensors, kind=kind)


def _kind(kind: Kind | None) -> str | None:
    return None if kind is None else text("kind", kind, "give the name of a kind")


def _arrays(key: str, arrays: Mapping[str, ArrayLike]) -> list[tuple[str, Array]]:
    """Arrays as the binary part takes them: float32 in one piece."""
    of_class(key, arrays, Mapping, "give arrays by name")
    return [(text(key, name, "names of arrays are texts"), _array(f"{key}[{name!r}]", array)) for name, array in arrays.items()]


def _array(key: str, value: ArrayLike) -> Array:
    array = array_of(key, value, np.float32)
    return np.ascontiguousarray(array).reshape(array.shape)


def _is_own_class(folder: Path) -> bool:
    """Whether the network of a camera's folder is a class of the user, of which a run keeps what `petzval.guest.Network.save` gave."""
    try:
        network = tomllib.loads((folder.parent.parent / "config.toml").read_text(encoding="utf-8"))["network"]
    except (OSError, ValueError, KeyError):
        return False
    return isinstance(network, dict) and network.get("kind") == "python" and (folder / _STATE).is_file()


def _own_class(folder: Path) -> InputError:
    hint = f"{folder / _STATE} holds the bytes that `save` of the class gave: its `load` takes them"
    message = "its network is a class in Python, not one of Petzval"
    return InputError(f"{folder}: {message}", message=message, place=Place(path=folder, key="path"), hint=hint)


def _file(path: Path, camera: str | None) -> Path:
    """The file of weights that a path stands for."""
    cameras = path / "cameras"
    if camera is not None and (not isinstance(camera, str) or not cameras.is_dir()):
        hint = "name a camera where `path` is the folder of a run"
        raise InputError(f"{path}: no run, and camera is {camera!r}", place=Place(path=path, key="camera"), hint=hint)
    if cameras.is_dir():
        made = sorted(folder.name for folder in cameras.iterdir() if (folder / _FILES[0]).is_file())
        if camera is None and len(made) == 1:
            camera = made[0]
        own = sorted(folder.name for folder in cameras.iterdir() if _is_own_class(folder))
        if camera in own or (camera is None and len(own) == 1 and not made):
            raise _own_class(cameras / (camera or own[0]))
        if camera not in made:
            found = ", ".join(made) or "none yet"
            hint = f"cameras with a network are: {found}"
            raise InputError(f"{path}: camera is {camera!r}", place=Place(path=path, key="camera", value=repr(camera)), hint=hint)
        return cameras / camera / _FILES[0]
    file: Path = next((path / name for name in _FILES if (path / name).is_file()), path)
    if file == path and _is_own_class(path):
        raise _own_class(path)
    checkpoint = file / _CHECKPOINT if file.is_dir() else file
    if checkpoint.name == _CHECKPOINT and checkpoint.is_file():
        if _is_own_class(checkpoint.parent.parent.parent):
            raise _own_class(checkpoint.parent.parent.parent)
        hint = f"the same weights are in {_FILES[0]} in the folder of the camera: petzval.Weights.load(RUN, camera=NAME)"
        raise InputError(f"{checkpoint}: is what a run goes on with", place=Place(path=checkpoint, key="path"), hint=hint)
    return file
