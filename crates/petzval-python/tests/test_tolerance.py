import csv
import math
from pathlib import Path

import pytest

import petzval as pz

REQUEST = {"grade": "commercial", "trials": 24, "seed": 3}


@pytest.fixture(scope="module")
def tolerance(triplet: pz.Lens) -> pz.lens.Tolerance:
    return triplet.tolerance(**REQUEST)


def test_trials_are_those_of_the_table_that_the_job_writes(triplet: pz.Lens, tolerance: pz.lens.Tolerance, tmp_path: Path) -> None:
    pz.jobs.run("lens-tolerance", {**REQUEST, "lens": {"toml": triplet.to_toml()}, "out": tmp_path})
    with open(tmp_path / "trials.csv", newline="") as file:
        head, *lines = csv.reader(file)
    assert len(tolerance.trials) == len(lines) == 24
    assert list(tolerance.trials[0]) == ["trial", "merit_um", *head[2:]]
    assert "set: image distance (mm)" in head
    for row, line in zip(tolerance.trials, lines, strict=True):
        assert [row["trial"], row["merit_um"]] == [int(line[0]), pytest.approx(float(line[1]), rel=1e-12)]
        assert list(row.values())[2:] == pytest.approx([float(value) for value in line[2:]], rel=1e-12)
    random = tolerance.response["report"]["monte_carlo"]
    merits = [row["merit_um"] for row in tolerance.trials]
    assert sum(merits) / len(merits) == pytest.approx(random["mean"], rel=1e-12)


def test_a_lens_is_made_again(triplet: pz.Lens, tolerance: pz.lens.Tolerance, tmp_path: Path) -> None:
    worst = max(tolerance.trials, key=lambda row: row["merit_um"])
    lens = tolerance.lens(worst["trial"])
    assert len(lens.surfaces) == len(triplet.surfaces)
    assert f"{worst['merit_um']:.4f}" in lens.source and lens.name.endswith(f"lens {worst['trial']} of seed 3")
    # The job writes the same lens as its worst.
    request = {**REQUEST, "lens": {"toml": triplet.to_toml()}, "out": tmp_path, "worst": 1}
    pz.jobs.run("lens-tolerance", request)
    [path] = tmp_path.glob("lens-*.toml")
    assert path.stem == f"lens-{worst['trial']:05}" and path.read_text() == lens.to_toml()
    # An error of the thickness behind the first surface is in the lens. Tilts of elements move vertices along the axis by less than 1e-5 mm.
    off = worst["surface 1 thickness (mm)"]
    assert lens.surfaces[0].thickness_mm - triplet.surfaces[0].thickness_mm == pytest.approx(off, abs=1e-5)


def test_lenses_are_listed_only_on_request(triplet: pz.Lens) -> None:
    plain = pz.jobs.run("lens-tolerance", {**REQUEST, "lens": "cooke-triplet-nominal"})
    assert "trials" not in plain
    assert triplet.tolerance(**REQUEST, list_trials=False).trials == []
    none = triplet.tolerance(**{**REQUEST, "trials": 0})
    assert none.trials == [] and len(none.sensitivities) > 5
    mtf = triplet.tolerance(**{**REQUEST, "trials": 2}, merit="mtf")
    assert 0 < mtf.trials[0]["merit"] < 1 and not math.isnan(mtf.trials[0]["set: image distance (mm)"])


def test_wrong_trials_are_refused(tolerance: pz.lens.Tolerance) -> None:
    for number in (-1, 24, 10**6):
        with pytest.raises(pz.InputError, match=f"trial {number}"):
            tolerance.lens(number)
    with pytest.raises(pz.InputError, match="0 to 23"):
        tolerance.lens(24)
    for wrong in ("1", 1.5, None, 10**30):
        with pytest.raises(pz.InputError, match="^trial "):
            tolerance.lens(wrong)  # type: ignore[arg-type]
