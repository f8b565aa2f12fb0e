"""Glasses of the catalogues."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _petzval, jobs
from ._arguments import paths_of, real, reals, text
from ._watch import watch
from .cameras import _known

__all__ = ["Glass"]

Array = NDArray[np.float64]
Paths = Sequence[str | os.PathLike[str]]


class Glass:
    """A glass of a catalogue.

    Args:
        name: Its name, or ``MAKER:NAME`` where several makers have one of that name.
        glasses: Glass catalogues (``.agf``, ``.toml``, ``.yml`` or folders) whose glasses take precedence.

    Raises:
        InputError: There is no such glass; the hint has the nearest names.
    """

    def __init__(self, name: str, *, glasses: Paths = ()) -> None:
        self._name = text("name", name, 'the name of a glass, such as "N-BK7" or "SCHOTT:N-BK7"')
        self._glasses = paths_of("glasses", glasses)
        with watch() as watching:
            self._core = _petzval.Glass(name, self._glasses, watching)

    @classmethod
    def find(
        cls,
        nd: float,
        vd: float,
        *,
        count: int | None = None,
        maker: str | None = None,
        obsolete: bool | None = None,
        glasses: Paths = (),
    ) -> list[Glass]:
        """The glasses nearest to an index and an Abbe number, the nearest first: 0.01 of index counts as much as 1 of Abbe number.

        Args:
            nd: Index at the d line, 587.6 nm, 1 to 5.
            vd: Abbe number ``(nd - 1) / (nF - nC)``, 1 to 1000.
            count: How many; as many as the command prints if left out.
            maker: Only glasses of this maker: any part of the name.
            obsolete: Whether obsolete glasses count too.
            glasses: Glass catalogues whose glasses take precedence.

        Raises:
            InputError: A number is out of its range, or there is no glass of this maker.
        """
        request = _known(nd=nd, vd=vd, count=count, maker=maker, obsolete=obsolete)
        rows = jobs.run("glass-find", request, glasses=glasses)["glasses"]
        return [cls(f"{row['maker']}:{row['name']}" if row["maker"] else row["name"], glasses=glasses) for row in rows]

    @staticmethod
    def rows(maker: str | None = None, *, glasses: Paths = ()) -> list[dict[str, Any]]:
        """Every glass, one dict each: ``name``, ``maker``, ``status``, ``nd``, ``vd``, ``printed_nd``, ``printed_vd``, ``agrees_with_print``, ``range_um``.

        Args:
            maker: Only glasses of this maker: any part of the name.
            glasses: Glass catalogues whose glasses take precedence.
        """
        found: list[dict[str, Any]] = jobs.run("glass-list", _known(maker=maker), glasses=glasses)["glasses"]
        return found

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Every figure that ``petzval glass show`` prints, by name."""
        found: dict[str, Any] = jobs.run("glass-show", {"name": self._name}, glasses=self._glasses)["glass"]
        return found

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.figures["name"])

    @property
    def maker(self) -> str:
        """Its maker; may be empty."""
        return str(self.figures["maker"])

    @property
    def nd(self) -> float:
        """Index at the d line, 587.6 nm; NaN where the formula does not hold there."""
        return _or_nan(self.figures["nd"])

    @property
    def vd(self) -> float:
        """Abbe number ``(nd - 1) / (nF - nC)``; NaN without dispersion, or where the formula does not hold."""
        return _or_nan(self.figures["vd"])

    @property
    def range_um(self) -> tuple[float, float]:
        """Wavelengths between which the formula holds, um; from 0 to infinity where the catalogue does not state them."""
        low, high = self.figures["range_um"] or (0.0, math.inf)
        return float(low), float(high)

    def index(self, wavelengths_um: ArrayLike) -> Array:
        """Refractive index relative to air, at the temperature of the catalogue.

        Args:
            wavelengths_um: Wavelengths, um, any shape; inside `range_um`.

        Returns:
            The indices, of the same shape.

        Raises:
            InputError: The formula does not hold at a wavelength.
        """
        um = reals("wavelengths_um", wavelengths_um)
        return self._core.index(um.reshape(-1)).reshape(um.shape)

    def transmission(self, wavelengths_um: ArrayLike, *, path_mm: float) -> Array:
        """Internal transmittance, 0 to 1; NaN where the catalogue does not state it.

        Args:
            wavelengths_um: Wavelengths, um, any shape; inside `range_um`.
            path_mm: Length of the path in the glass, mm.

        Raises:
            InputError: The formula does not hold at a wavelength, or the path is negative.
        """
        um = reals("wavelengths_um", wavelengths_um)
        return self._core.transmission(um.reshape(-1), real("path_mm", path_mm, "in mm, 0 or more")).reshape(um.shape)

    def __repr__(self) -> str:
        return f"<Glass {self.name!r} of {self.maker or 'no maker'}: nd {self.nd:.5f}, Vd {self.vd:.2f}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Glass) and (self.figures, self._glasses) == (other.figures, other._glasses)

    def __hash__(self) -> int:
        return hash((self.maker, self.name))

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self._name, self._glasses)


def _again(name: str, glasses: list[str]) -> Glass:
    return Glass(name, glasses=glasses)


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
