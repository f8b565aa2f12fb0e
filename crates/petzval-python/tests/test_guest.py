"""Networks and losses of one's own in a design: in a process of their own, and in that of Petzval."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import petzval as pz
from petzval import _worker

GUESTS = Path(__file__).parent / "guests"

EXPERIMENT = """
task = "python"
[psf]
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
scoring_blend_error = 2.0
scoring_fields = 3
[network]
kind = "python"
[python]
timeout_s = 20.0
[python.network]
class = "NETWORK"
options = OPTIONS
[python.task]
class = "tiny_nets:Edges"
[training]
steps = 4
batch = 2
crop = 64
learning_rate = 0.002
[optics]
steps = 2
[spot]
iterations = 4
[scoring]
scores = ["edge_error", "psnr_db"]
places_per_side = 1
crop = 64
[checkpoint]
every = 2
"""


@pytest.fixture(autouse=True)
def guests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(GUESTS)
    path = os.pathsep.join(filter(None, [str(GUESTS), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("PYTHONPATH", path)
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(threads, "1")


def write(folder: Path, network: str = "tiny_nets:Restorer", options: str = "{ width = 4 }", **changes: str) -> Path:
    folder.mkdir(exist_ok=True)
    text = EXPERIMENT.replace("NETWORK", network).replace("OPTIONS", options)
    for old, new in changes.items():
        text = text.replace(f"{old} = ", f"{old} = {new} #")
    (folder / "tiny.toml").write_text(text)
    return folder / "tiny.toml"


def command(folder: Path, *words: str) -> "subprocess.Popen[str]":
    line = [sys.executable, "-m", "petzval", *words, "--threads", "1"]
    return subprocess.Popen(line, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def steps(run: Path) -> list[dict[str, object]]:
    path = run / "events.jsonl"
    lines = path.read_text().splitlines() if path.exists() else []
    return [json.loads(line) for line in lines if line.endswith("}")]


def digests(run: Path) -> dict[str, str]:
    files = [*(run / "cameras").rglob("*"), run / "metrics.json", run / "metrics.csv"]
    return {str(f.relative_to(run)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files if f.is_file()}


def is_gone(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return True
    return ") Z " in state


@pytest.mark.skipif(not Path("/proc").exists(), reason="looks at processes")
def test_three_cameras_killed_and_resumed_have_the_bits_of_an_uninterrupted_run_in_this_process(tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    write(tmp_path, "odd_nets:Marked", f'{{ width = 4, marks = "{marks}" }}')
    run = tmp_path / "killed"
    killed = command(tmp_path, "design", "tiny.toml", "--out", "killed")
    deadline = time.monotonic() + 120
    # In the middle of the second camera.
    while len(steps(run)) < 8 and killed.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    killed.send_signal(signal.SIGKILL)
    _, said = killed.communicate()
    assert killed.returncode == -signal.SIGKILL, said
    assert not (run / "metrics.json").exists() and "step at 0.002" in said
    # The worker was another process, and dies with its master.
    worker = int(marks.read_text())
    assert worker != killed.pid
    while not is_gone(worker) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert is_gone(worker)
    resumed = command(tmp_path, "design", "--resume", "killed")
    _, said = resumed.communicate()
    assert resumed.returncode == 0, said

    request = {"run": {"new": {"experiment": str(tmp_path / "tiny.toml"), "out": str(tmp_path / "whole")}}}
    code = f"import petzval, json; petzval.jobs.run('design', json.loads({json.dumps(request)!r}), threads=1)"
    whole = subprocess.run([sys.executable, "-W", "ignore", "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert whole.returncode == 0, whole.stderr
    found = digests(run)
    assert found == digests(tmp_path / "whole")
    weights = [name for name in found if name.endswith("network/weights.bin")]
    assert len(weights) == 3 and len({found[name] for name in weights}) == 3

    # The report is that of any other design, with the score of the class.
    metrics = json.loads((run / "metrics.json").read_text())
    assert [row["camera"] for row in metrics["rows"]] == ["nominal", "spot-optimised", "end-to-end"]
    assert all(0 < row["edge_error"] < 1 for row in metrics["rows"])
    assert "RMS error of differences of neighbours" in (run / "report.html").read_text()
    again = pz.jobs.run("evaluate", {"run": str(run)})
    assert again["largest_difference_from_run"] < 1e-6
    # The lens was led by the class, and the loss fell.
    moved = [step for step in steps(run) if step["block"] == "optics"]
    assert len(moved) == 2 and all(np.isfinite(step["losses"]["total"]) for step in moved)  # type: ignore[index]


def design(folder: Path, experiment: Path) -> None:
    new = {"experiment": str(experiment), "out": str(folder / "run"), "changes": {"variant": "nominal"}}
    pz.jobs.run("design", {"run": {"new": new}}, threads=1)


@pytest.mark.filterwarnings("ignore::petzval.PetzvalWarning")
@pytest.mark.parametrize(
    ("network", "says"),
    [
        ("Raises", r"^odd_nets.py:\d+: ValueError: no way back"),
        ("Nan", r"`odd_nets:Nan.forward` gives nan at element 0|`odd_nets:Nan.forward` gives NaN at element 0"),
        ("Small", r"`odd_nets:Small.backward` gives an array of shape \[2, 3, 64, 64\], not \[2, 8, 64, 64\]"),
        ("Forgetful", r"`odd_nets:Forgetful.save` gives str, not bytes"),
    ],
)
def test_what_fails_in_training_is_shown_as_the_users(tmp_path: Path, network: str, says: str) -> None:
    with pytest.raises(pz.PetzvalError, match=says) as caught:
        design(tmp_path, write(tmp_path, f"odd_nets:{network}"))
    assert not isinstance(caught.value, pz.InputError)
    if network == "Raises":
        cause = caught.value.__cause__
        assert isinstance(cause, ValueError) and cause.__traceback__ is not None
        assert cause.__traceback__.tb_frame.f_code.co_name == "backward"


@pytest.mark.filterwarnings("ignore::petzval.PetzvalWarning")
@pytest.mark.parametrize(
    ("network", "says"),
    [
        ("no_such_nets:Net", "Python finds no module `no_such_nets`"),
        ("broken_nets:Net", r"broken_nets.py:1: SyntaxError"),
        ("odd_nets:Incomplet", "has no such class"),
        ("odd_nets:Incomplete", "lacks `backward`, `step`, `save`, `load`"),
        ("odd_nets:Needy", r"odd_nets.py:\d+: KeyError: 'the key'"),
        ("odd_nets", "is no module with a class"),
    ],
)
def test_a_class_that_cannot_be_used_is_a_wrong_input_and_leaves_no_folder(
    tmp_path: Path, network: str, says: str
) -> None:
    with pytest.raises(pz.InputError, match=says):
        design(tmp_path, write(tmp_path, network))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"task": '"image-quality"'}, "nothing uses this class"),
        ({"kind": '"u-net"'}, "nothing uses this class"),
        ({"scores": '["edge_eror"]'}, "no score called `edge_eror`"),
        ({"timeout_s": "0.0"}, "lies outside 0.1 to 1000000"),
        ({"options": "{ seed = 3 }"}, "Petzval itself gives the argument `seed`"),
    ],
)
@pytest.mark.filterwarnings("ignore::petzval.PetzvalWarning")
def test_an_experiment_that_cannot_be_is_refused(tmp_path: Path, change: dict[str, str], says: str) -> None:
    with pytest.raises(pz.InputError, match=says):
        design(tmp_path, write(tmp_path, **change))


@pytest.mark.parametrize(
    ("network", "code", "says"),
    [
        ("Raises", 1, ["ValueError: no way back", "in backward", "odd_nets.py:"]),
        ("Dies", 1, ["its Python process has ended (signal: 9", "it wrote: the device is lost"]),
        ("Hangs", 1, ["no answer within 1 s", "waiting for the device"]),
        ("Incomplete", 2, ["lacks `backward`"]),
    ],
)
def test_the_command_reports_a_worker_that_fails(tmp_path: Path, network: str, code: int, says: list[str]) -> None:
    write(tmp_path, f"odd_nets:{network}", timeout_s="1.0")
    ended = command(tmp_path, "design", "tiny.toml", "--out", "run", "--variant", "nominal")
    _, said = ended.communicate(timeout=120)
    assert ended.returncode == code, said
    plain = " ".join(said.replace("│", " ").split())
    for words in says:
        assert words in plain, said


def made(name: str, role: str = "network", **arguments: object) -> dict[str, object]:
    answer, _ = _worker.make(json.dumps({"class": name, "role": role, "arguments": arguments}))
    found: dict[str, object] = json.loads(answer)
    return found


def test_classes_never_come_from_the_folder_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("run.json", "config.toml"):
        (tmp_path / name).write_text("")
    (tmp_path / "inputs").mkdir()
    (tmp_path / "inputs" / "stray_nets.py").write_text("raise SystemExit('was run')\n")
    monkeypatch.syspath_prepend(tmp_path / "inputs")
    error = made("stray_nets:Net")["error"]
    assert isinstance(error, dict) and "lies in the folder of a run" in error["message"]
    assert "stray_nets" not in sys.modules


def test_a_task_states_its_scores_and_gives_numbers() -> None:
    assert made("tiny_nets:Edges", "task") == {"value": {"scores": {"edge_error": {
        "higher_is_better": False, "definition": "the RMS error of differences of neighbours"}}}}
    error = made("odd_nets:Unscored", "task")["error"]
    assert isinstance(error, dict) and "describes no `scores`" in error["message"]


@pytest.mark.parametrize(
    ("method", "gives", "says"),
    [
        ("forward", None, "gives NoneType, not an array"),
        ("forward", [[1.0], [2.0, 3.0]], "gives list, not an array of real numbers"),
        ("forward", np.array([[["0.5"]]]), "gives ndarray, not an array of real numbers: they are of type <U3"),
        ("forward", np.ones((1, 3, 2, 2), bool), "not an array of real numbers: they are of type bool"),
        ("forward", np.ones((1, 3, 2, 2), complex), "not an array of real numbers: they are of type complex128"),
        ("score", {"a": "1.5"}, "gives str in place of a number"),
        ("loss", 1.0, "gives float, not the loss and its cotangent"),
        ("score", [1.0], "gives list, not a dictionary"),
        ("score", {"a": "b"}, "gives str in place of a number"),
    ],
)
def test_what_a_method_may_not_give_is_named(method: str, gives: object, says: str) -> None:
    class Gives:
        pass

    setattr(Gives, method, lambda self, *arrays: gives)
    guest = _worker._Guest(Gives(), "mine:Gives")
    arrays = [np.zeros((1, 3, 2, 2), np.float32)] * (1 if method == "forward" else 2)
    answer, found, _ = _worker.call(guest, json.dumps({"method": method, "number": None}), arrays, b"")
    assert says in json.loads(answer)["error"]["message"] and not found


def test_derivatives_of_the_numpy_classes_are_those_of_differences() -> None:
    import tiny_nets

    draw = np.random.default_rng(3).standard_normal
    network = tiny_nets.Restorer(channels=8, seed=1)
    network.kept[0] += 0.1 * draw(network.kept[0].shape)
    x, cotangent, direction, e = draw((2, 8, 6, 5)), draw((2, 3, 6, 5)), draw((2, 8, 6, 5)), 1e-6

    def value(at: np.ndarray) -> float:
        return float((network.forward(at) * cotangent).sum())

    wanted = (value(x + e * direction) - value(x - e * direction)) / (2 * e)
    network.forward(x)
    assert (network.backward(cotangent) * direction).sum() == pytest.approx(wanted, rel=1e-6)
    weights, along = network.kept[0].copy(), draw(network.kept[0].shape)
    values = []
    for sign in (1, -1):
        network.kept[0] = weights + sign * e * along
        values.append(value(x))
    assert (network.gradient * along).sum() == pytest.approx((values[0] - values[1]) / (2 * e), rel=1e-6)
    loss, (pictures, targets, along) = tiny_nets.Edges().loss, draw((3, 2, 3, 6, 5))
    wanted = (loss(pictures + e * along, targets)[0] - loss(pictures - e * along, targets)[0]) / (2 * e)
    assert (loss(pictures, targets)[1] * along).sum() == pytest.approx(wanted, rel=1e-6)


def test_a_loss_may_be_a_tensor_that_requires_a_gradient() -> None:
    class Tensor:
        def detach(self) -> float:
            return 0.5

        def __float__(self) -> float:
            raise AssertionError("warns in PyTorch")

    class Gives:
        def loss(self, pictures: object, targets: object) -> tuple[object, object]:
            return Tensor(), np.zeros((1, 3, 2, 2))

    guest = _worker._Guest(Gives(), "mine:Gives")
    answer, found, _ = _worker.call(guest, json.dumps({"method": "loss"}), [np.zeros((1, 3, 2, 2), np.float32)] * 2, b"")
    assert json.loads(answer) == {"value": 0.5} and found[0].dtype == np.float32
