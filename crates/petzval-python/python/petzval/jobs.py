"""Every verb of the command: a request goes in, a response comes out.

    >>> import petzval
    >>> petzval.jobs.run("lens-show", {"lens": "cooke-triplet-nominal"})["figures"]["efl_mm"]

`petzval.requests` has the type of every request. Defaults are those of the command.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

from . import _petzval
from ._arguments import flag, json_of, of_class, paths_of, text
from ._petzval import Cancel
from ._threads import threads_of
from ._watch import Event, Progress, watch

__all__ = ["Cancel", "Event", "names", "run", "schema"]


def names() -> dict[str, str]:
    """Every job by name, with what it does."""
    return dict(_petzval.job_names())


def schema(name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """The JSON Schemas of a job's request and of its response.

    Raises:
        InputError: There is no such job.
    """
    request, response = _petzval.job_schemas(text("name", name, "the name of a job, one of petzval.jobs.names()"))
    return json.loads(request), json.loads(response)


def run(
    name: str,
    request: Mapping[str, Any] | None = None,
    *,
    glasses: Sequence[str | os.PathLike[str]] = (),
    overwrite: bool = False,
    threads: int = 0,
    progress: Progress = False,
    cancel: Cancel | None = None,
) -> dict[str, Any]:
    """Runs a job, and waits until it ends.

    Python's lock is free meanwhile: other threads go on. An interrupt, an exception of `progress`, and `cancel` stop the job at its next safe
    point, within a second as a rule; the exception is raised when it has stopped.

    Args:
        name: One of `names`, such as ``"lens-tolerance"``.
        request: Its keys; what is left out has the default of the command.
        glasses: Glass catalogues whose glasses take precedence over the built-in ones.
        overwrite: Whether results that are there already may be overwritten.
        threads: 0 means those of `petzval.set_threads`. Results do not depend on it.
        progress: ``True`` for a bar, or a function that takes every event.
        cancel: A flag that another thread may set.

    Returns:
        The response, as its schema says.

    Raises:
        InputError: The request, or a file that it names, is wrong.
        Stopped: The flag was set.
        PetzvalError: The job failed.
    """
    if request is not None:
        of_class("request", request, Mapping, 'keys and values, such as {"lens": "my.zmx"}')
    call = {
        "format": 1,
        "job": text("name", name, "the name of a job, one of petzval.jobs.names()"),
        "request": dict(request or {}),
        "glasses": paths_of("glasses", glasses),
        "overwrite": flag("overwrite", overwrite),
        "threads": threads_of(threads),
    }
    with watch(progress, cancel) as watching:
        response: dict[str, Any] = json.loads(_petzval.call(_json(call), watching))
    return response


def _json(value: Any) -> str:
    return json_of("request", value, "finite numbers, texts, lists, mappings, paths and arrays")
