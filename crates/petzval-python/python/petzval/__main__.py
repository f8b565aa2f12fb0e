"""The command: ``python -m petzval`` and ``petzval`` are the same."""

import os
import signal
import sys

from . import _petzval


def main() -> None:
    """Runs the command with the words of the command line, and ends with its exit code."""
    # The command handles interrupts itself: it ends with a checkpoint.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Classes of an experiment run in the Python that has the command.
    os.environ.setdefault("PETZVAL_PYTHON", sys.executable)
    sys.exit(_petzval.command(["petzval", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
