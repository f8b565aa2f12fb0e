"""Modules whose numbers keep their types, whatever the rest of a model is cast to, and whose states name what they hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from torch import Tensor


def keeping_types(move: Callable[[Tensor], Tensor]) -> Callable[[Tensor], Tensor]:
    """What ``Module._apply`` does to each tensor, without its casts. Every cast of a module comes through there, also as part of a larger one."""

    def kept(tensor: Tensor) -> Tensor:
        # A device without float64 leaves the tensor where it is.
        try:
            moved = move(tensor)
        except TypeError:
            return tensor
        return moved if moved.dtype == tensor.dtype else tensor.to(moved.device)

    return kept


def alike(rows: Any, mine: list[list[Any]]) -> bool:
    """Whether rows of names and numbers are these, numbers up to rounding."""

    def near(a: Any, b: Any) -> bool:
        if isinstance(a, float) and isinstance(b, float):
            return abs(a - b) <= 1e-9 * max(abs(a), abs(b))
        return bool(a == b)

    if not isinstance(rows, (list, tuple)) or len(rows) != len(mine):
        return False
    pairs = zip(rows, mine, strict=True)
    return all(len(row) == len(my_row) and all(map(near, row, my_row)) for row, my_row in pairs)
