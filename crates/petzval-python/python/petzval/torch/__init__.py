"""Petzval inside a PyTorch loop: lenses whose PSFs have exact gradients, light, sensors and development as operators. Needs PyTorch.

Rays are traced in float64 on the CPU; everything behind the PSFs but development runs where you put it.
"""

try:
    import torch as _torch  # noqa: F401
except ImportError as _error:
    raise ImportError("petzval.torch needs PyTorch 2.6 or newer: pip install 'petzval[torch]'") from _error

from . import models
from .develop import Isp, develop, develop_linear
from .expose import expose
from .lens import Lens, Psfs
from .levenberg import LevenbergMarquardt
from .network import Network
from .render import illumination_map, project, render
from .restore import restore

__all__ = [
    "Isp",
    "Lens",
    "LevenbergMarquardt",
    "Network",
    "Psfs",
    "develop",
    "develop_linear",
    "expose",
    "illumination_map",
    "models",
    "project",
    "render",
    "restore",
]
