import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import petzval as pz
from optics import picture, psfs
from petzval import _petzval
from petzval._watch import watch

NAN = float("nan")
ONE = pz.FieldPsfs(np.full((1, 1, 16, 16), 1 / 256), [0.0], 2.0)


def test_a_flat_scene_stays_flat_and_dims_off_the_axis() -> None:
    bank = psfs(5, 3)
    light = pz.render(np.ones((41, 52, 3)), bank, pixel_um=5.0, patches=(5, 5))
    rows, columns = np.mgrid[:41, :52]
    radius = 5e-3 * np.hypot(rows - 20.0, columns - 25.5)
    for c in range(3):
        np.testing.assert_allclose(light[..., c], np.interp(radius, bank.field_radius_mm, bank.illumination[:, c]), atol=3e-6)


def test_bytes_are_encoded_and_numbers_beyond_floats_are_refused_by_name(tmp_path: Path) -> None:
    every = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    (tmp_path / "every.png").write_bytes(bytes(_petzval.picture_png(every)))
    light = pz.read_picture(tmp_path / "every.png")
    for work in (pz.render, pz.restore):
        np.testing.assert_allclose(work(every, psfs(1, 3), pixel_um=5.0), work(light, psfs(1, 3), pixel_um=5.0), atol=1e-5)
        np.testing.assert_allclose(work(every[..., 0], ONE, pixel_um=5.0), work(light[..., 0], ONE, pixel_um=5.0), atol=1e-5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(pz.InputError):
            pz.render(np.full((16, 16), 1e39), ONE, pixel_um=5.0)


def test_a_flag_stops_it() -> None:
    flag = pz.Cancel()
    flag.set()
    with pytest.raises(pz.Stopped):
        pz.render(np.ones((20, 20, 3)), psfs(2, 3), pixel_um=5.0, patches=(1, 1), cancel=flag)


def test_psfs_without_illumination_do_not_dim() -> None:
    bank = psfs(3, 3)
    even = pz.FieldPsfs(bank.values, bank.field_radius_mm, bank.pitch_um)
    np.testing.assert_allclose(pz.render(np.ones((20, 24, 3)), even, pixel_um=5.0, patches=(3, 3)), 1.0, atol=3e-6)


def test_a_point_becomes_the_psf_of_its_place() -> None:
    bank = psfs(1, 1, grid=8, pitch_um=5.0)
    scene = np.zeros((41, 41))
    scene[20, 20] = 1.0
    light = pz.render(scene, bank, pixel_um=5.0, patches=(1, 1))
    # A cell's centre lies on the corner of four pixels, which share it.
    wanted = np.zeros((9, 9))
    for dy, dx in np.ndindex(2, 2):
        wanted[dy : dy + 8, dx : dx + 8] += 0.25 * bank.values[0, 0]
    np.testing.assert_allclose(light[16:25, 16:25], wanted, atol=1e-6)
    assert light.sum() == pytest.approx(1.0, abs=1e-5)


def test_psfs_turn_with_the_azimuth() -> None:
    bank = psfs(3, 1, corner_mm=0.15)
    scene = picture(45, 45, 1)[..., 0]
    # No patch stands on the axis, where the azimuth is undefined.
    light = pz.render(scene, bank, pixel_um=5.0, patches=(4, 4))
    turned = pz.render(np.rot90(scene), bank, pixel_um=5.0, patches=(4, 4))
    np.testing.assert_allclose(turned, np.rot90(light), atol=1e-5)


def test_a_window_is_a_part_of_the_whole() -> None:
    bank, scene = psfs(4, 3), picture(60, 47, 3)
    whole = pz.render(scene, bank, pixel_um=5.0, patches=(3, 4))
    part = pz.render(scene, bank, pixel_um=5.0, patches=(3, 4), row=13, column=5, size=(31, 22))
    np.testing.assert_allclose(part, whole[13:44, 5:27], atol=2e-6)


def test_every_number_of_colours_is_rendered_alike() -> None:
    bank, scene = psfs(4, 7), picture(33, 40, 7)
    light = pz.render(scene, bank, pixel_um=5.0, patches=(3, 3))
    assert light.shape == (33, 40, 7) and light.dtype == np.float32
    for c in range(7):
        one = pz.FieldPsfs(bank.values[:, c : c + 1], bank.field_radius_mm, bank.pitch_um, bank.illumination[:, c : c + 1])
        np.testing.assert_allclose(pz.render(scene[..., c], one, pixel_um=5.0, patches=(3, 3)), light[..., c], atol=2e-6)


def test_samples_are_collected_by_pixels() -> None:
    bank = psfs(3, 3)
    fine = picture(60, 80, 3)
    light = pz.render(fine, bank, pixel_um=6.0, samples=2, patches=(3, 3))
    samples = pz.render(fine, bank, pixel_um=3.0, patches=(3, 3))
    np.testing.assert_allclose(light, samples.reshape(30, 2, 40, 2, 3).mean((1, 3)), atol=2e-6)


def test_a_traced_lens_renders(triplet: pz.Lens) -> None:
    bank = pz.psf(triplet, fields_deg=[0.0, 1.0, 2.0], grid=16, pitch_um=6.0)
    patches = pz.patches_for(bank, (40, 60), pixel_um=40.0, blend_error=0.1)
    light = pz.render(np.ones((40, 60, 3)), bank, pixel_um=40.0, patches=patches)
    np.testing.assert_allclose(light[20, 30], bank.illumination[0], atol=1e-4)
    assert light[0, 0, 0] < light[20, 30, 0]


def test_patches_are_as_many_as_the_blend_needs() -> None:
    bank = psfs(6, 3)
    few, many = (pz.patches_for(bank, (60, 80), pixel_um=5.0, blend_error=error) for error in (0.5, 0.02))
    assert few < many
    median, largest = pz.blend_error(bank, (60, 80), many, pixel_um=5.0)
    assert median <= 0.02 and median <= largest
    assert pz.blend_error(bank, (60, 80), few, pixel_um=5.0)[0] > median
    scene = picture(60, 80, 3)
    usual = pz.render(scene, bank, pixel_um=5.0)
    np.testing.assert_array_equal(usual, pz.render(scene, bank, pixel_um=5.0, patches=pz.patches_for(bank, (60, 80), pixel_um=5.0)))


def test_the_transpose_has_the_dot_product_of_the_renderer() -> None:
    bank, random = psfs(4, 5), np.random.default_rng(3)
    with watch() as watching:
        renderer = _petzval.Renderer(bank.values, bank.illumination, bank.field_radius_mm, 3.0, (50, 60, 5.0), (3, 3), None, watching)
        reach = renderer.kernel_radius()
        scene = random.normal(size=(20 + 2 * reach, 24 + 2 * reach, 5))
        output = renderer.render(scene, 7, 9, watching).astype(np.float64)
        bar = random.normal(size=output.shape)
        by_values, by_radius, by_scene = renderer.adjoint(scene, 7, 9, bar, watching)
    product = float((output * bar).sum())
    assert float((by_scene * scene).sum()) == pytest.approx(product, rel=1e-4, abs=1e-3)
    assert float((by_values * bank.values).sum()) == pytest.approx(product, rel=1e-4, abs=1e-3)
    assert by_radius.shape == (4,) and np.abs(by_radius).max() > 0.0


def test_distortion_maps_there_and_back() -> None:
    image = np.linspace(0.0, 0.2, 9)
    barrel = pz.Distortion(image, image * (1.0 + 3.0 * image**2))
    radii = np.linspace(0.0, 0.25, 30)
    np.testing.assert_allclose(barrel.to_image_mm(barrel.to_ideal_mm(radii)), radii, atol=1e-9)
    height, width = barrel.frame((40, 60), 5.0)
    assert height >= 40 and width > 60
    bank = psfs(1, 1)
    light = pz.render(np.full((height, width), 0.5), bank, pixel_um=5.0, shape=(40, 60), distortion=barrel, patches=(1, 1))
    np.testing.assert_allclose(light, 0.5, atol=1e-5)
    straight = pz.Distortion(image, image)
    scene = picture(40, 60, 1)[..., 0]
    plain, same = (pz.render(scene, bank, pixel_um=5.0, shape=(40, 60), distortion=d, patches=(1, 1)) for d in (None, straight))
    np.testing.assert_allclose(same, plain, atol=1e-5)
    moved = pz.render(scene, bank, pixel_um=5.0, shape=(40, 60), distortion=barrel, patches=(1, 1))
    assert np.abs(moved - plain).max() > 0.05


def test_a_lens_has_its_distortion(triplet: pz.Lens) -> None:
    sensor = pz.Sensor.load("imx249-fitted")
    map_ = pz.Distortion.of(triplet, sensor)
    assert float(np.asarray(map_.image_mm)[-1]) == pytest.approx(0.5e-3 * 5.86 * np.hypot(1200, 1920), rel=1e-9)
    # The scale near the axis is that of the chief rays themselves.
    spots = triplet.spots([0.02, 12.0])
    near, far = np.hypot(*spots.chief_mm.T)
    ideal = near / np.tan(np.deg2rad(0.02)) * np.tan(np.deg2rad(12.0))
    assert map_.to_ideal_mm(far)[0] == pytest.approx(ideal, rel=1e-4)


def test_restoration_takes_blur_away() -> None:
    bank = psfs(1, 3)
    sharp = picture(64, 72, 3)
    blurred = pz.render(sharp, bank, pixel_um=3.0, patches=(1, 1))
    restored = pz.restore(blurred, bank, pixel_um=3.0, wiener=pz.Wiener(noise=1e-5), patches=(1, 1))
    inner = np.s_[12:-12, 12:-12]
    error, before = (np.sqrt(np.mean((of[inner] - sharp[inner]) ** 2)) for of in (restored, blurred))
    assert error < 0.7 * before
    # More noise is trusted less.
    noisy = pz.restore(blurred, bank, pixel_um=3.0, wiener=pz.Wiener(noise=1.0), patches=(1, 1))
    assert noisy[inner].std() < restored[inner].std()
    # A flat picture stays flat, and as bright as the reach of the filters allows.
    flat = pz.restore(np.full((40, 40, 3), 0.4), bank, pixel_um=3.0, patches=(1, 1))
    assert np.ptp(flat, axis=(0, 1)).max() < 1e-5
    np.testing.assert_allclose(flat, 0.4, rtol=0.02)
    bent = pz.Wiener(noise=1e-5, curves=np.log(1e5) * np.ones((3, 6)))
    np.testing.assert_allclose(pz.restore(blurred, bank, pixel_um=3.0, wiener=bent, patches=(1, 1)), noisy, atol=1e-4)


def test_less_light_is_more_noise() -> None:
    sensor = pz.Sensor.load("imx249-calibrated")
    bright, dim = (pz.Wiener.of_exposure(sensor, white_e=white) for white in (16000.0, 200.0))
    assert dim.noise > 20 * bright.noise and bright.power == pz.Wiener().power == 2.0
    assert pz.Wiener().noise == pytest.approx(3e-3)


def test_wrong_arguments_are_exceptions(triplet: pz.Lens) -> None:
    bank, scene = psfs(3, 3), picture(20, 24, 3)

    def changed(**values: object) -> pz.FieldPsfs:
        return pz.FieldPsfs(**{**vars(bank), **values})

    def render(picture_: object = scene, psfs_: object = bank, **options: object) -> object:
        return pz.render(picture_, psfs_, **{"pixel_um": 5.0, "patches": (3, 3), **options})  # type: ignore[arg-type]

    render()
    for bad in (scene * NAN, -scene, scene[..., :2], scene[:, :0], scene[0, 0], scene[None]):
        with pytest.raises(pz.InputError, match="picture|shape"):
            render(bad)
    for bad_psfs in (
        changed(values=bank.values[:, :, :-1]),
        changed(values=bank.values[:2]),
        changed(values=2 * bank.values),
        changed(values=bank.values * NAN),
        changed(values=-bank.values),
        changed(illumination=bank.illumination[:, :2]),
        changed(illumination=bank.illumination * NAN),
        changed(field_radius_mm=[0.0, 0.1, 0.1]),
        changed(field_radius_mm=[0.1, 0.2, 0.3]),
        changed(field_radius_mm=[0.0, 0.1, NAN]),
        changed(pitch_um=0.0),
        changed(pitch_um=-1.0),
        changed(pitch_um=NAN),
        changed(pitch_um=1e9),
    ):
        with pytest.raises(pz.InputError):
            render(psfs_=bad_psfs)
    for name, values in {
        "pixel_um": (0.0, -5.0, NAN, 1e9),
        "patches": ((0, 3), (3, 300), (-1, 2), (2,), 3, (1.5, 2)),
        "shape": ((0, 24), (20, 70000), (-20, 24), (20,)),
        "row": (-1, 20, 10**12),
        "column": (-1, 24),
        "size": ((21, 24), (0, 4), (-1, 4), "x"),
        "samples": (0, -1, 10**6, 1.5),
    }.items():
        for value in values:
            with pytest.raises(pz.InputError):
                render(**{name: value})
    with pytest.raises(pz.InputError, match="picture"):
        render(shape=(30, 30))
    with pytest.raises(pz.InputError, match="shape"):
        render(distortion=pz.Distortion([0.0, 1.0], [0.0, 1.0]))
    for image, ideal in (([0.0], [0.0]), ([], []), ([0.0, 1.0], [0.0]), ([0.1, 1.0], [0.0, 1.0]), ([0.0, NAN], [0.0, 1.0]), ([0.0, 1.0, 1.5], [0.0, 1.0, 0.9])):
        with pytest.raises(pz.InputError):
            pz.Distortion(image, ideal)
    for wiener in (pz.Wiener(noise=0.0), pz.Wiener(noise=NAN), pz.Wiener(power=-1.0), pz.Wiener(curves=np.zeros((2, 6))), pz.Wiener(curves=np.full((3, 6), NAN))):
        with pytest.raises(pz.InputError):
            pz.restore(scene, bank, pixel_um=5.0, wiener=wiener, patches=(1, 1))
    with pytest.raises(pz.InputError, match="memory"):
        render(psfs_=psfs(2, 3, grid=64, pitch_um=40.0), patches=(256, 256))
    # Fields that do not begin on the axis are no bank of the renderer.
    with pytest.raises(pz.InputError, match="start at 0"):
        render(psfs_=pz.psf(triplet, fields_deg=[5.0, 10.0], grid=16, pitch_um=6.0))


def test_psfs_that_cannot_be_turned_about_the_axis_are_refused(triplet: pz.Lens) -> None:
    scene = np.ones((20, 24, 3))
    below = pz.psf(triplet, fields_deg=[0.0, -8.0], grid=32, pitch_um=4.0, pupil_cells=16, pupil_error=10.0)
    assert below.chief_mm[1, 1] < 0.0 < below.field_radius_mm[1]
    uneven = replace(below, chief_mm=-below.chief_mm, rotationally_symmetric=False)
    for bank, key in ((below, "psfs.chief_mm"), (uneven, "psfs.rotationally_symmetric")):
        for use in (pz.render, pz.restore):
            with pytest.raises(pz.InputError) as caught:
                use(scene, bank, pixel_um=5.0, patches=(1, 1))
            assert caught.value.place.key == key and caught.value.hint
        with pytest.raises(pz.InputError, match=key):
            pz.patches_for(bank, (20, 24), pixel_um=5.0)
    # Turned by hand, they are those of the other side.
    above = replace(below, values=below.values[..., ::-1, ::-1], chief_mm=-below.chief_mm)
    other = pz.psf(triplet, fields_deg=[0.0, 8.0], grid=32, pitch_um=4.0, pupil_cells=16, pupil_error=10.0)
    light = pz.render(picture(20, 24, 3), above, pixel_um=5.0, patches=(3, 3))
    np.testing.assert_allclose(light, pz.render(picture(20, 24, 3), other, pixel_um=5.0, patches=(3, 3)), atol=1e-6)
