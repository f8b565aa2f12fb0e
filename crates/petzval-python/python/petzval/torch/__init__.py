"""Petzval for PyTorch."""

from .expose import expose
from .render import illumination_map, project, render
from .restore import restore

__all__ = [
    "expose",
    "illumination_map",
    "project",
    "render",
    "restore",
]
