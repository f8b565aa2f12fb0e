"""Results of units that ran on Ray. Ray itself is tried by `cargo xtask engines`."""

import hashlib
import importlib
import json
import runpy
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import petzval

# The same as in petzval-units/src/store/record.rs.
FROZEN = r"""{
  "format": 1,
  "unit": {
    "name": "façade \u2028\u0001\n\"é/\\",
    "call": {
      "format": 1,
      "job": "lens-trace",
      "request": {"pupil": [0.0, -1], "lens": "cooke-triplet-nominal", "field": 2.5, "Z": {}, "é": [], "a": {"c": true, "b": null}}
    },
    "simd": "avx2",
    "version": "0.1.0"
  },
  "key": "00ff",
  "inputs": [],
  "attempt": 1,
  "response": {"z": 0.1, "a": {"y": [2.5, 3, 18446744073709551615], "x": "1e5"}},
  "files": null,
  "cost": {
    "holder": {"host": "node", "pid": 7, "process_start": 12, "system": ""},
    "began": "2026-01-02 03:04:05",
    "seconds": 2.5,
    "cpu_seconds": 0.1,
    "all_cpu_seconds": 0.1,
    "peak_memory_mb": 2.5,
    "threads": 1,
    "simd": "avx2",
    "widest_simd": "avx2"
  },
  "sha256": "b5c70d3f52d43215bb591b647610018437b2616c7f5adcbd4c55350e076b5fb8"
}"""


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module, also where Ray is not installed: reading results takes none of it."""
    monkeypatch.setitem(sys.modules, "ray", types.ModuleType("ray"))
    monkeypatch.delitem(sys.modules, "petzval.ray", raising=False)
    yield importlib.import_module("petzval.ray")
    sys.modules.pop("petzval.ray", None)


def run_units(file: Path, store: Path, wavelength: float, names: list[str]) -> None:
    """Writes a unit of each name and runs them."""
    request = {"lens": "cooke-triplet-nominal", "field": 5, "wavelength": wavelength, "pupil": [0, 1]}
    call = {"format": 1, "job": "lens-trace", "request": request}
    requests = [call | {"request": request | {"field": field}} for field in range(len(names))]
    lines = [json.dumps({"name": n, "call": c}, ensure_ascii=False) for n, c in zip(names, requests, strict=True)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    words = ["unit", "run", str(file), "--store", str(store), "--threads", "1"]
    subprocess.run([sys.executable, "-m", "petzval", *words], check=True, capture_output=True)


def test_results_are_those_of_the_file_and_not_of_units_of_the_same_names(ray: Any, tmp_path: Path) -> None:
    # U+2028 ends a line for Python alone.
    names, store = ["a", "b\u2028", "c"], tmp_path / "store"
    red, blue = tmp_path / "red.jsonl", tmp_path / "blue.jsonl"
    run_units(red, store, 0.65, names)
    run_units(blue, store, 0.45, names)
    of_red, of_blue = ray.results(red, store=store), ray.results(blue, store=store)
    assert ray._names(red) == names
    assert [result.name for result in of_red] == [result.name for result in of_blue] == names
    assert not {result.key for result in of_red} & {result.key for result in of_blue}
    for results, wavelength in [(of_red, 0.65), (of_blue, 0.45)]:
        for field, result in enumerate(results):
            kept = json.loads((store / result.key / "result.json").read_text(encoding="utf-8"))
            request = kept["unit"]["call"]["request"]
            assert (request["wavelength"], request["field"]) == (wavelength, field)
            assert result.response == kept["response"]


def test_a_frozen_result_is_read_and_an_edited_one_refused(ray: Any, tmp_path: Path) -> None:
    path = tmp_path / "00ff" / "result.json"
    path.parent.mkdir()
    path.write_text(FROZEN, encoding="utf-8")
    assert ray._kept(path) == json.loads(FROZEN)
    for text in [FROZEN.replace('"z": 0.1', '"z": 0.10'), FROZEN.replace('"sha256": "b5', '"sha256": "b6')]:
        assert text != FROZEN
        path.write_text(text, encoding="utf-8")
        with pytest.raises(petzval.InputError, match="not what the unit wrote") as caught:
            ray._kept(path)
        assert str(path) in str(caught.value) and caught.value.place.path == path
    # One of an early build has no digest.
    early = {key: value for key, value in json.loads(FROZEN).items() if key != "sha256"}
    path.write_text(json.dumps(early), encoding="utf-8")
    assert ray._kept(path) == early


def test_numbers_of_a_result_count_by_their_digits_in_the_file(ray: Any, tmp_path: Path) -> None:
    # Python prints 1e-07 and 1e+300.
    rest = '{"numbers":[1e-7,1e300,-0.0],"text":"\x7f\U0001f600"}'
    path = tmp_path / "result.json"
    digest = hashlib.sha256(rest.encode()).hexdigest()
    path.write_text(f'{rest[:-1]},"sha256":"{digest}"}}', encoding="utf-8")
    assert ray._kept(path)["numbers"] == [1e-7, 1e300, 0]


def test_an_edited_result_of_a_store_is_refused(ray: Any, tmp_path: Path) -> None:
    units, store = tmp_path / "units.jsonl", tmp_path / "store"
    run_units(units, store, 0.55, ["a"])
    (path,) = store.glob("*/result.json")
    text = path.read_text(encoding="utf-8")
    assert '"attempt": 1' in text and '"sha256"' in text
    path.write_text(text.replace('"attempt": 1', '"attempt": 2'), encoding="utf-8")
    with pytest.raises(petzval.InputError, match="not what the unit wrote"):
        ray.results(units, store=store)


def test_the_script_of_a_sweep_runs_every_unit(
    ray: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # A cluster that does each task at once.
    taken: list[dict[str, Any]] = []

    def remote(function: Any) -> Any:
        def options(**given: Any) -> Any:
            taken.append(given)
            return types.SimpleNamespace(remote=function)

        return types.SimpleNamespace(options=options)

    monkeypatch.setattr(ray.ray, "remote", remote, raising=False)
    monkeypatch.setattr(ray.ray, "get", list, raising=False)
    sweep, store = tmp_path / "rays.toml", tmp_path / "a store"
    request = 'lens = "cooke-triplet-nominal"\nwavelength = 0.55\npupil = [0.0, 1.0]\n'
    sweep.write_text(f'job = "lens-trace"\nthreads = 1\n[request]\n{request}[grid]\nfield = [0.0, 5.0, 10.0]\n')
    words = ["sweep", str(sweep), "--store", str(store), "--tasks", "2"]
    subprocess.run([sys.executable, "-m", "petzval", *words], check=True, capture_output=True)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(store / "ray_sweep.py"))
    assert ended.value.code == 0
    assert capsys.readouterr().out == "3 units have a result\n"
    assert len(list(store.glob("*/result.json"))) == 3
    assert [options["num_cpus"] for options in taken] == [1]
