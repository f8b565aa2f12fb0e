"""What happens while work goes on: warnings, notes, progress and cancelling."""

from __future__ import annotations

import json
import logging
import sys
import warnings
from collections.abc import Callable
from typing import Any

from ._errors import PetzvalWarning, setting
from ._petzval import Cancel

_LOG = logging.getLogger("petzval")

Event = dict[str, Any]
"""What a job says, with its kind under ``event``: ``progress`` with ``done``, ``total`` and ``text``; ``step`` with losses; ``camera``; ``file``.

``figures`` of a ``note`` or ``progress`` has the numbers of its text by name, such as ``merit_um``; the key is missing where there are none.
"""

Progress = bool | Callable[[Event], object]
"""``True`` shows a bar (tqdm where it is installed); a function gets every event."""

_Watch = tuple[Callable[[str], None] | None, Cancel | None]


class _Bar:
    """A progress bar; without tqdm, lines on stderr by logging."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            self._new: Any = None
        else:
            self._new = tqdm
        self._bar: Any = None

    def __call__(self, event: Event) -> None:
        done, total, text = _how_far(event)
        if total == 0:
            return
        if self._new is None:
            _LOG.info("%d of %d %s", done, total, text)
            return
        if self._bar is None or self._bar.total != total:
            self.close()
            self._bar = self._new(total=total, leave=False)
        self._bar.set_description_str(text, refresh=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _how_far(event: Event) -> tuple[int, int, str]:
    if event["event"] == "progress":
        return event["done"], event["total"], event["text"]
    if event["event"] == "step":
        return event["step"], event["total"], f"{event['camera']}: {event['block']}"
    if event["event"] == "scoring":
        return event["done"], event["total"], f"{event['camera']}: windows scored"
    return 0, 0, ""


class watch:
    """The last argument of every function of the binary part, for the time of one call.

    Warnings become `PetzvalWarning`, notes go to the logger ``petzval``. Both come from the thread that called.
    """

    def __init__(self, progress: Progress = False, cancel: Cancel | None = None) -> None:
        if not (isinstance(progress, bool) or callable(progress)):
            raise setting("progress", repr(progress), "shows nothing", "True, False or a function that takes an event")
        if not (cancel is None or isinstance(cancel, Cancel)):
            raise setting("cancel", repr(cancel), "is no flag", "make one by petzval.Cancel()")
        self._bar = _Bar() if progress is True else None
        self._listener = progress if callable(progress) else self._bar
        self._cancel = cancel

    def __enter__(self) -> _Watch:
        return self._hear, self._cancel

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def _hear(self, text: str) -> None:
        event: Event = json.loads(text)
        match event["event"]:
            case "warning":
                warnings.warn(event["text"], PetzvalWarning, stacklevel=_level_of_caller())
            case "note":
                _LOG.info("%s", event["text"])
        if self._listener is not None:
            self._listener(event)


def _level_of_caller() -> int:
    """The level, as `warnings.warn` counts it, of the first frame outside of the package: a warning shows the line of the user."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == __package__:
        frame, level = frame.f_back, level + 1
    return level
