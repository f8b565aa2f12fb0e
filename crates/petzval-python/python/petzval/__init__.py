"""Petzval: a camera designed as one thing. Exact lenses, sensors, image signal processors and networks, from Python.

Arrays are NumPy's, pictures are ``[y, x]`` or ``[y, x, channel]``, names carry their units, and wrong arguments raise `InputError`.
"""

from . import jobs
from ._errors import InputError, PetzvalError, PetzvalWarning, Place, Stopped
from ._petzval import Cancel, set_threads, threads
from .isp import Isp, IspParameter, develop
from .lens import DesignSpace, Lens, Surface, Variable
from .linear_isp import LinearIsp
from .psfs import PsfBank, psf
from .raw_frame import FrameInfo, RawFrame
from .rendering import Distortion, FieldPsfs, Wiener, blend_error, patches_for, render, restore
from .sensors import FixedPattern, Sensor
from .weights import Weights

__all__ = [
    "Cancel",
    "DesignSpace",
    "Distortion",
    "FieldPsfs",
    "FixedPattern",
    "FrameInfo",
    "InputError",
    "Isp",
    "IspParameter",
    "Lens",
    "LinearIsp",
    "PetzvalError",
    "PetzvalWarning",
    "Place",
    "PsfBank",
    "RawFrame",
    "Sensor",
    "Stopped",
    "Surface",
    "Variable",
    "Weights",
    "Wiener",
    "blend_error",
    "develop",
    "jobs",
    "patches_for",
    "psf",
    "render",
    "restore",
    "set_threads",
    "threads",
]
