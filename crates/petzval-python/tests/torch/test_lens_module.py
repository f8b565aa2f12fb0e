"""A lens as a module: casts, devices, states, copies, two at once, and training."""

import copy
import io
import pickle

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import torch.utils.checkpoint  # noqa: E402

import petzval as pz  # noqa: E402
import petzval.torch as pt  # noqa: E402

OPTIONS = {"fields_deg": [0.0, 8.0], "wavelengths_um": [0.55], "grid": 16, "pitch_um": 4.0}


def test_the_parameter_is_the_coordinates_of_the_lens(glass: pt.Lens, triplet: pz.Lens) -> None:
    assert [name for name, _ in glass.named_parameters()] == ["x"]
    assert glass.x.dtype == torch.float64
    np.testing.assert_allclose(glass.x.detach().numpy(), triplet.variables().start, atol=1e-12)
    assert glass.lens().efl_mm == pytest.approx(triplet.efl_mm, rel=1e-9)
    assert triplet.name in repr(glass) and f"{len(glass.x)} coordinates" in repr(glass)


def test_casts_of_a_model_leave_the_coordinates_alone(glass: pt.Lens) -> None:
    x = glass.x.detach().clone()
    model = torch.nn.Sequential(glass, torch.nn.Linear(2, 2))
    glass.x.grad = torch.ones_like(glass.x)
    for cast in (
        lambda: model.half(),
        lambda: model.bfloat16(),
        lambda: model.float(),
        lambda: model.to(torch.float16),
        lambda: model.to("cpu", torch.float32),
        lambda: model.to(torch.zeros(1, dtype=torch.float16)),
        lambda: model.type(torch.float32),
        lambda: model.double(),
        lambda: glass.half(),
    ):
        cast()
        assert glass.x.dtype == glass.x.grad.dtype == torch.float64
        assert torch.equal(glass.x.detach(), x)
    assert model.half()[1].weight.dtype == torch.float16
    # A device that has no float64.
    glass._apply(_refuse)
    assert torch.equal(glass.x.detach(), x)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert glass.psf(**OPTIONS).values.dtype == torch.float64


def _refuse(tensor: torch.Tensor) -> torch.Tensor:
    raise TypeError("Cannot convert a tensor to float64")


def test_float32_downstream(glass: pt.Lens) -> None:
    psfs = glass.psf(**OPTIONS)
    single = psfs.to(torch.float32)
    assert single.values.dtype == single.illumination.dtype == single.chief_mm.dtype == torch.float32
    assert single.fields_deg == (0.0, 8.0) and single.pitch_um == 4.0
    (exact,) = torch.autograd.grad(psfs.values.square().sum(), glass.x)
    (rounded,) = torch.autograd.grad(glass.psf(**OPTIONS).to(torch.float32).values.square().sum(), glass.x)
    assert rounded.dtype == torch.float64
    torch.testing.assert_close(rounded, exact, rtol=1e-4, atol=1e-5 * float(exact.abs().max()))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="NOT TESTED: no CUDA device")
def test_on_another_device_results_come_back_there(glass: pt.Lens) -> None:
    (here,) = torch.autograd.grad(glass.psf(**OPTIONS).values.square().sum(), glass.x)
    glass.to("cuda", torch.float16)
    psfs = glass.psf(**OPTIONS)
    assert glass.x.is_cuda and glass.x.dtype == torch.float64 and psfs.values.is_cuda and glass.penalty().is_cuda
    (there,) = torch.autograd.grad(psfs.values.square().sum() + glass.penalty(), glass.x)
    torch.testing.assert_close(there.cpu(), here, rtol=1e-9, atol=1e-12)
    optimizer = pt.LevenbergMarquardt(glass)

    def closure() -> torch.Tensor:
        loss = glass.psf(**OPTIONS).values.square().sum()
        loss.backward()
        return loss

    x = glass.x.detach().clone()
    optimizer.step(closure)
    assert glass.x.is_cuda and not torch.equal(glass.x.detach(), x)


def test_a_state_is_saved_and_loaded(glass: pt.Lens, triplet: pz.Lens) -> None:
    with torch.no_grad():
        glass.x += 0.02
    kept = io.BytesIO()
    torch.save(glass.state_dict(), kept)
    kept.seek(0)
    other = pt.Lens(triplet)
    assert not torch.equal(other.x, glass.x)
    other.load_state_dict(torch.load(kept, weights_only=True))
    assert torch.equal(other.x, glass.x)
    assert other.lens().to_toml() == glass.lens().to_toml()


@pytest.mark.parametrize("assign", [False, True])
def test_a_state_that_was_cast_is_loaded_in_float64(glass: pt.Lens, assign: bool) -> None:
    state = {name: value.float() if isinstance(value, torch.Tensor) else value for name, value in glass.state_dict().items()}
    glass.load_state_dict(state, assign=assign)
    assert glass.x.dtype == torch.float64 and isinstance(glass.x, torch.nn.Parameter)
    assert torch.equal(glass.x.detach(), state["x"].double())


def test_inference_and_checkpointing(glass: pt.Lens) -> None:
    def loss() -> torch.Tensor:
        return glass.psf(**OPTIONS).values.square().sum()

    loss().backward()
    wanted = glass.x.grad.clone()
    with torch.inference_mode():
        assert not loss().requires_grad
    glass.x.grad = None
    torch.utils.checkpoint.checkpoint(loss, use_reentrant=False).backward()
    assert torch.equal(glass.x.grad, wanted)


def test_a_state_of_another_space_is_refused(glass: pt.Lens, triplet: pz.Lens) -> None:
    radius = triplet.surfaces[0].radius_mm
    spaces = [
        triplet.variables([pz.Variable(0, "radius_mm", low * radius, 1.2 * radius)], focus="fixed") for low in (0.8, 0.9)
    ]
    one, two = (pt.Lens(triplet, space) for space in spaces)
    before = two.x.detach().clone()
    with pytest.raises(pz.InputError, match="coordinates"):
        two.load_state_dict(one.state_dict())
    assert torch.equal(two.x.detach(), before)
    with pytest.raises(pz.InputError, match="coordinates"):
        glass.load_state_dict(one.state_dict())


def test_copies_share_the_space_and_move_alone(glass: pt.Lens) -> None:
    for other in (copy.deepcopy(glass), pickle.loads(pickle.dumps(glass))):
        with torch.no_grad():
            other.x += 0.01
        assert not torch.equal(other.x, glass.x)
        psfs = other.psf(**OPTIONS)
        psfs.values.square().sum().backward()
        assert other.x.grad.abs().max() > 0.0 and glass.x.grad is None
    assert copy.deepcopy(glass).space is glass.space


def test_two_lenses_at_once(glass: pt.Lens, triplet: pz.Lens) -> None:
    radius = triplet.surfaces[0].radius_mm
    space = triplet.variables([pz.Variable(0, "radius_mm", 0.8 * radius, 1.2 * radius)])
    other = pt.Lens(triplet, space)
    both = torch.nn.ModuleList([glass, other])
    loss = sum(lens.psf(**OPTIONS).values.square().sum() for lens in both)
    loss.backward()
    together = [lens.x.grad.clone() for lens in both]
    assert together[0].shape != together[1].shape
    for lens, gradient in zip(both, together):
        lens.x.grad = None
        lens.psf(**OPTIONS).values.square().sum().backward()
        assert torch.equal(lens.x.grad, gradient)


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"fields_deg": "x"}, "fields_deg"),
        ({"fields_deg": [None]}, "fields_deg"),
        ({"fields_deg": []}, "fields_deg"),
        ({"fields_deg": [float("nan")]}, "fields_deg"),
        ({"fields_deg": [200.0]}, "fields_deg"),
        ({"fields_deg": object()}, "fields_deg"),
        ({"wavelengths_um": [550.0]}, "wavelengths_um"),
        ({"grid": 2}, "grid"),
        ({"grid": 16.0}, "grid"),
        ({"grid": -(10**12)}, "grid"),
        ({"pitch_um": -1.0}, "pitch_um"),
        ({"pitch_um": float("nan")}, "pitch_um"),
        ({"pitch_um": "1"}, "pitch_um"),
        ({"kind": "rays"}, "kind"),
        ({"kind": None}, "kind"),
        ({"pupil_cells": 0}, "pupil_cells"),
        ({"pupil_cells": None}, "pupil_cells"),
    ],
)
def test_wrong_arguments_name_themselves(glass: pt.Lens, options: dict, name: str) -> None:
    with pytest.raises(pz.InputError, match=name) as caught:
        glass.psf(**{**OPTIONS, **options})
    assert caught.value.place.key == name


def test_wrong_lenses_spaces_and_coordinates(glass: pt.Lens, triplet: pz.Lens) -> None:
    for lens, space in (("cooke-triplet-nominal", None), (None, None), (triplet, triplet), (triplet, [1.0])):
        with pytest.raises(pz.InputError):
            pt.Lens(lens, space)
    with torch.no_grad():
        glass.x[0] = float("nan")
    for call in (lambda: glass.psf(**OPTIONS), glass.penalty, glass.lens):
        with pytest.raises(pz.InputError, match="not finite"):
            call()


def test_a_list_an_array_and_a_tensor_are_the_same_fields(glass: pt.Lens) -> None:
    wanted = glass.psf(**OPTIONS).values
    for fields in ((0, 8), np.float32([0.0, 8.0]), np.arange(0.0, 16.0, 4.0)[::2], torch.tensor([0.0, 8.0])):
        assert torch.equal(glass.psf(**{**OPTIONS, "fields_deg": fields}).values, wanted)
    assert glass.psf(**{**OPTIONS, "fields_deg": 8.0}).values.shape[0] == 1


def test_left_out_fields_and_wavelengths_are_those_of_the_lens(glass: pt.Lens, triplet: pz.Lens) -> None:
    psfs = glass.psf(grid=16, pitch_um=8.0)
    assert psfs.fields_deg == tuple(triplet.fields_deg) and psfs.wavelengths_um == tuple(triplet.wavelengths_um)
    assert psfs.values.shape[:2] == (len(triplet.fields_deg), len(triplet.wavelengths_um))


def test_a_small_network_learns_behind_a_moving_lens(glass: pt.Lens) -> None:
    torch.manual_seed(0)
    net = torch.nn.Sequential(torch.nn.Conv2d(1, 8, 5, padding=2), torch.nn.ReLU(), torch.nn.Conv2d(8, 1, 5, padding=2))
    optimizer = torch.optim.Adam([{"params": net.parameters(), "lr": 4e-3}, {"params": glass.parameters(), "lr": 1e-2}])
    model = torch.nn.ModuleList([net, glass]).float()
    start, efl_mm, losses = glass.x.detach().clone(), glass.lens().efl_mm, []
    for _ in range(80):
        scene = torch.nn.functional.avg_pool2d(torch.rand(4, 1, 96, 96), 3)
        psfs = glass.psf(fields_deg=[0.0, 12.0], wavelengths_um=[0.55], grid=16, pitch_um=6.0, pupil_cells=32).to(torch.float32)
        blurred = [
            torch.nn.functional.conv2d(part, psf[None], padding=8)[..., :32, :32]
            for part, psf in zip(scene.split(2), psfs.values)
        ]
        raw = torch.cat(blurred) + 0.01 * torch.randn_like(scene)
        loss = torch.nn.functional.mse_loss(raw + net(raw), scene) + glass.penalty().float()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    first, last = np.mean(losses[:10]), np.mean(losses[-10:])
    assert last < 0.6 * first
    assert float((glass.x.detach() - start).abs().max()) > 1e-2
    assert glass.x.dtype == torch.float64 and len(list(model.parameters())) == 5
    # What was designed is a lens like any other.
    assert glass.lens().efl_mm == pytest.approx(efl_mm, rel=1e-6)


def test_texts_are_no_numbers(glass: pt.Lens) -> None:
    with pytest.raises(pz.InputError, match="fields_deg"):
        glass.psf(fields_deg="09", grid=16)  # type: ignore[arg-type]
    psfs = glass.psf(fields_deg=[0.0], grid=16, pitch_um=4.0)
    with pytest.raises(pz.InputError, match="pixel_um"):
        pt.render(torch.ones(1, 3, 16, 16), psfs, pixel_um="8", patches=(1, 1))  # type: ignore[arg-type]
