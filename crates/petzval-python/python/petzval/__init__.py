"""Petzval: a camera designed as one thing. Exact lenses, sensors, image signal processors and networks, from Python.

Arrays are NumPy's, pictures are ``[y, x]`` or ``[y, x, channel]``, names carry their units, and wrong arguments raise `InputError`.
"""

from . import jobs
from ._errors import InputError, PetzvalError, PetzvalWarning, Place, Stopped
from ._petzval import Cancel, set_threads, threads
from .lens import DesignSpace, Lens, Surface, Variable
from .psfs import PsfBank, psf

__all__ = [
    "Cancel",
    "DesignSpace",
    "InputError",
    "Lens",
    "PetzvalError",
    "PetzvalWarning",
    "Place",
    "PsfBank",
    "Stopped",
    "Surface",
    "Variable",
    "jobs",
    "psf",
    "set_threads",
    "threads",
]
