"""How many threads work has."""

from . import _petzval
from ._arguments import count
from ._errors import setting


def set_threads(threads: int) -> None:
    """Chooses how many threads the next work has. Results do not depend on it.

    Args:
        threads: How many, at most 1024; 0 means one for each core.

    Raises:
        InputError: It is no number of threads.
    """
    _petzval.set_threads(threads_of(threads))


def threads_of(threads: int) -> int:
    """A number of threads, checked."""
    hint = f"a whole number, 0 to {_petzval.MOST_THREADS}; 0 means one for each core"
    number = count("threads", threads, hint)
    if number > _petzval.MOST_THREADS:
        raise setting("threads", str(number), "is too large", hint)
    return number


def threads() -> int:
    """How many threads work of this process has."""
    return _petzval.threads()
