import pickle
import re
import shutil
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest

import petzval as pz


def test_first_order_is_that_of_the_command(triplet: pz.Lens) -> None:
    figures = pz.jobs.run("lens-show", {"lens": "cooke-triplet-nominal"})["figures"]
    assert triplet.efl_mm == pytest.approx(figures["efl_mm"], rel=1e-12)
    assert triplet.bfl_mm == pytest.approx(figures["bfl_mm"], rel=1e-12)
    assert triplet.f_number == pytest.approx(figures["f_number"], rel=1e-12)
    assert triplet.figures == figures
    assert len(triplet.surfaces) == len(figures["surfaces"])
    assert [s.is_stop for s in triplet.surfaces].count(True) == 1


def test_a_changed_lens_is_another_one(triplet: pz.Lens) -> None:
    before = triplet.to_toml()
    radius = triplet.surfaces[0].radius_mm
    other = triplet.with_(0, radius_mm=1.01 * radius, thickness_mm=triplet.surfaces[0].thickness_mm + 0.1)
    assert other.surfaces[0].radius_mm == pytest.approx(1.01 * radius, rel=1e-14)
    assert other.efl_mm > triplet.efl_mm
    assert triplet.to_toml() == before
    wide = triplet.with_(fields_deg=[0.0, 5.0], wavelengths_um=(0.5, 0.6))
    assert wide.fields_deg.tolist() == [0.0, 5.0] and wide.wavelengths_um.tolist() == [0.5, 0.6]


def test_saved_and_loaded_it_is_the_same(triplet: pz.Lens, tmp_path) -> None:
    for name in ("a.toml", "b.zmx"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pz.PetzvalWarning)
            triplet.save(tmp_path / name)
            again = pz.Lens.load(tmp_path / name)
        assert again.efl_mm == pytest.approx(triplet.efl_mm, rel=1e-9)
    assert pz.Lens.load(tmp_path / "a.toml").to_toml() == triplet.to_toml()
    assert pickle.loads(pickle.dumps(triplet)).to_toml() == triplet.to_toml()


def test_analyses_are_arrays_by_field(triplet: pz.Lens) -> None:
    spots = triplet.spots()
    fields, colours = len(triplet.fields_deg), len(triplet.wavelengths_um)
    assert spots.rms_um.shape == (fields,) and spots.rms_by_wavelength_um.shape == (fields, colours)
    figures = triplet.figures["rms_spot_poly_real_stop_um"]
    np.testing.assert_allclose(spots.rms_um, figures, rtol=5e-3)
    assert spots.points_um[0][0].shape[1] == 2

    mtf = triplet.mtf([0.0, 20.0, 40.0], fields_deg=[0.0, 10.0])
    assert mtf.sagittal.shape == (2, 3)
    np.testing.assert_allclose(mtf.sagittal[:, 0], 1.0, atol=1e-9)
    assert np.all(np.diff(mtf.geometric_tangential, axis=1) < 0)
    assert np.all(mtf.limit_sagittal >= mtf.sagittal - 1e-9)

    waves = triplet.wavefront([0.0])
    assert waves.zernike_waves.shape == (1, colours, 37)
    assert waves.rms_waves[0, 0] > 0


def test_a_lens_is_focused(triplet: pz.Lens) -> None:
    blurred = triplet.with_(6, thickness_mm=triplet.surfaces[6].thickness_mm + 0.3)
    focused = blurred.focused()
    assert (focused.spots().rms_um**2).mean() < 0.5 * (blurred.spots().rms_um**2).mean()
    assert focused.surfaces[:6] == triplet.surfaces[:6]
    assert blurred.focused("paraxial").surfaces[6].thickness_mm == pytest.approx(triplet.bfl_mm)
    with pytest.raises(pz.InputError, match="`focus`"):
        triplet.focused("nearest")


def test_the_layout_is_a_picture(triplet: pz.Lens, tmp_path) -> None:
    svg = triplet.layout_svg(tmp_path / "layout.svg")
    assert svg.startswith("<svg") and (tmp_path / "layout.svg").read_text() == svg
    assert "<svg" in triplet._repr_html_() and "Lens" in repr(triplet)


def test_a_design_space_moves_the_lens(triplet: pz.Lens) -> None:
    space = triplet.variables()
    x = space.start
    assert len(space) == len(x) > 4
    np.testing.assert_allclose(space.lens_at(x).efl_mm, triplet.efl_mm, rtol=1e-6)
    moved = space.lens_at(x + 0.05)
    np.testing.assert_allclose(moved.efl_mm, triplet.efl_mm, rtol=1e-6)
    np.testing.assert_allclose(space.coordinates_of(moved), x + 0.05, atol=1e-6)
    value, gradient = triplet.variables(track_mm=10.0).penalty(x)
    assert value > 0 and gradient.shape == x.shape and np.any(gradient != 0)


def test_a_lens_far_from_its_paraxial_focus_moves_about_its_own(triplet: pz.Lens) -> None:
    far = triplet.with_(6, thickness_mm=triplet.bfl_mm + 0.9)
    space = far.variables()
    assert space.coordinates[-1] == pz.lens.Coordinate("defocus_mm", pytest.approx(-1.8), pytest.approx(1.8))
    assert space.lens_at(space.start).surfaces[6].thickness_mm == pytest.approx(far.surfaces[6].thickness_mm)
    assert triplet.variables().coordinates[-1].max == 0.5


def test_a_design_space_is_pickled(triplet: pz.Lens) -> None:
    space = triplet.variables(track_mm=40.0, efl=2)
    again = pickle.loads(pickle.dumps(space))
    assert again.coordinates == space.coordinates
    np.testing.assert_allclose(again.start, space.start, atol=1e-12)
    assert again.penalty(space.start)[0] == pytest.approx(space.penalty(space.start)[0], rel=1e-12)


def test_a_lens_of_another_space_is_refused(triplet: pz.Lens, tmp_path) -> None:
    file = tmp_path / "lens.toml"
    triplet.save(file)
    file.write_text(re.sub('glass = "[^"]+"', 'glass = "N-BK7"', file.read_text(), count=1))
    radius = triplet.surfaces[0].radius_mm
    space = triplet.variables([pz.Variable(0, "radius_mm", 0.9 * radius, 1.1 * radius)])
    assert np.isfinite(space.coordinates_of(triplet.with_(0, radius_mm=1.01 * radius))).all()
    assert np.isfinite(space.coordinates_of(triplet.with_(1, semi_diameter_mm=9.0))).all()
    # Another glass makes another focal length than that of the file's solve.
    with pytest.warns(pz.PetzvalWarning, match="its solve makes it"):
        of_another_glass = pz.Lens.load(file)
    others = [
        (triplet.with_(1, radius_mm=1.01 * triplet.surfaces[1].radius_mm), "radius_mm of surface 1"),
        (of_another_glass, "behind surface 0 is N-BK7"),
        (triplet.with_(1, thickness_mm=triplet.surfaces[1].thickness_mm + 0.1), "thickness_mm of surface 1"),
    ]
    for other, place in others:
        with pytest.raises(pz.InputError, match=place):
            space.coordinates_of(other)


def test_coordinates_have_slopes_where_a_lens_stands_on_a_bound(triplet: pz.Lens) -> None:
    radius = triplet.surfaces[0].radius_mm
    space = triplet.variables([pz.Variable(0, "radius_mm", 0.9 * radius, 1.01 * radius)], efl="free", focus="fixed")
    beyond = space.coordinates_of(triplet.with_(0, radius_mm=1.05 * radius))
    assert 0.999 < np.sin(beyond[0]) < 1.0 - 1e-5


def test_the_penalty_has_its_gradient(triplet: pz.Lens) -> None:
    space = triplet.variables(track_mm=40.0)
    x, step = space.start, 1e-6
    _, gradient = space.penalty(x)
    for i in range(len(x)):
        h = np.zeros_like(x)
        h[i] = step
        difference = (space.penalty(x + h)[0] - space.penalty(x - h)[0]) / (2 * step)
        assert gradient[i] == pytest.approx(difference, rel=1e-5, abs=1e-6)


def test_a_stopped_optimisation_keeps_what_its_exception_names(triplet: pz.Lens, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    cancel = pz.Cancel()
    how = {"goal": {"edge": 0.8}, "iterations": 20}
    with pytest.raises(pz.Stopped) as caught:
        triplet.optimize(**how, cancel=cancel, progress=lambda event: event["event"] == "progress" and cancel.set())
    stopped = caught.value
    assert stopped.kept and all(path.exists() for path in stopped.kept)
    assert stopped.resume is not None and stopped.response is not None
    best = pz.Lens.load(stopped.response["found"]["lens"])
    resumed = pz.jobs.run("lens-optimize", stopped.resume)
    assert pz.Lens.load(resumed["found"]["lens"]).spots().rms_um.mean() <= best.spots().rms_um.mean()
    (folder,) = tmp_path.iterdir()
    shutil.rmtree(folder)

    # One that ends names no files that are gone, and leaves none; so does one whose arguments are wrong.
    found = triplet.optimize(goal={"edge": 0.8}, iterations=2).response["found"]
    assert not {"lens", "page"} & found.keys() and found["steps"] > 0
    with pytest.raises(pz.InputError):
        triplet.optimize(iterations=-1)
    assert not list(tmp_path.iterdir())
    kept = triplet.optimize(tmp_path / "kept", goal={"edge": 0.8}, iterations=2).response["found"]
    assert Path(kept["lens"]).is_file() and Path(kept["page"]).is_file()


def test_a_lens_is_optimised_and_toleranced(triplet: pz.Lens, tmp_path) -> None:
    better = triplet.optimize(goal={"edge": 0.8}, iterations=5)
    assert better.lens.spots().rms_um.mean() < triplet.spots().rms_um.mean()
    assert better.lens.efl_mm == pytest.approx(triplet.efl_mm, rel=1e-6)
    events: list[pz.jobs.Event] = []
    kept = triplet.optimize(tmp_path / "kept", goal={"edge": 0.8}, iterations=5, progress=events.append)
    merits = [event["figures"]["merit_um"] for event in events if "figures" in event]
    assert len(merits) > 1 and merits == sorted(merits, reverse=True)
    assert kept.lens.to_toml() == better.lens.to_toml() and (tmp_path / "kept" / "best.toml").is_file()

    tolerance = triplet.tolerance(grade="commercial", trials=5)
    rows = tolerance.sensitivities
    assert rows and all({"name", "unit"} <= row.keys() for row in rows)
