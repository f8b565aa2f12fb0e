"""Interrupts, forks and the command: each in a process of its own."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import petzval as pz
from petzval._errors import Place


def _rms(field: float) -> float:
    return float(pz.Lens.load("cooke-triplet-nominal").spots([field]).rms_um[0])


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_a_child_process_has_threads_of_its_own(method: str) -> None:
    wanted = [_rms(field) for field in (0.0, 5.0)]
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map_async(_rms, [0.0, 5.0]).get(timeout=60) == wanted


def _exceptions(of: type[pz.PetzvalError] = pz.PetzvalError) -> list[type[pz.PetzvalError]]:
    return [of, *(further for each in of.__subclasses__() for further in _exceptions(each))]


def _made(kind: type[pz.PetzvalError]) -> pz.PetzvalError:
    place = Place(path=Path("a.toml"), line=3, key="pixel_um", value="0")
    error = kind("a.toml:3: out of range", message="out of range", place=place, hint="above 0", kind="file")
    if isinstance(error, pz.Stopped):
        error.kept, error.resume = [Path("best.toml")], {"start": {"resume": {"folder": "a"}}}
    return error


def _raise(kind: type[pz.PetzvalError]) -> None:
    raise _made(kind)


def _raise_stopped(_: int) -> None:
    cancel = pz.Cancel()
    cancel.set()
    pz.Lens.load("cooke-triplet-nominal").tolerance(trials=10, cancel=cancel)


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_exceptions_come_back_from_other_processes(method: str) -> None:
    assert pz.Stopped in _exceptions() and pz.InputError in _exceptions()
    with multiprocessing.get_context(method).Pool(1) as pool:
        for kind in _exceptions():
            wanted = _made(kind)
            with pytest.raises(pz.PetzvalError) as caught:
                pool.map_async(_raise, [kind]).get(timeout=60)
            found = caught.value
            assert type(found) is kind and str(found) == str(wanted) and vars(found) == vars(wanted)
        with pytest.raises(pz.Stopped) as stopped:
            pool.map_async(_raise_stopped, [0]).get(timeout=60)
        assert stopped.value.kind == "stopped"


def test_an_interrupt_stops_a_job() -> None:
    code = """
import petzval, signal
# A shell that starts the tests in the background lets its children ignore interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
print("ready", flush=True)
try:
    petzval.jobs.run("lens-tolerance", {"lens": "cooke-triplet-nominal", "trials": 1000000})
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None and child.stdout.readline() == "ready\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    try:
        said, _ = child.communicate(timeout=60)
    finally:
        child.kill()
    assert said == "interrupted\n" and child.returncode == 0


def test_a_unit_of_another_instruction_set_starts_in_the_same_environment(tmp_path) -> None:
    request = {"lens": "cooke-triplet-nominal", "field": 5, "wavelength": 0.55, "pupil": [0, 1]}
    unit = {"name": "a", "simd": "scalar", "call": {"format": 1, "job": "lens-trace", "request": request}}
    (tmp_path / "units.jsonl").write_text(json.dumps(unit) + "\n", encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if name != "PETZVAL_SIMD"}
    words = ["unit", "run", "units.jsonl", "--store", "store", "--threads", "1"]
    done = subprocess.run(
        [sys.executable, "-m", "petzval", *words], capture_output=True, text=True, cwd=tmp_path, env=environment
    )
    assert (done.returncode, done.stderr.count("No module")) == (0, 0), done.stderr
    (kept,) = (tmp_path / "store").glob("*/result.json")
    assert json.loads(kept.read_text(encoding="utf-8"))["unit"]["simd"] == "scalar"


def test_the_package_brings_the_command(tmp_path) -> None:
    def run(*words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([sys.executable, "-m", "petzval", *words], capture_output=True, text=True, cwd=tmp_path)

    shown = run("lens", "show", "cooke-triplet-nominal", "--json")
    assert shown.returncode == 0 and '"efl_mm"' in shown.stdout
    wrong = run("lens", "show", "no-such-lens")
    assert wrong.returncode == 2 and "no-such-lens" in wrong.stderr
    assert run("--version").stdout.startswith("petzval ")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_fork_while_a_thread_works_does_not_hang() -> None:
    code = """
import os, threading, petzval
lens = petzval.Lens.load("cooke-triplet-nominal")
lens.spots()
thread = threading.Thread(target=lambda: [lens.spots() for _ in range(20)])
thread.start()
child = os.fork()
if child == 0:
    lens.spots([0.0])
    os._exit(7)
_, status = os.waitpid(child, 0)
thread.join()
print(os.waitstatus_to_exitcode(status))
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout == "7\n"
