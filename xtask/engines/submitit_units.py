"""submitit: units as jobs of its local executor, by the example of the Python package. One job is interrupted as a preemption does it.

Called by `cargo xtask engines` with the folder of the examples, the file of units and the store.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

EXAMPLES, UNITS, STORE = sys.argv[1:]
# The jobs load the class of the example as well.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [EXAMPLES, os.environ.get("PYTHONPATH")]))
sys.path.insert(0, EXAMPLES)

import units_with_submitit as example

jobs = example.submit(UNITS, STORE, cluster="local")
began = time.monotonic()
while not list(Path(STORE).glob("*/**/search.json")):
    assert time.monotonic() - began < 300, "no checkpoint"
    time.sleep(0.05)
running = next(job for job in jobs if job.state == "RUNNING")
# The process of the job itself is below the one that watches it.
found = subprocess.run(["pgrep", "-P", str(running._process.pid)], capture_output=True, text=True, check=True)
os.kill(int(found.stdout.split()[0]), signal.SIGUSR2)
finished = [job.result() for job in jobs]
assert all(code == 0 for code in finished), finished
said = "".join(Path(job.paths.stderr).read_text() for job in jobs)
assert "with a checkpoint" in said, said
print(f"{len(jobs)} jobs, one was interrupted and submitted again")
