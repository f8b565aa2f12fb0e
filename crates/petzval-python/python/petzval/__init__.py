"""Petzval: a camera designed as one thing. Exact lenses, sensors, image signal processors and networks, from Python.

Arrays are NumPy's, pictures are ``[y, x]`` or ``[y, x, channel]``, names carry their units, and wrong arguments raise `InputError`.
"""

from . import data, jobs
from ._errors import InputError, PetzvalError, PetzvalWarning, Place, Stopped
from ._petzval import Cancel, __version__
from ._pictures import read_picture
from ._threads import set_threads, threads
from .built_in import list_lenses, list_sensors
from .cameras import Camera, Frames
from .detectors import Detections, Detector
from .glass import Glass
from .isp import Isp, IspParameter, develop
from .lens import DesignSpace, Lens, Surface, Variable
from .linear_isp import LinearIsp
from .psfs import PsfBank, psf
from .raw_frame import FrameInfo, RawFrame
from .rendering import Distortion, FieldPsfs, Wiener, blend_error, patches_for, render, restore
from .runs import Finished, Run, RunCamera, RunPicture
from .sensors import FixedPattern, Sensor
from .sheets import Figure, Sheet, characterize
from .weights import Weights

__all__ = [
    "Camera",
    "Cancel",
    "DesignSpace",
    "Detections",
    "Detector",
    "Distortion",
    "FieldPsfs",
    "Figure",
    "Finished",
    "FixedPattern",
    "FrameInfo",
    "Frames",
    "Glass",
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
    "Run",
    "RunCamera",
    "RunPicture",
    "Sensor",
    "Sheet",
    "Stopped",
    "Surface",
    "Variable",
    "Weights",
    "Wiener",
    "__version__",
    "blend_error",
    "characterize",
    "data",
    "develop",
    "jobs",
    "list_lenses",
    "list_sensors",
    "patches_for",
    "psf",
    "read_picture",
    "render",
    "restore",
    "set_threads",
    "threads",
]
