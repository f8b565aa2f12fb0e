import numpy as np
import pytest

import petzval as pz
from optics import picture, psfs
from petzval import _petzval
from petzval._watch import watch

torch = pytest.importorskip("torch")

import petzval.torch as pt  # noqa: E402
from petzval.torch import illumination_map, project, render, restore  # noqa: E402

TOLERANCE = 1e-5
BARREL = pz.Distortion(np.linspace(0.0, 0.2, 9), np.linspace(0.0, 0.2, 9) * (1.0 + 3.0 * np.linspace(0.0, 0.2, 9) ** 2))


def batch(pixels: np.ndarray, dtype: object = torch.float32) -> "torch.Tensor":
    """Pictures ``[y, x, c]`` as ``[1, c, y, x]``."""
    return torch.from_numpy(pixels).permute(2, 0, 1)[None].to(dtype)


def pixels(found: "torch.Tensor") -> np.ndarray:
    return found.detach()[0].permute(1, 2, 0).numpy()


def tensors(bank: pz.FieldPsfs, dtype: object = torch.float64) -> pz.FieldPsfs:
    values, radius, light = (torch.tensor(of, dtype=dtype) for of in (bank.values, bank.field_radius_mm, bank.illumination))
    return pz.FieldPsfs(values, radius, bank.pitch_um, light)


def close(found: np.ndarray, wanted: np.ndarray) -> None:
    """Equal to 1e-5 of the largest value."""
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= TOLERANCE * np.abs(wanted).max()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("colours", [1, 3])
@pytest.mark.parametrize("fields", [1, 2, 17])
@pytest.mark.parametrize(("size", "patches"), [((48, 64), (1, 1)), ((51, 37), (3, 4)), ((30, 81), (7, 7)), ((64, 64), (2, 30))])
def test_it_is_petzvals_render(size: tuple[int, int], patches: tuple[int, int], fields: int, colours: int, dtype: object) -> None:
    bank, scene = psfs(fields, colours), picture(*size, colours)
    wanted = pz.render(scene, bank, pixel_um=5.0, patches=patches)
    close(pixels(render(batch(scene, dtype), bank, pixel_um=5.0, patches=patches)), wanted)


@pytest.mark.parametrize(("grid", "pitch_um", "pixel_um"), [(16, 1.0, 5.86), (9, 5.0, 2.0), (8, 4.0, 4.0), (64, 1.0, 3.0)])
def test_cells_of_any_size(grid: int, pitch_um: float, pixel_um: float) -> None:
    bank, scene = psfs(4, 3, grid=grid, pitch_um=pitch_um), picture(60, 50, 3)
    close(pixels(render(batch(scene), bank, pixel_um=pixel_um, patches=(3, 3))), pz.render(scene, bank, pixel_um=pixel_um, patches=(3, 3)))


@pytest.mark.parametrize(("row", "column", "size"), [(0, 0, (20, 30)), (13, 5, (31, 22)), (30, 40, (30, 7))])
def test_windows_and_borders(row: int, column: int, size: tuple[int, int]) -> None:
    bank, scene = psfs(5, 3), picture(60, 47, 3)
    place = {"row": row, "column": column, "pixel_um": 5.0, "patches": (4, 3)}
    wanted = pz.render(scene, bank, size=size, **place)
    close(pixels(render(batch(scene), bank, size=size, **place)), wanted)
    # A picture of the window alone, with the border that the PSF reaches or with more.
    for border in (6, 15):
        padded = np.pad(scene, ((border, border), (border, border), (0, 0)), mode="edge")
        cut = padded[row : row + size[0] + 2 * border, column : column + size[1] + 2 * border]
        close(pixels(render(batch(cut), bank, shape=(60, 47), border=border, **place)), wanted)


@pytest.mark.parametrize("size", [(40, 60), (41, 33)])
def test_distortion(size: tuple[int, int]) -> None:
    bank, scene = psfs(5, 3), picture(*BARREL.frame(size, 5.0), 3)
    options = {"pixel_um": 5.0, "patches": (3, 3), "shape": size, "distortion": BARREL}
    wanted = pz.render(scene, bank, **options)
    close(pixels(render(batch(scene), bank, **options)), wanted)
    whole = project(batch(scene), BARREL, size, pixel_um=5.0, border=12)
    part = project(batch(scene), BARREL, (9, 8), pixel_um=5.0, shape=size, row=20, column=10)
    torch.testing.assert_close(part, whole[..., 32:41, 22:30])


def test_batches_are_rendered_alike() -> None:
    bank, scenes = psfs(3, 3), [picture(33, 40, 3, seed) for seed in range(3)]
    together = render(torch.cat([batch(s) for s in scenes]), bank, pixel_um=5.0, patches=(3, 3))
    for i, scene in enumerate(scenes):
        torch.testing.assert_close(together[i : i + 1], render(batch(scene), bank, pixel_um=5.0, patches=(3, 3)))


def test_the_illumination_is_that_of_a_flat_scene() -> None:
    bank = psfs(6, 3)
    wanted = pz.render(np.ones((30, 40, 3)), bank, pixel_um=5.0, patches=(1, 1), shape=(30, 40))
    close(illumination_map(bank, (30, 40), pixel_um=5.0).permute(1, 2, 0).numpy(), wanted)
    part = illumination_map(bank, (10, 11), pixel_um=5.0, shape=(30, 40), row=3, column=4, like=torch.zeros(1))
    assert part.dtype == torch.float32
    close(part.permute(1, 2, 0).numpy(), wanted[3:13, 4:15])


def test_gradients_are_those_of_petzvals_transpose() -> None:
    bank, random = psfs(6, 3), np.random.default_rng(5)
    flat = pz.FieldPsfs(bank.values, bank.field_radius_mm, bank.pitch_um, np.ones((6, 3)))
    with watch() as watching:
        renderer = _petzval.Renderer(flat.values, flat.illumination, flat.field_radius_mm, 3.0, (60, 70, 5.0), (3, 4), None, watching)
        reach = renderer.kernel_radius()
        scene = random.uniform(size=(31 + 2 * reach, 40 + 2 * reach, 3)).astype(np.float32)
        bar = random.normal(size=(31, 40, 3)).astype(np.float32)
        by_values, by_radius, by_scene = renderer.adjoint(scene, 7, 9, bar, watching)
    own, light = tensors(flat), batch(scene, torch.float64).requires_grad_()
    own.values.requires_grad_(), own.field_radius_mm.requires_grad_()
    found = render(light, own, pixel_um=5.0, patches=(3, 4), shape=(60, 70), row=7, column=9, border=reach)
    (found * batch(bar, torch.float64)).sum().backward()
    close(pixels(light.grad), by_scene)
    close(own.values.grad.numpy(), by_values)
    close(own.field_radius_mm.grad.numpy(), by_radius)


def test_gradients_are_those_of_differences() -> None:
    bank = tensors(psfs(3, 2, grid=3, corner_mm=0.02))
    scene = torch.from_numpy(picture(5, 4, 2)).permute(2, 0, 1)[None].double()

    def rendered(scene: "torch.Tensor", values: "torch.Tensor", radius: "torch.Tensor", light: "torch.Tensor") -> "torch.Tensor":
        return render(scene, pz.FieldPsfs(values, radius, 3.0, light), pixel_um=5.0, patches=(1, 3))

    inputs = [of.clone().requires_grad_() for of in (scene, bank.values, bank.field_radius_mm, bank.illumination)]
    assert torch.autograd.gradcheck(rendered, inputs, eps=1e-7, atol=1e-6)
    assert torch.autograd.gradgradcheck(rendered, inputs, eps=1e-7, atol=1e-4, fast_mode=True)


def test_transforms_of_functions() -> None:
    bank, scene = tensors(psfs(2, 1, grid=6)), batch(picture(12, 14, 1), torch.float64)

    def loss(values: "torch.Tensor", scene: "torch.Tensor") -> "torch.Tensor":
        psfs_ = pz.FieldPsfs(values, bank.field_radius_mm, bank.pitch_um, bank.illumination)
        return render(scene[None], psfs_, pixel_um=5.0, patches=(2, 2)).square().sum()

    gradient = torch.func.grad(loss)(bank.values, scene[0])
    per_sample = torch.func.vmap(torch.func.grad(loss), (None, 0))(bank.values, torch.cat([scene, 2 * scene]))
    torch.testing.assert_close(per_sample[0], gradient)
    torch.testing.assert_close(per_sample[1], 4 * gradient)


def test_it_is_compiled_as_one_graph() -> None:
    bank, scene = tensors(psfs(3, 3)), batch(picture(20, 25, 3), torch.float64)

    def both(scene: "torch.Tensor", values: "torch.Tensor") -> "torch.Tensor":
        psfs_ = pz.FieldPsfs(values, bank.field_radius_mm, bank.pitch_um, bank.illumination)
        light = render(scene, psfs_, pixel_um=5.0, patches=(2, 3))
        return restore(light, psfs_, pixel_um=5.0, patches=(2, 3))

    compiled = torch.compile(both, fullgraph=True, backend="eager")
    torch.testing.assert_close(compiled(scene, bank.values), both(scene, bank.values))


def test_chief_rays_stand_for_radii() -> None:
    class Traced:
        """PSFs as `petzval.torch.Lens` gives them."""

        values, illumination, pitch_um = (bank := tensors(psfs(4, 1, corner_mm=0.05))).values, bank.illumination, 3.0
        chief_mm = torch.stack([torch.zeros(4, dtype=torch.float64), bank.field_radius_mm], 1).requires_grad_()

    scene = batch(picture(20, 20, 1))
    found = render(scene, Traced(), pixel_um=5.0, patches=(3, 3))
    torch.testing.assert_close(found, render(scene, Traced.bank, pixel_um=5.0, patches=(3, 3)))
    found.square().sum().backward()
    assert torch.isfinite(Traced.chief_mm.grad).all() and Traced.chief_mm.grad[1:, 1].abs().min() > 0.0


def test_wrong_arguments_are_exceptions() -> None:
    bank, scene = psfs(3, 3), batch(picture(20, 24, 3))

    def changed(**values: object) -> pz.FieldPsfs:
        return pz.FieldPsfs(**{**vars(bank), **values})

    def call(picture_: object = scene, psfs_: object = bank, **options: object) -> object:
        return render(picture_, psfs_, **{"pixel_um": 5.0, "patches": (3, 3), **options})

    call()
    for bad in (scene[0], scene[:, :2], scene[..., :0], scene.half(), scene.long(), scene.numpy(), None, scene[None]):
        with pytest.raises(pz.InputError, match="picture|psfs"):
            call(bad)
    for bad_psfs in (
        changed(values=bank.values[:, :, :-1]),
        changed(values=bank.values[:2]),
        changed(values=bank.values[0]),
        changed(illumination=bank.illumination[:, :2]),
        changed(field_radius_mm=[0.0, 0.1]),
        changed(field_radius_mm=0.0),
        changed(pitch_um=0.0),
        changed(pitch_um=-1.0),
        changed(pitch_um=float("nan")),
        changed(pitch_um=1e9),
    ):
        with pytest.raises(pz.InputError):
            call(psfs_=bad_psfs)
    for name, values in {
        "pixel_um": (0.0, -5.0, float("nan"), 1e9),
        "patches": ((0, 3), (3, 300), (-1, 2), (2,), 3, (1.5, 2)),
        "shape": ((0, 24), (20, 70000), (-20, 24), (20,), (30, 30)),
        "row": (-1, 20, 10**12),
        "column": (-1, 24),
        "size": ((21, 24), (0, 4), (-1, 4), "x"),
        "border": (-1, 2, 1.5),
        "distortion": (BARREL,),
    }.items():
        for value in values:
            with pytest.raises(pz.InputError):
                call(**{name: value})
    for border, shape in ((2, (5, 5)), (10, (20, 24)), (50, (20, 24))):
        with pytest.raises(pz.InputError):
            call(border=border, shape=shape)
    with pytest.raises(pz.InputError, match="border"):
        call(border=2, shape=(20, 24), distortion=BARREL)


def test_fields_that_do_not_ascend_from_the_axis_are_refused(triplet: pz.Lens) -> None:
    bank, scene = psfs(3, 3), batch(picture(20, 24, 3))
    for radius in ([0.0, 0.2, 0.1], [0.0, 0.1, 0.1], [0.1, 0.2, 0.3], [0.0, -0.1, -0.2], [0.0, 0.1, float("nan")]):
        for given in (np.array(radius), torch.tensor(radius)):
            with pytest.raises(pz.InputError, match="do not ascend from 0"):
                render(scene, pz.FieldPsfs(bank.values, given, bank.pitch_um, bank.illumination), pixel_um=5.0, patches=(3, 3))
    glass = pt.Lens(triplet)
    how = {"grid": np.int64(16), "pitch_um": np.float32(8.0), "pupil_cells": 12}
    for fields in ([14.0, 7.0, 0.0], [7.0, 14.0], [0.0, -7.0], [0.0, 7.0, 7.0]):
        with pytest.raises(pz.InputError, match="do not ascend from 0") as caught, torch.no_grad():
            pt.render(scene, glass.psf(fields_deg=fields, **how), pixel_um=5.0, patches=(1, 1))
        assert caught.value.place.key == "psfs.fields_deg"
    # One PSF stands for the whole picture, whatever its field.
    with torch.no_grad():
        alone = glass.psf(fields_deg=[7.0], **how)
        assert pt.render(scene, alone, pixel_um=5.0, patches=(1, 1)).shape == scene.shape
        with pytest.raises(pz.InputError, match="rotationally symmetric"):
            pt.render(scene, alone._replace(rotationally_symmetric=False), pixel_um=5.0, patches=(1, 1))
