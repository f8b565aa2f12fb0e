"""Units of work as jobs of submitit, on Slurm or on this machine. A preempted job goes on from the checkpoints of its units. Needs submitit."""

# %% What a job does: its share of the units, by the command.
import os
import signal
import subprocess
import sys

import submitit


class Units:
    """Runs a share of the units of a file. What is finished in the store is passed over, what has a checkpoint goes on."""

    def __init__(self, units: str, store: str, shard: str) -> None:
        self.words = [sys.executable, "-m", "petzval", "unit", "run", units, "--store", store, "--shard", shard]

    def __call__(self) -> int:
        child = subprocess.Popen(self.words)
        self.pid = child.pid
        return child.wait()

    def checkpoint(self) -> submitit.helpers.DelayedSubmission:
        """submitit calls it before a preemption and before the end of the time, and submits again what it returns."""
        os.kill(self.pid, signal.SIGTERM)
        os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)
        return submitit.helpers.DelayedSubmission(self)


# %% Submission. On a cluster, `cluster=None` finds Slurm.
def submit(units: str, store: str, jobs: int = 2, cluster: str | None = None, **slurm: object) -> list[submitit.Job]:
    """Shares the units out among jobs."""
    executor = submitit.AutoExecutor(folder=f"{store}-submitit", cluster=cluster, slurm_max_num_timeout=100)
    executor.update_parameters(timeout_min=240, cpus_per_task=1, **slurm)
    return [executor.submit(Units(units, store, f"{job}/{jobs}")) for job in range(jobs)]


# %% The same from a shell.
if __name__ == "__main__":
    for job in submit(*sys.argv[1:3]):
        print(job.job_id, "ended with exit code", job.result())
