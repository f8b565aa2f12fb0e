"""HyperQueue: units as tasks of a cluster on this machine. A job is cancelled, the machine of another is lost, a third one finishes.

Called by `cargo xtask engines` with the command, the file of units and the store.
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

from hyperqueue import Job
from hyperqueue.cluster import LocalCluster, WorkerConfig

PETZVAL, UNITS, STORE = sys.argv[1:4]
COUNT = len(Path(UNITS).read_text().split("\n")) - 1
CORES = 2


def units(job: Job) -> Job:
    """One task a unit: which one, HQ_TASK_ID says."""
    for task in range(COUNT):
        job.program(
            [PETZVAL, "unit", "run", UNITS, "--store", STORE],
            stdout=f"{STORE}-{task}.out",
            stderr=f"{STORE}-{task}.log",
        )
    return job


def processes() -> list[int]:
    """Processes that work on units of the store."""
    found = subprocess.run(["pgrep", "-f", f"unit run {UNITS} --store {STORE}"], capture_output=True, text=True)
    return [int(word) for word in found.stdout.split()]


def checkpoints() -> set[Path]:
    return {path.parent for path in Path(STORE).glob("*/**/search.json")}


def results() -> int:
    return len(list(Path(STORE).glob("*/result.json")))


def wait_for(what: str, holds, seconds: float = 120) -> float:
    began = time.monotonic()
    while not holds():
        assert time.monotonic() - began < seconds, f"waited {seconds} s in vain for {what}"
        time.sleep(0.02)
    return time.monotonic() - began


def cancelled() -> float:
    """HyperQueue cancels a job one of whose tasks fails: SIGINT, and SIGKILL a second later."""
    marker = f"{STORE}.fails"
    with LocalCluster(worker_config=WorkerConfig(cores=CORES)) as cluster:
        job = Job(max_fails=0)
        units(job)
        # The task that fails when it is time, at once on a core of its own.
        job.program(["sh", "-c", f"while [ ! -e {marker} ]; do sleep 0.05; done; exit 1"], priority=1)
        submitted = cluster.client().submit(job)
        wait_for("a checkpoint", checkpoints)
        Path(marker).touch()
        assert not cluster.client().wait_for_jobs([submitted], raise_on_error=False)
        seconds = wait_for("the end of the cancelled tasks", lambda: not processes())
    assert checkpoints(), "the cancelled task has left no checkpoint"
    said = "".join(path.read_text() for path in Path(STORE).parent.glob(f"{Path(STORE).name}-*.log"))
    assert "with a checkpoint" in said, f"the cancelled task did not end by itself:\n{said}"
    return seconds


def lost() -> None:
    """The worker with its server dies at once, as with the power: the system ends its tasks."""
    machine = subprocess.Popen([sys.executable, *sys.argv, "machine"])
    wait_for("running tasks", lambda: len(processes()) == CORES)
    time.sleep(1)
    machine.kill()
    machine.wait()
    wait_for("the end of the tasks of the lost worker", lambda: not processes(), 10)
    assert results() < COUNT, "everything is finished already: nothing was lost"


def machine() -> None:
    """A server with its worker that runs the units until it is killed."""
    cluster = LocalCluster(worker_config=WorkerConfig(cores=CORES))
    cluster.client().submit(units(Job()))
    signal.pause()


def finished() -> None:
    with LocalCluster(worker_config=WorkerConfig(cores=CORES)) as cluster:
        client = cluster.client()
        client.wait_for_jobs([client.submit(units(Job(max_fails=None)))])
    assert results() == COUNT, f"{results()} results of {COUNT}"


def rate() -> float:
    """Units a minute, for units that do next to nothing."""
    file, store, count = f"{STORE}-rate.jsonl", f"{STORE}-rate", 200
    call = {"format": 1, "job": "glass-show"}
    requests = [{"name": "N-BK7", "temperature": 20 + task / 100} for task in range(count)]
    lines = [json.dumps({"name": f"glass-{task}", "call": call | {"request": requests[task]}}) for task in range(count)]
    Path(file).write_text("\n".join(lines) + "\n")
    with LocalCluster(worker_config=WorkerConfig(cores=CORES)) as cluster:
        job = Job()
        for _ in range(count):
            job.program([PETZVAL, "unit", "run", file, "--store", store], stdout=None, stderr=None)
        client = cluster.client()
        began = time.monotonic()
        client.wait_for_jobs([client.submit(job)])
        seconds = time.monotonic() - began
    assert len(list(Path(store).glob("*/result.json"))) == count
    return 60 * count / seconds


if sys.argv[4:] == ["machine"]:
    machine()
seconds = cancelled()
lost()
finished()
print(
    f"cancelled (tasks gone {seconds:.1f} s after the job's end), lost and finished: {COUNT} units; "
    f"200 units as tasks: {rate():.0f} a minute"
)
