"""What Petzval brings: lenses and sensors by name."""

from __future__ import annotations

from typing import Any

from . import jobs

__all__ = ["list_lenses", "list_sensors"]


def list_lenses() -> list[dict[str, Any]]:
    """The built-in lenses, one dict each: ``name``, ``lens``, ``surfaces``, ``efl_mm``, ``f_number``, ``field_deg``, ``source``."""
    found: list[dict[str, Any]] = jobs.run("lens-list")["lenses"]
    return found


def list_sensors() -> list[dict[str, Any]]:
    """The built-in sensors, one dict each: ``name``, ``sensor``, ``width``, ``height``, ``pixel_um``, ``bits``, ``cfa``, ``full_well_e``,
    ``read_noise_e``, ``source``.
    """
    found: list[dict[str, Any]] = jobs.run("sensor-list")["sensors"]
    return found
