"""Wrong arguments are exceptions that name the argument and the value; nothing aborts, hangs or is left half-written."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz
from petzval import _petzval
from petzval._watch import watch

NAN, INF = float("nan"), float("inf")


def _calls(lens: pz.Lens, folder: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    not_finite: list[Any] = [[NAN], [0.0, INF], [-INF], [], np.array([]), [1.0, NAN, 2.0]]
    not_numbers: list[Any] = ["x", ["a"], [None], object(), [[0.0], [1.0, 2.0]], {"a": 1}, b"x", [1j]]
    for bad in not_finite + not_numbers:
        yield f"fields {bad!r}", lambda bad=bad: lens.spots(bad)
        yield f"mtf {bad!r}", lambda bad=bad: lens.mtf(bad)
        yield f"mtf fields {bad!r}", lambda bad=bad: lens.mtf([10.0], bad)
        yield f"wavefront {bad!r}", lambda bad=bad: lens.wavefront(bad)
        yield f"psf fields {bad!r}", lambda bad=bad: pz.psf(lens, fields_deg=bad, grid=16)
        yield f"psf wavelengths {bad!r}", lambda bad=bad: pz.psf(lens, wavelengths_um=bad, grid=16)
        yield f"with fields {bad!r}", lambda bad=bad: lens.with_(fields_deg=bad)
    for beyond in (90.0, 180.0, -200.0, 1e300):
        yield f"field {beyond}", lambda beyond=beyond: lens.spots([beyond])
        yield f"psf field {beyond}", lambda beyond=beyond: pz.psf(lens, fields_deg=[beyond], grid=16)
    yield "frequency", lambda: lens.mtf([-1.0])
    for um in (0.0, -0.5, 0.1, 550.0, 1e9):
        yield f"wavelength {um}", lambda um=um: pz.psf(lens, wavelengths_um=[um], grid=16)
    for grid in (0, -1, 1, 3, 5000, 10**12, -(10**12), 1.5, "64", None, NAN):
        yield f"grid {grid!r}", lambda grid=grid: pz.psf(lens, grid=grid)
    for pitch in (0.0, -1.0, NAN, INF, 1e9, "1", None, [1.0, 2.0]):
        yield f"pitch {pitch!r}", lambda pitch=pitch: pz.psf(lens, grid=16, pitch_um=pitch)
    for kind in ("", "rays", None, 5, "Diffraction"):
        yield f"kind {kind!r}", lambda kind=kind: pz.psf(lens, grid=16, kind=kind)
    for cells in (0, -2, 11, 13, 65, 10_000, 1.5, None):
        yield f"pupil {cells!r}", lambda cells=cells: pz.psf(lens, grid=16, pupil_cells=cells)
    for error in (0.0, -1.0, NAN, None, "small"):
        yield f"error {error!r}", lambda error=error: pz.psf(lens, grid=16, pupil_error=error)
    for surface in (-1, 99, 10**20, 1.5, "0"):
        yield f"surface {surface!r}", lambda surface=surface: lens.with_(surface, radius_mm=30.0)
    for name in ("radius", "glass", "thickness", "", "radius_mm "):
        yield f"number {name!r}", lambda name=name: lens.with_(0, **{name: 1.0})
    for value in (NAN, "30", None, [1.0]):
        yield f"radius {value!r}", lambda value=value: lens.with_(0, radius_mm=value)
    for thickness in (-50.0, NAN, INF, 1e300):
        yield f"thickness {thickness!r}", lambda thickness=thickness: lens.with_(0, thickness_mm=thickness)
    yield "no surface", lambda: lens.with_(radius_mm=30.0)
    for name in ("no-such-lens", "", "/", str(folder), "a\0b", "x.zmx", folder / "none.toml"):
        yield f"load {name!r}", lambda name=name: pz.Lens.load(name)
    for wrong_type in (5, None, [], object()):
        yield f"load {wrong_type!r}", lambda wrong_type=wrong_type: pz.Lens.load(wrong_type)
    for text in ("", "x", "name = 1", "[[surface]]", "\0", "name = 'x'\nsurfaces = 5", "{"):
        for form in ("toml", "zmx", "seq", "json"):
            yield f"parse {form} {text!r}", lambda text=text, form=form: pz.Lens.parse(text, form)
    yield "parse format", lambda: pz.Lens.parse("name = 1", "docx")  # type: ignore[arg-type]
    yield "parse glasses", lambda: pz.Lens.load("cooke-triplet-nominal", glasses=[folder / "none.agf"])
    for focus in ("", "auto", None):
        yield f"focus {focus!r}", lambda focus=focus: lens.variables(focus=focus)
    for variable in (
        pz.Variable(99, "radius_mm", 1.0, 2.0),
        pz.Variable(0, "radius", 1.0, 2.0),
        pz.Variable(0, "radius_mm", 2.0, 2.0),
        pz.Variable(0, "thickness_mm", 3.0, 1.0),
        pz.Variable(0, "thickness_mm", 100.0, 200.0),
        pz.Variable(0, "thickness_mm", NAN, 200.0),
        pz.Variable(0, "decenter_x_mm", 0.0, 1.0),
    ):
        yield f"variable {variable!r}", lambda variable=variable: lens.variables([variable])
    yield "efl surface", lambda: lens.variables(efl=99)
    yield "held field", lambda: lens.variables(held_field_deg=89.0)
    space = lens.variables()
    right = space.start
    for x in ([], right[:-1], np.append(right, 0.0), right * NAN, right[None, :], "x", None, right + 0j):
        yield f"x {x!r}", lambda x=x: space.lens_at(x)
        yield f"penalty {x!r}", lambda x=x: space.penalty(x)
    plan = _petzval.PsfPlan([0.0], [0.55], 16, 4.0, "geometric", 64)

    def pull_back(values: Any, light: Any, chief: Any) -> Any:
        with watch() as watching:
            return plan.pull_back(space._core, space._core.numbers(right)[0], values, light, chief, watching)

    good = np.zeros((1, 1, 16, 16)), np.zeros((1, 1)), np.zeros((1, 2))
    for i, bad in ((0, np.zeros((1, 1, 16, 15))), (0, good[0] * NAN), (1, np.zeros((2, 1))), (2, np.zeros(3)), (2, [[INF, 0.0]]), (1, "x")):
        yield f"cotangent {i}", lambda i=i, bad=bad: pull_back(*(bad if k == i else v for k, v in enumerate(good)))

    def lift(x: Any, loss: Any, by_numbers: Any, weight: Any) -> Any:
        with watch() as watching:
            return _petzval.lift(plan, space._core, x, loss, by_numbers, weight, watching)

    by = np.ones(space._core.number_count())
    for arguments in (([], 1.0, by, 1.0), (right, 0.0, by, 1.0), (right, NAN, by, 1.0), (right, 1.0, by[:-1], 1.0), (right, 1.0, by * NAN, 1.0)):
        yield f"lift {arguments!r}", lambda arguments=arguments: lift(*arguments)
    yield "lift weight", lambda: lift(right, 1.0, by, -1.0)
    yield "numbers", lambda: space._core.numbers(right[:-1])
    for job, request in (
        ("psf", {}),
        ("psf", {"lens": "cooke-triplet-nominal", "out": folder / "p", "fields": -1}),
        ("psf", {"lens": "cooke-triplet-nominal", "out": folder / "p", "grid": 2}),
        ("psf", {"lens": 5, "out": folder / "p"}),
        ("simulate", {"images": ["none.png"], "out": folder / "s"}),
        ("design", {"experiment": {"name": 5}, "out": folder / "d"}),
        ("lens-show", {"lens": {"toml": 5}}),
        ("lens-tolerance", {"lens": "cooke-triplet-nominal", "trials": -1}),
        ("lens-tolerance", {"lens": "cooke-triplet-nominal", "trials": NAN}),
        ("nothing", {}),
    ):
        yield f"job {job} {request!r}", lambda job=job, request=request: pz.jobs.run(job, request)
    yield "request", lambda: pz.jobs.run("lens-show", {"lens": object()})
    yield "request type", lambda: pz.jobs.run("lens-show", 5)  # type: ignore[arg-type]


def test_wrong_arguments_are_exceptions(triplet: pz.Lens, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    counted, silent = 0, []
    for name, call in _calls(triplet, tmp_path):
        counted += 1
        try:
            call()
        except (pz.PetzvalError, TypeError, ValueError, OverflowError, np.exceptions.ComplexWarning) as error:
            assert str(error), name
        else:
            silent.append(name)
    assert counted >= 200
    assert silent == []
    assert list(tmp_path.iterdir()) == []


def test_an_error_names_argument_value_and_what_is_right(triplet: pz.Lens) -> None:
    with pytest.raises(pz.InputError) as caught:
        pz.psf(triplet, grid=2)
    error = caught.value
    assert (error.place.key, error.place.value) == ("grid", "2")
    assert "16 to 1024" in error.hint and error.hint in str(error)
    with pytest.raises(pz.InputError, match="7 surfaces, from 0 to 6"):
        triplet.with_(7, radius_mm=30.0)


def test_ten_thousand_calls_need_no_more_memory(triplet: pz.Lens) -> None:
    def resident_kb() -> int:
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))

    space = triplet.variables()
    x = space.start
    for _ in range(500):
        space.penalty(x)
    before = resident_kb()
    for _ in range(10_000):
        space.penalty(x)
        with pytest.raises(pz.InputError):
            space.penalty([])
    assert resident_kb() - before < 20_000


def test_errors_are_in_the_words_of_python(triplet: pz.Lens, tmp_path: Path) -> None:
    """Hints stand once, and name arguments and not keys of JSON."""
    bank = pz.PsfBank.of(np.ones((1, 1, 16, 16)), pitch_um=1.0, field_radius_mm=[0.0])
    bank.save(tmp_path / "bank")
    np.save(tmp_path / "bank" / "psf.npy", np.ones((1, 1, 16, 16)))
    with pytest.raises(pz.InputError) as damaged:
        pz.PsfBank.load(tmp_path / "bank")
    assert str(damaged.value).count(damaged.value.hint) == 1
    camera = pz.Camera(triplet, "imx249-fitted", size=(16, 16))
    frames = camera.take(np.full((16, 16, 3), 0.5))
    frames.save(tmp_path / "shot")
    with pytest.raises(pz.InputError, match="overwrite=True"):
        frames.save(tmp_path / "shot")
    with pytest.raises(pz.InputError, match="^request: it holds a number that is not finite"):
        pz.jobs.run("lens-show", {"lens": NAN})


def test_wrong_arguments_of_cameras_threads_and_banks(triplet: pz.Lens) -> None:
    camera = pz.Camera(triplet, "imx249-fitted", size=(16, 16))
    for seed in (-1, 2**64, 1.5, True):
        with pytest.raises(pz.InputError, match="is no seed"):
            camera.take(np.full((16, 16, 3), 0.5), seed=seed)
    with pytest.raises(pz.InputError, match="exposure_e nan: is not finite"):
        pz.Camera(triplet, exposure_e=NAN)
    before = pz.threads()
    with pytest.raises(pz.InputError, match="threads 1025: is too large"):
        pz.set_threads(1025)
    with pytest.raises(pz.InputError, match="threads 1000000000: is too large"):
        pz.jobs.run("lens-show", {"lens": "cooke-triplet-nominal"}, threads=10**9)
    assert pz.threads() == before
    with pytest.raises(pz.InputError, match="is no UTF-8"):
        pz.Lens.load("\udc80.zmx")
    with pytest.raises(pz.InputError, match="kind 'x': there is no such kind"):
        pz.PsfBank.of(np.ones((1, 1, 16, 16)), pitch_um=1.0, field_radius_mm=[0.0], kind="x")  # type: ignore[arg-type]
    with pytest.raises(pz.InputError, match="source 5: is of the type int"):
        pz.PsfBank.of(np.ones((1, 1, 16, 16)), pitch_um=1.0, field_radius_mm=[0.0], source=5)  # type: ignore[arg-type]
    bank = pz.PsfBank.of(np.ones((1, 1, 16, 16)), pitch_um=1.0, field_radius_mm=[0.0])
    with pytest.raises(pz.InputError, match="of type complex128: is no picture"):
        pz.render(np.full((16, 16), 0.5 + 0.5j), bank, pixel_um=4.0)


def test_what_is_printed_fits_a_screen(triplet: pz.Lens) -> None:
    assert len(repr(triplet.spots())) < 2000
    sensor = pz.Sensor.load("imx249-fitted")
    assert repr(pz.Camera(triplet, sensor)) == f"<Camera lens={triplet.name!r}, sensor={sensor.name!r}>"
    assert repr(pz.Camera()) == "<Camera of the defaults>"


def test_wrong_limits_of_a_design_space(triplet: pz.Lens) -> None:
    limits: list[tuple[dict[str, Any], str]] = [
        ({"air_gap_mm": NAN}, "air_gap_mm nan: is not finite"),
        ({"track_mm": INF}, "track_mm inf: is not finite"),
        ({"back_focal_mm": (1.0, NAN)}, "back_focal_mm"),
        ({"back_focal_mm": (1.0,)}, "back_focal_mm"),
        ({"held_share": "x"}, "held_share 'x': is of the type str"),
        ({"defocus_mm": -1.0}, "defocus_mm -1.0: is negative"),
        ({"defocus_mm": NAN}, "defocus_mm nan: is not finite"),
        ({"efl": 99}, "efl 99: there is no such surface"),
        ({"efl": -1}, "efl -1: there is no such surface"),
    ]
    for limit, message in limits:
        with pytest.raises(pz.InputError, match=message):
            triplet.variables(**limit)
    last = max(i for i, surface in enumerate(triplet.surfaces) if np.isfinite(surface.radius_mm))
    assert len(triplet.variables(efl=last, back_focal_mm=(1.0, 60.0)))
