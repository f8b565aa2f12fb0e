"""Results of units that ran on Ray. Ray itself is tried by `cargo xtask engines`."""

import importlib
import json
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest


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
