"""Units of work on a cluster of Ray. Needs ray.

    >>> import petzval.ray
    >>> results = petzval.ray.run_units("units.jsonl", store="night", num_cpus=2)

The store is the truth: a unit that is finished there is not run again, one with a checkpoint goes on. So a task that is lost with its machine is
simply started again, and a driver that is lost is started again with the same lines. The store has to be on a file system that all machines have.

Set `RAY_grpc_client_keepalive_time_ms` and `RAY_grpc_client_keepalive_timeout_ms` to 2000 on every machine and for the driver: without them Ray
may wait for a machine whose network is cut as long as for one that works.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ray

from ._errors import InputError, Place

__all__ = ["UnitResult", "results", "run_units", "submit_units"]

# Exit codes of the command: some units have failed; a signal has stopped it after a checkpoint.
_FAILED = 1
_STOPPED = 75


class Interrupted(RuntimeError):
    """A task was stopped before its units were finished. Ray starts it again."""


@dataclass(frozen=True)
class UnitResult:
    """What became of a unit.

    Attributes:
        name: Its name in the file of units.
        key: Its key, the name of its folder in the store.
        response: The response of its job; ``None`` if it failed.
        error: Why it failed; ``None`` if it did not.
        files: The folder of the files that the job has written; ``None`` if it writes none.
    """

    name: str
    key: str
    response: dict[str, Any] | None
    error: str | None
    files: Path | None


def submit_units(
    units: str | os.PathLike[str],
    *,
    store: str | os.PathLike[str],
    tasks: int | None = None,
    num_cpus: int = 1,
    num_gpus: float = 0,
    resources: Mapping[str, float] | None = None,
    max_retries: int = -1,
) -> list[ray.ObjectRef[None]]:
    """Hands the units of a file to Ray, and returns at once.

    Args:
        units: The file of the units, one in each line, as `petzval sweep` writes it.
        store: The folder of the results, on a file system of all machines.
        tasks: Tasks among which the units are shared out; one a unit if it is left out.
        num_cpus: CPUs of a task: Ray places it where so many are free, and the units have so many threads.
        num_gpus: GPUs of a task, or a part of one.
        resources: Further resources of Ray that a task takes, by name.
        max_retries: How often Ray starts a task again whose process or machine was lost; -1 is without limit.

    Returns:
        A reference for each task; `ray.get` waits for it, and `results` has what came out.
    """
    file, place = Path(units).resolve(), Path(store).resolve()
    names = _names(file)
    count = len(names) if tasks is None else min(tasks, len(names))
    task = ray.remote(_run).options(
        num_cpus=num_cpus,
        num_gpus=num_gpus,
        resources=dict(resources or {}),
        max_retries=max_retries,
        retry_exceptions=[Interrupted],
    )
    return [task.remote(file, place, f"{index}/{count}", num_cpus) for index in range(count)]


def run_units(
    units: str | os.PathLike[str],
    *,
    store: str | os.PathLike[str],
    tasks: int | None = None,
    num_cpus: int = 1,
    num_gpus: float = 0,
    resources: Mapping[str, float] | None = None,
    max_retries: int = -1,
) -> list[UnitResult]:
    """Runs the units of a file on Ray, and waits for all. Arguments are those of `submit_units`.

    Returns:
        What became of each unit, in the order of the file. Units that failed are among them, with their `error`.
    """
    references = submit_units(
        units,
        store=store,
        tasks=tasks,
        num_cpus=num_cpus,
        num_gpus=num_gpus,
        resources=resources,
        max_retries=max_retries,
    )
    ray.get(references)
    return results(units, store=store)


def results(units: str | os.PathLike[str], *, store: str | os.PathLike[str]) -> list[UnitResult]:
    """What became of the units of a file that have ended, in its order.

    Raises:
        InputError: A `result.json` does not agree with its `sha256`: it was edited.
    """
    found = []
    for name, key in _keys(Path(units).resolve()):
        folder = Path(store) / key
        result, error = folder / "result.json", folder / "error.json"
        if result.is_file():
            kept = _kept(result)
            files = kept["files"] and folder / ("files" if (folder / "files").is_dir() else kept["files"])
            found.append(UnitResult(name, key, kept["response"], None, files))
        elif error.is_file():
            kept = json.loads(error.read_text(encoding="utf-8"))
            found.append(UnitResult(name, key, None, kept["error"]["message"], None))
    return found


class _Number(str):
    """A number as it stands in a text."""


def _kept(path: Path) -> dict[str, Any]:
    """The result of a unit. Fails if it does not agree with its `sha256`; results of early builds have none."""
    text = path.read_text(encoding="utf-8")
    kept: dict[str, Any] = json.loads(text)
    if "sha256" not in kept:
        return kept
    # The digest is that of the digits in the file: Python prints 1e-7 as 1e-07.
    rest = json.loads(text, parse_float=_Number, parse_int=_Number)
    del rest["sha256"]
    if hashlib.sha256(_canonical(rest).encode()).hexdigest() != kept["sha256"]:
        message = "this is not what the unit wrote: its content does not agree with its `sha256`"
        hint = "put it back from a copy, or run the unit again with --retry, which sets its folder aside"
        raise InputError(f"{path}: {message}", message=message, place=Place(path=path), hint=hint, kind="input")
    return kept


def _canonical(value: Any) -> str:
    """JSON without spaces and with sorted keys. Numbers are `_Number`."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{_canonical(key)}:{_canonical(value[key])}" for key in sorted(value)) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(_canonical, value)) + "]"
    return str(value) if isinstance(value, _Number) else json.dumps(value, ensure_ascii=False)


def _keys(file: Path) -> list[tuple[str, str]]:
    """The names of the units of a file with their keys, in its order.

    A store also holds units of other files and of earlier requests, which may have the same names.
    """
    listed = subprocess.run(
        [sys.executable, "-m", "petzval", "unit", "list", str(file), "--json"],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    if listed.returncode != 0:
        raise RuntimeError(f"petzval unit list {file}: exit code {listed.returncode}: {listed.stderr.strip()}")
    return [(unit["name"], unit["key"]) for unit in json.loads(listed.stdout)]


def _names(file: Path) -> list[str]:
    """The names of the units of a file, in its order. Lines end as the command sees them: other separators may stand in a name."""
    lines = file.read_text(encoding="utf-8").split("\n")
    return [json.loads(line)["name"] for line in lines if line.strip()]


def _simd(file: Path) -> str:
    """The value of PETZVAL_SIMD with which the command has the instruction set of the units."""
    with file.open(encoding="utf-8") as lines:
        level = str(json.loads(next(line for line in lines if line.strip())).get("simd", "avx2"))
    # The others are the widest of machines that have them.
    return level if level in ("avx2", "scalar") else "best"


def _run(file: Path, store: Path, shard: str, threads: int) -> None:
    """Runs a share of the units in a process of its own, so that their instruction set and their memory end with it."""
    words = ["unit", "run", str(file), "--store", str(store), "--shard", shard, "--threads", str(threads)]
    environment = {**os.environ, "PETZVAL_SIMD": _simd(file)}
    command = [sys.executable, "-m", "petzval", *words]
    code = subprocess.run(command, env=environment, preexec_fn=_end_with_parent).returncode
    if code == _STOPPED:
        raise Interrupted(f"shard {shard} of {file} was stopped after a checkpoint")
    if code not in (0, _FAILED):
        raise RuntimeError(f"petzval {' '.join(words)}: exit code {code}; the log of the task says why")


_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None
_PR_SET_PDEATHSIG = 1


def _end_with_parent() -> None:
    """Ray may end the process of a task at once. Linux then stops the command, which keeps a checkpoint."""
    if _LIBC is not None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
