"""Ray: units as tasks, with `petzval.ray`. The process of a task is killed; Ray starts it again, and it goes on from its checkpoint.
Then the script that a sweep writes runs the same units in a store of its own.

Called by `cargo xtask engines` with the file of units, the store and that script.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import petzval.ray
import ray

UNITS, STORE, SCRIPT = sys.argv[1:]
killed: list[int] = []


def worker_of_a_task() -> int | None:
    """The process of Ray whose child works on a unit that has a checkpoint."""
    if not list(Path(STORE).glob("*/**/search.json")):
        return None
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().decode().split("\0")
            if "unit" in words and STORE in words:
                return int((path.parent / "stat").read_text().rsplit(") ", 1)[1].split()[1])
        except OSError:
            continue
    return None


def kill_one() -> None:
    while not killed:
        time.sleep(0.05)
        worker = worker_of_a_task()
        if worker is not None:
            os.kill(worker, signal.SIGKILL)
            killed.append(worker)


ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
threading.Thread(target=kill_one, daemon=True).start()
results = petzval.ray.run_units(UNITS, store=STORE, num_cpus=1)
assert killed, "no process of a task was killed"
count = len(Path(UNITS).read_text().split("\n")) - 1
assert len(results) == count and all(result.error is None for result in results), results
assert len({result.key for result in results}) == count
again = petzval.ray.run_units(UNITS, store=STORE, num_cpus=1)
assert [result.response for result in again] == [result.response for result in results]
ray.shutdown()
subprocess.run([sys.executable, SCRIPT], check=True)
scripted = Path(SCRIPT).parent
of_script = petzval.ray.results(scripted / "units.jsonl", store=scripted)
assert [(r.name, r.response, r.error) for r in of_script] == [(r.name, r.response, r.error) for r in results]
print(f"{count} units, one process of a task was killed; the script of a sweep gives the same")
