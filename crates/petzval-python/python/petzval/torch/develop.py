# mypy: disallow-untyped-calls=False, disallow-untyped-decorators=False, disallow-subclassing-any=False
"""Development with gradients: operators over Petzval's own adjoints.

The pictures are those of `petzval.Isp.smooth` and of `petzval.LinearIsp.develop`. Petzval computes on the CPU in 32 bits: tensors of another
device are copied there and back, and results have the device and the type of the raw frames. Second derivatives do not exist.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from .._arguments import of_class
from .._errors import InputError, PetzvalWarning, Place, setting
from .._watch import watch
from ..isp import Isp as _Isp
from ..linear_isp import LinearIsp
from ..raw_frame import FrameInfo, RawFrame
from ._exact import alike, keeping_types

__all__ = ["Isp", "develop", "develop_linear"]


class _Kept:
    """What operators are given by number, since they take tensors and numbers alone. Equal things share a number, and stay for good."""

    def __init__(self) -> None:
        self._things: list[Any] = []
        self._numbers: dict[Any, int] = {}
        self._lock = threading.Lock()

    def number(self, key: Any, make: Callable[[], Any]) -> int:
        with self._lock:
            if key not in self._numbers:
                self._things.append(make())
                self._numbers[key] = len(self._things) - 1
            return self._numbers[key]

    def __getitem__(self, number: int) -> Any:
        return self._things[number]


_KEPT = _Kept()

_LIBRARY = torch.library.Library("petzval", "FRAGMENT")
_LIBRARY.define("develop(Tensor raw, Tensor parameters, int isp) -> Tensor")
_LIBRARY.define("develop_backward(Tensor raw, Tensor parameters, Tensor cotangent, int isp) -> (Tensor, Tensor)")
_LIBRARY.define("develop_linear(Tensor raw, Tensor illumination, int isp) -> Tensor")
_LIBRARY.define("develop_linear_backward(Tensor raw, Tensor illumination, Tensor cotangent, int isp) -> (Tensor, Tensor)")


def _host(tensor: Tensor, dtype: torch.dtype = torch.float32) -> Any:
    """The numbers of a tensor as an array."""
    return tensor.detach().to("cpu", dtype).contiguous().numpy()


def _like(array: Any, tensor: Tensor) -> Tensor:
    """An array as a tensor of the device and type of another."""
    return torch.from_numpy(array).to(tensor.device, tensor.dtype)


def _develop(raw: Tensor, parameters: Tensor, isp: int) -> Tensor:
    core, frame = _KEPT[isp]
    with watch() as watching:
        return _like(core.smooth(frame, _host(raw), _host(parameters, torch.float64), watching), raw)


def _develop_backward(raw: Tensor, parameters: Tensor, cotangent: Tensor, isp: int) -> tuple[Tensor, Tensor]:
    core, frame = _KEPT[isp]
    values = _host(parameters, torch.float64)
    with watch() as watching:
        by_raw, by_values = core.pull_back(frame, _host(raw), values, _host(cotangent), watching)
    return _like(by_raw, raw), _like(by_values, parameters)


def _develop_linear(raw: Tensor, illumination: Tensor, isp: int) -> Tensor:
    with watch() as watching:
        return _like(_KEPT[isp].develop(_host(raw), _host(illumination), watching), raw)


def _develop_linear_backward(raw: Tensor, illumination: Tensor, cotangent: Tensor, isp: int) -> tuple[Tensor, Tensor]:
    with watch() as watching:
        by_raw, by_light = _KEPT[isp].pull_back(_host(raw), _host(illumination), _host(cotangent), watching)
    return _like(by_raw, raw), _like(by_light, illumination)


def _fake(raw: Tensor, other: Tensor, isp: int) -> Tensor:
    frames, height, width = raw.shape
    return raw.new_empty((frames, 3, height, width))


def _fake_backward(raw: Tensor, other: Tensor, cotangent: Tensor, isp: int) -> tuple[Tensor, Tensor]:
    return raw.new_empty(raw.shape), other.new_empty(other.shape)


def _merged(size: int, dim: int | None, tensor: Tensor) -> Tensor:
    """A tensor whose first axis takes the mapped one in."""
    mapped = tensor.expand(size, *tensor.shape) if dim is None else tensor.movedim(dim, 0)
    return mapped.reshape(-1, *mapped.shape[2:])


def _vmap(name: str) -> Any:
    """The rule by which an operator is mapped: what is mapped are more frames."""

    def rule(info: Any, dims: tuple[int | None, ...], *inputs: Any) -> tuple[Any, Any]:
        size, (*tensors, isp) = info.batch_size, inputs
        merged = [_merged(size, dim, tensor) for dim, tensor in zip(dims, tensors, strict=False)]
        found = getattr(torch.ops.petzval, name).default(*merged, isp)
        if isinstance(found, Tensor):
            return found.reshape(size, -1, *found.shape[1:]), 0
        return tuple(part.reshape(size, -1, *part.shape[1:]) for part in found), (0, 0)

    return rule


for _name, _work, _shapes in (
    ("develop", _develop, _fake),
    ("develop_backward", _develop_backward, _fake_backward),
    ("develop_linear", _develop_linear, _fake),
    ("develop_linear_backward", _develop_linear_backward, _fake_backward),
):
    _LIBRARY.impl(_name, _work, "CompositeExplicitAutograd")
    torch.library.register_fake(f"petzval::{_name}", _shapes, lib=_LIBRARY)
    torch.library.register_vmap(f"petzval::{_name}", _vmap(_name), lib=_LIBRARY)


class _Backward(torch.autograd.Function):
    """The derivatives of a development, which have none themselves."""

    generate_vmap_rule = True

    @staticmethod
    def forward(raw: Tensor, other: Tensor, cotangent: Tensor, isp: int, name: str) -> tuple[Tensor, Tensor]:
        found: tuple[Tensor, Tensor] = getattr(torch.ops.petzval, name).default(raw, other, cotangent, isp)
        return found

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor) -> Any:
        raise NotImplementedError("petzval.torch.develop has no second derivatives: leave out create_graph=True, torch.func.hessian and the like")


class _Forward(torch.autograd.Function):
    """A development with its derivatives by both of its tensors."""

    generate_vmap_rule = True

    @staticmethod
    def forward(raw: Tensor, other: Tensor, isp: int, name: str) -> Tensor:
        picture: Tensor = getattr(torch.ops.petzval, name).default(raw, other, isp)
        return picture

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        raw, other, ctx.isp, ctx.name = inputs
        ctx.save_for_backward(raw, other)

    @staticmethod
    def backward(ctx: Any, cotangent: Tensor) -> Any:
        raw, other = ctx.saved_tensors
        by_raw, by_other = _Backward.apply(raw, other, cotangent, ctx.isp, f"{ctx.name}_backward")
        return by_raw, by_other, None, None


def develop(raw: Tensor, parameters: Tensor | None = None, *, isp: _Isp, frame: FrameInfo | RawFrame) -> Tensor:
    """Develops raw frames by Petzval's automotive ISP in floating point, with gradients by frames and parameters.

    Args:
        raw: Digital numbers proportional to light, ``[y, x]`` or ``[frame, y, x]``; sides are even and at least 16. Numbers that are not floating
            are taken in torch's default type.
        parameters: Values of all parameters in their own units, in the order of ``isp.parameters``: ``[parameter]``, or ``[frame, parameter]``
            for values of each frame; those of `isp` at the gain of `frame` if left out.
        isp: The ISP: its methods count, and its values where `parameters` is left out.
        frame: What is known of the frames: levels, colours, noise. Pixels of a `RawFrame` do not count.

    Returns:
        Pictures, sRGB-encoded, about 0 to 1, ``[3, y, x]`` or ``[frame, 3, y, x]``, of the device and the type of `raw`.

    Raises:
        InputError: A shape is wrong, a number is not finite, or a parameter is out of its range.
    """
    raw, one = _batched(raw)
    isp, known = _checked(isp), _known(frame)
    if parameters is None:
        parameters = torch.from_numpy(isp.values(known.gain_ev)).to(raw.device)
    if of_class("parameters", parameters, Tensor, "give a tensor").dim() not in (1, 2):
        raise setting("parameters", f"of shape {tuple(parameters.shape)}", "has the wrong shape", "give [parameter] or [frame, parameter]")
    parameters = parameters.expand(raw.shape[0], parameters.shape[-1])
    picture: Tensor = _Forward.apply(raw, parameters, _number(isp, known), "develop")
    return picture[0] if one else picture


def develop_linear(raw: Tensor, illumination: Tensor | None = None, *, isp: LinearIsp) -> Tensor:
    """Develops raw frames to linear light, with gradients by frames and relative illumination.

    Args:
        raw: Digital numbers, ``[y, x]`` or ``[frame, y, x]``. Numbers that are not floating are taken in torch's default type.
        illumination: Relative illumination that the lens gives the pixels, ``[3, y, x]`` or ``[frame, 3, y, x]``; none leaves the shading.
        isp: Sensor, exposure and methods. Its method of demosaicing has no gradient if it is ``rcd``.

    Returns:
        Linear sRGB, 1 = white, ``[3, y, x]`` or ``[frame, 3, y, x]``, of the device and the type of `raw`.

    Raises:
        InputError: A shape is wrong, or a number is not finite.
    """
    raw, one = _batched(raw)
    of_class("isp", isp, LinearIsp, "petzval.LinearIsp(sensor, white_e=ELECTRONS) makes one")
    shape = (raw.shape[0], 3, *raw.shape[1:])
    if illumination is None:
        illumination = raw.new_ones((1, 1, 1, 1))
    elif tuple(of_class("illumination", illumination, Tensor, "give a tensor").shape) not in (shape, shape[1:]):
        hint = f"give {shape[1:]} or {shape}"
        raise setting("illumination", f"of shape {tuple(illumination.shape)}", "has the wrong shape", hint)
    picture: Tensor = _Forward.apply(raw, illumination.expand(shape), _number_linear(isp), "develop_linear")
    return picture[0] if one else picture


class _Bounded(torch.autograd.Function):
    """Places moved to 0..1. Beyond a bound only derivatives pass that lead back from it, so that descent stays free to return."""

    generate_vmap_rule = True

    @staticmethod
    def forward(places: Tensor) -> Tensor:
        return places.clamp(0.0, 1.0)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        ctx.save_for_backward(*inputs)

    @staticmethod
    def backward(ctx: Any, cotangent: Tensor) -> Tensor:
        (places,) = ctx.saved_tensors
        leads_out = ((places <= 0.0) & (cotangent > 0.0)) | ((places >= 1.0) & (cotangent < 0.0))
        return torch.where(leads_out, torch.zeros_like(cotangent), cotangent)


_STATED = {
    "varied": "the parameters that vary, or their bounds,",
    "held": "values of parameters that do not vary",
    "gain_ev": "the frame and its gain",
}
"""What the state of an `Isp` says of itself, in words."""


class Isp(nn.Module):
    """Petzval's automotive ISP as a module: its parameters move inside their ranges.

    The parameter of the module is `places`, ``[varied]``: where each varied parameter of the ISP lies in its range, 0 to 1, by equal
    differences or, of scale ``log``, by equal ratios. Petzval's own training moves the same places. What a step moves beyond a bound counts as
    the bound, and derivatives that lead further out are zero.

    It stays float64 whatever the rest of a model is cast to (``.half()``, ``.to(torch.bfloat16)``): cast the raw frames instead. A state is loaded
    only by a module with the same varied parameters, the same values of all others, and the same gain of the frame.

        >>> chip = petzval.torch.Isp(petzval.Isp.load("quality"), frame=info, vary=["sharpen", "gamma.exponent"])
        >>> optimizer = torch.optim.Adam(chip.parameters(), lr=0.02)

    Args:
        isp: Where it starts: its values at the gain of `frame`.
        frame: What is known of the frames.
        vary: What varies: names of parameters, of arrays, of stages, or ``"all"``.

    Raises:
        InputError: There is no such parameter.
    """

    places: nn.Parameter
    _values: Tensor
    _varied: Tensor
    _low: Tensor
    _width: Tensor
    _is_log: Tensor
    _ratio: Tensor

    def __init__(self, isp: _Isp, *, frame: FrameInfo | RawFrame, vary: Sequence[str] = ("all",)) -> None:
        super().__init__()
        isp, known = _checked(isp), _known(frame)
        self._isp = isp.at_gain(known.gain_ev)
        self._about, self._gain_ev = known._about, known.gain_ev
        self._number = _number(self._isp, known)
        rows = list(self._isp.parameters.values())
        varied = self._isp._core.places([vary] if isinstance(vary, str) else list(vary))
        self.varied = tuple(rows[i].name for i in varied)
        """Names of the parameters that vary, in the order of `places`."""
        low, high = np.array([[rows[i].min, rows[i].max] for i in varied]).T
        is_log = np.array([rows[i].scale == "log" for i in varied])
        value = np.array([rows[i].value for i in varied])
        ratio = np.log(np.where(is_log, high, 1.0) / np.where(is_log, low, 1.0))
        share = np.log(np.where(is_log, value, 1.0) / np.where(is_log, low, 1.0)) / np.where(is_log, ratio, 1.0)
        places = np.where(is_log, share, (value - low) / (high - low))
        self.places = nn.Parameter(torch.from_numpy(places))
        for name, numbers in (
            ("_values", self._isp.values()),
            ("_varied", np.array(varied)),
            ("_low", low),
            ("_width", high - low),
            ("_is_log", is_log),
            ("_ratio", ratio),
        ):
            self.register_buffer(name, torch.from_numpy(numbers), persistent=False)

    def values(self) -> Tensor:
        """The values of all parameters in their own units, ``[parameter]``, on the graph."""
        place = _Bounded.apply(self.places)
        by_ratio = self._low * torch.exp(place * self._ratio)
        value = torch.where(self._is_log, by_ratio, self._low + place * self._width)
        found: Tensor = self._values.to(value.dtype).scatter(0, self._varied, value)
        return found

    def forward(self, raw: Tensor) -> Tensor:
        """Develops raw frames, as `petzval.torch.develop` does, to ``[3, y, x]`` or ``[frame, 3, y, x]``."""
        raw, one = _batched(raw)
        values = self.values()
        picture: Tensor = _Forward.apply(raw, values.expand(raw.shape[0], -1), self._number, "develop")
        return picture[0] if one else picture

    def isp(self) -> _Isp:
        """The ISP with the present values: to develop in whole numbers, or to save."""
        # Rounding may bring a value out of its range.
        values = self.values().detach()[self._varied].clamp(self._low, self._low + self._width)
        return self._isp.with_(dict(zip(self.varied, values.tolist(), strict=True)))

    def get_extra_state(self) -> dict[str, Any]:
        """What the places stand for: a state is loaded only by a module with the same."""
        rows = self._isp.parameters
        varied = [[name, rows[name].min, rows[name].max, rows[name].scale] for name in self.varied]
        held = [[name, float(row.value)] for name, row in rows.items() if name not in self.varied]
        return {"varied": varied, "held": held, "gain_ev": [[self._gain_ev]]}

    def set_extra_state(self, state: dict[str, Any]) -> None:
        for key, what in _STATED.items():
            mine = self.get_extra_state()[key]
            if not isinstance(state, dict) or not alike(state.get(key), mine):
                raise InputError(
                    f"state: {what} are not as in this petzval.torch.Isp",
                    place=Place(key="state"),
                    hint="make the module with the ISP, the frame and `vary` with which the state was saved",
                )

    def _load_from_state_dict(self, state_dict: dict[str, Any], prefix: str, *rest: Any) -> None:
        extra, places = f"{prefix}_extra_state", f"{prefix}places"
        # Before the places are overwritten.
        if extra in state_dict:
            self.set_extra_state(state_dict[extra])
        elif places in state_dict:
            warnings.warn(
                "a state of an earlier version does not say of which parameters of the ISP it holds the places: those of this module are assumed",
                PetzvalWarning,
                stacklevel=2,
            )
            state_dict[extra] = self.get_extra_state()
        # With ``assign=True`` the tensor itself becomes the parameter.
        if isinstance(state_dict.get(places), Tensor):
            state_dict[places] = state_dict[places].to(torch.float64)
        super()._load_from_state_dict(state_dict, prefix, *rest)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Isp:
        super()._apply(keeping_types(fn), recurse)
        return self

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        if "_about" not in state:
            hint = "make the module anew, with its frame, and load its state_dict()"
            raise InputError("petzval.torch.Isp: pickled by an earlier version, which left out what is known of the frame", hint=hint)
        # Another process counts its ISPs anew.
        self._number = _numbered(self._isp, self._about, lambda: RawFrame._of_about(self._about))

    def extra_repr(self) -> str:
        return f"vary={list(self.varied)}"


def _batched(raw: Tensor) -> tuple[Tensor, bool]:
    """Raw frames ``[frame, y, x]`` of a floating type, and whether there is one without an axis of frames."""
    if of_class("raw", raw, Tensor, "give a tensor, such as torch.from_numpy(array)").dim() not in (2, 3):
        raise setting("raw", f"of shape {tuple(raw.shape)}", "has the wrong shape", "give [y, x] or [frame, y, x]")
    if raw.is_complex() or raw.dtype == torch.bool:
        raise setting("raw", f"of type {raw.dtype}", "holds no digital numbers", "give real numbers")
    if not raw.is_floating_point():
        raw = raw.to(torch.get_default_dtype())
    return (raw[None], True) if raw.dim() == 2 else (raw, False)


def _checked(isp: _Isp) -> _Isp:
    return of_class("isp", isp, _Isp, "petzval.Isp.load(PRESET) gives one")


def _known(frame: FrameInfo | RawFrame) -> RawFrame:
    of_class("frame", frame, (FrameInfo, RawFrame), "a petzval.FrameInfo or petzval.RawFrame")
    return frame if isinstance(frame, RawFrame) else RawFrame.like(frame)


@torch.compiler.assume_constant_result
def _number(isp: _Isp, frame: RawFrame) -> int:
    """The number of an ISP's methods for frames of a camera."""
    return _numbered(isp, frame._about, lambda: frame)


def _numbered(isp: _Isp, about: str, frame: Callable[[], RawFrame]) -> int:
    """The number of an ISP's methods for frames of which this is known; `frame` makes one if there is no number yet."""
    return _KEPT.number((isp.demosaic, isp.domain, about), lambda: (isp._core, frame()._core.without_pixels()))


@torch.compiler.assume_constant_result
def _number_linear(isp: LinearIsp) -> int:
    return _KEPT.number(isp._plan, lambda: isp._core)
