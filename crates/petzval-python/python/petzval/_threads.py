"""How many threads work has."""

from . import _petzval
from ._arguments import count


def set_threads(threads: int) -> None:
    """Chooses how many threads the next work has. Results do not depend on it.

    Args:
        threads: How many; 0 means one for each core.

    Raises:
        InputError: It is no number of threads.
    """
    _petzval.set_threads(count("threads", threads))


def threads() -> int:
    """How many threads work of this process has."""
    return _petzval.threads()
