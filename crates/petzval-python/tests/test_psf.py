import tempfile

import numpy as np
import pytest

import petzval as pz
from petzval import _petzval
from petzval._watch import watch


def test_psfs_are_those_of_the_command(triplet: pz.Lens, tmp_path) -> None:
    request = {"lens": "cooke-triplet-nominal", "out": tmp_path / "psf", "fields": 3, "grid": 48, "pitch_um": 3.0}
    axes = pz.jobs.run("psf", request)["axes"]
    values = np.load(tmp_path / "psf" / "psf.npy")
    bank = pz.psf(
        triplet,
        fields_deg=axes["field_deg"],
        wavelengths_um=axes["wavelengths_um"],
        grid=48,
        pitch_um=3.0,
        pupil_cells=axes["pupil_cells"],
    )
    assert bank.values.shape == values.shape == (3, 3, 48, 48)
    np.testing.assert_allclose(bank.values.sum((2, 3)), 1.0, rtol=1e-12)
    assert np.abs(bank.values - values).sum((2, 3)).max() < 0.03
    np.testing.assert_allclose(bank.field_radius_mm, axes["field_radius_mm"], atol=1e-5)


def test_the_image_scale_is_that_of_the_command(triplet: pz.Lens) -> None:
    # A plane out of focus, and a near object, whose image is upside down.
    behind = triplet.with_(len(triplet.surfaces) - 1, thickness_mm=triplet.surfaces[-1].thickness_mm + 0.2)
    text = triplet.to_toml()
    near = pz.Lens.parse(text.replace("distance_mm = inf", "distance_mm = 400.0")).focused("paraxial")
    assert near.to_toml() != text
    for lens in (behind, near):
        with tempfile.TemporaryDirectory() as folder:
            request = {"lens": {"toml": lens.to_toml()}, "out": folder, "fields": 2, "grid": 128, "pitch_um": 4.0}
            axes = pz.jobs.run("psf", request)["axes"]
        bank = pz.psf(lens, fields_deg=axes["field_deg"], grid=128, pitch_um=4.0)
        assert bank.image_scale_mm == pytest.approx(axes["image_scale_mm"], rel=1e-9)
    assert abs(pz.psf(behind, grid=128, pitch_um=4.0).image_scale_mm / behind.efl_mm - 1.0) > 1e-3
    on_axis = pz.psf(behind, fields_deg=[0.0], grid=128, pitch_um=4.0).image_scale_mm
    assert on_axis == pytest.approx(pz.psf(behind, grid=128, pitch_um=4.0).image_scale_mm, rel=1e-9)


def test_arrays_may_be_lists_float32_or_strided(triplet: pz.Lens) -> None:
    wanted = pz.psf(triplet, fields_deg=[0.0, 10.0], wavelengths_um=[0.55], grid=16, pitch_um=6.0).values
    for fields in ([0, 10], np.float32([0, 10]), np.arange(0.0, 20.0, 5.0)[::2], np.array([[0.0, 10.0]]).T[:, 0]):
        given = pz.psf(triplet, fields_deg=fields, wavelengths_um=(0.55,), grid=16, pitch_um=6.0).values
        np.testing.assert_array_equal(given, wanted)


def test_waves_and_rays(triplet: pz.Lens) -> None:
    bank = pz.psf(triplet, fields_deg=[0.0], grid=32, pitch_um=2.0, kind="diffraction")
    assert bank.kind == "diffraction" and bank.pupil_error == 0.0
    assert bank.values.shape[1] == len(triplet.wavelengths_um)


def test_a_bank_is_saved(triplet: pz.Lens, tmp_path) -> None:
    bank = pz.psf(triplet, grid=16, pitch_um=6.0)
    bank.save(tmp_path / "bank")
    np.testing.assert_array_equal(np.load(tmp_path / "bank" / "psf.npy"), bank.values)


def test_a_notebook_shows_the_psfs(triplet: pz.Lens) -> None:
    for wavelengths in ([0.55], [0.48, 0.55, 0.62], [0.45, 0.5, 0.55, 0.6, 0.65]):
        bank = pz.psf(triplet, fields_deg=[0.0, 8.0], wavelengths_um=wavelengths, grid=16, pitch_um=6.0)
        assert bank.picture_png().startswith(b"\x89PNG")
        assert 'src="data:image/png;base64,' in bank._repr_html_()
    assert len(bank.picture_png(fields=1)) < len(bank.picture_png())
    with pytest.raises(pz.InputError, match="cells 0"):
        bank.picture_png(cells=0)


@pytest.mark.parametrize("kind", ["geometric", "diffraction"])
def test_the_gradient_is_that_of_differences(triplet: pz.Lens, kind: str) -> None:
    space = triplet.variables()
    plan = _petzval.PsfPlan([0.0, 8.0], [0.55], 16, 4.0, kind, 64)
    x = space.start
    random = np.random.default_rng(1)
    # Smooth weights: a splat has kinks.
    y = np.linspace(-1, 1, 16)
    weights = np.cos(2 * y)[:, None] * np.cos(y)[None, :] + np.zeros((2, 1, 16, 16))
    light, chief = random.normal(size=(2, 1)), random.normal(size=(2, 2))

    def loss(x: np.ndarray) -> float:
        numbers, _ = space._core.numbers(x)
        with watch() as watching:
            values, illumination, chief_mm, *_ = plan.at(space._core, numbers, watching)
        return float((values * weights).sum() + (illumination * light).sum() + (chief_mm * chief).sum())

    numbers, slopes = space._core.numbers(x)
    with watch() as watching:
        gradient = plan.pull_back(space._core, numbers, weights, light, chief, watching) @ slopes
    step = 1e-5
    for i in range(len(x)):
        h = np.zeros_like(x)
        h[i] = step
        difference = (loss(x + h) - loss(x - h)) / (2 * step)
        assert gradient[i] == pytest.approx(difference, rel=1e-5, abs=1e-6)


def test_the_chief_ray_of_a_decentred_lens_has_its_gradient_in_x_and_y(triplet: pz.Lens) -> None:
    decentred = pz.Lens.parse(triplet.to_toml().replace("[[surface]]", "[[surface]]\nplacement = { decenter_mm = [0.05, 0.0] }", 1))
    radius = decentred.surfaces[1].radius_mm
    variables = [pz.Variable(0, "decenter_x_mm", -0.2, 0.2), pz.Variable(1, "radius_mm", *sorted((0.8 * radius, 1.2 * radius)))]
    space = decentred.variables(variables)
    plan = _petzval.PsfPlan([0.0, 8.0], [0.55], 16, 4.0, "geometric", 64)
    zeros = np.zeros((2, 1, 16, 16)), np.zeros((2, 1))

    def chief(x: np.ndarray) -> np.ndarray:
        with watch() as watching:
            return plan.at(space._core, space._core.numbers(x)[0], watching)[2]

    x, step = space.start, 1e-5
    numbers, slopes = space._core.numbers(x)
    differences = np.stack([(chief(x + h) - chief(x - h)) / (2 * step) for h in step * np.eye(len(x))], axis=-1)
    assert np.abs(differences[:, 0]).max() > 1e-3
    for field, axis in np.ndindex(2, 2):
        by_chief = np.zeros((2, 2))
        by_chief[field, axis] = 1.0
        with watch() as watching:
            gradient = plan.pull_back(space._core, numbers, *zeros, by_chief, watching) @ slopes
        np.testing.assert_allclose(gradient, differences[field, axis], rtol=1e-6, atol=1e-8)


def test_numbers_of_a_lens_follow_its_coordinates(triplet: pz.Lens) -> None:
    space = triplet.variables()
    x, step = space.start, 1e-6
    numbers, slopes = space._core.numbers(x)
    assert slopes.shape == (len(numbers), len(x)) and space._core.number_count() == len(numbers)
    for i, h in enumerate(step * np.eye(len(x))):
        difference = (space._core.numbers(x + h)[0] - space._core.numbers(x - h)[0]) / (2 * step)
        np.testing.assert_allclose(slopes[:, i], difference, rtol=1e-6, atol=1e-9)
