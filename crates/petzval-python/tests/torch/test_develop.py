"""Development as operators: equal to Petzval's own, with gradients, and a parameter that is found by descent."""

import copy
import io
import pickle
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import petzval as pz
import petzval.torch as pt

sys.path.insert(0, str(Path(__file__).parent.parent))
from test_isp import INFO, SHAPE, linear, mosaic, scene

torch.set_num_threads(1)

ISP = pz.Isp.load("automotive").at_gain(INFO.gain_ev)
FRAME = pz.RawFrame.like(INFO)


def raw(**how: Any) -> Any:
    return torch.from_numpy(mosaic().astype(np.float32)).to(**how)


def weights(frames: int = 1) -> Any:
    at = torch.arange(frames * 3 * SHAPE[0] * SHAPE[1], dtype=torch.float32)
    return (torch.sin(0.37 * at) + 0.2).reshape(frames, 3, *SHAPE)


def test_pictures_are_those_of_petzval() -> None:
    wanted = np.moveaxis(ISP.smooth(mosaic(), INFO), -1, 0)
    found = pt.develop(raw(), isp=ISP, frame=INFO)
    assert found.shape == (3, *SHAPE) and found.dtype == torch.float32
    np.testing.assert_allclose(found.numpy(), wanted, atol=1e-5)
    fixed = ISP.develop(mosaic(), INFO, bits=16) / 65535
    assert np.mean((np.moveaxis(fixed, -1, 0) - found.clamp(0, 1).numpy()) ** 2) < 10**-5.2

    # Frames with parameters of their own, and parameters that all share; whole numbers and 64 bits.
    values = torch.from_numpy(ISP.values())
    other = torch.from_numpy(ISP.with_(gain_stops=0.5).values())
    batch = torch.stack([raw(), raw() + 5.0])
    each = pt.develop(batch, torch.stack([values, other]), isp=ISP, frame=FRAME)
    assert torch.equal(each[0], found)
    assert torch.equal(each[1], pt.develop(batch, other, isp=ISP, frame=FRAME)[1])
    assert torch.equal(pt.develop(torch.from_numpy(mosaic()), isp=ISP, frame=FRAME), found)
    assert pt.develop(raw(dtype=torch.float64), isp=ISP, frame=FRAME).dtype == torch.float64


def test_gradients_are_those_of_differences() -> None:
    names = list(ISP.parameters)
    theta = ISP.with_(gain_stops=0.4, output_contrast=1.1).values()
    values = torch.from_numpy(theta).requires_grad_()
    numbers = raw().requires_grad_()
    # Smooth weights over the picture: the differences then stand above the rounding of 32 bits.
    y, x = torch.meshgrid(torch.arange(SHAPE[0]), torch.arange(SHAPE[1]), indexing="ij")
    smooth = (torch.sin(0.37 * x + 0.23 * y) + 0.2).double()

    def loss(numbers: Any, values: Any) -> Any:
        return (pt.develop(numbers, values, isp=ISP, frame=FRAME).double() * smooth).sum()

    loss(numbers, values).backward()
    with torch.no_grad():
        for name in ("gain.stops", "white_balance.red", "tone_map.strength", "gamma.exponent", "output.contrast"):
            step = torch.zeros_like(values)
            step[names.index(name)] = 2e-3
            difference = (loss(numbers, values + step) - loss(numbers, values - step)) / 4e-3
            assert float(values.grad[names.index(name)]) == pytest.approx(float(difference), rel=0.03, abs=0.01), name
        error = size = 0.0
        for i in range(0, SHAPE[0] * SHAPE[1], 97):
            pixel = torch.zeros(SHAPE[0] * SHAPE[1])
            pixel[i] = 1.0
            pixel = pixel.reshape(SHAPE)
            difference = float(loss(numbers + pixel, values) - loss(numbers - pixel, values)) / 2
            error, size = error + (float(numbers.grad.flatten()[i]) - difference) ** 2, size + difference**2
        assert 0 < error < 0.01 * size
    by_raw, by_values = ISP.pull_back(mosaic(), np.repeat(smooth.numpy()[..., None], 3, axis=-1), INFO, values=theta)
    np.testing.assert_allclose(numbers.grad.numpy(), by_raw, atol=1e-5 * np.abs(by_raw).max())
    np.testing.assert_allclose(values.grad.numpy(), by_values, rtol=1e-5, atol=1e-5 * np.abs(by_values).max())


def test_linear_development_is_that_of_petzval() -> None:
    isp = linear(demosaic="malvar")
    shade = torch.from_numpy(np.moveaxis(np.clip(1.0 - 0.3 * scene(), 0.1, 1.0), -1, 0).astype(np.float32))
    numbers = torch.stack([raw(), raw() + 3.0]).requires_grad_()
    light = shade.clone().requires_grad_()
    found = pt.develop_linear(numbers, light, isp=isp)
    for i, frame in enumerate(numbers.detach().numpy()):
        wanted = isp.develop(frame, np.moveaxis(shade.numpy(), 0, -1))
        np.testing.assert_allclose(found[i].detach().numpy(), np.moveaxis(wanted, -1, 0), atol=1e-5)
    flat = pt.develop_linear(raw(), isp=isp)
    np.testing.assert_allclose(flat.numpy(), np.moveaxis(isp.develop(mosaic()), -1, 0), atol=1e-5)

    # It is affine in the numbers below saturation: differences are exact up to rounding.
    (found * weights(2)).sum().backward()
    random = torch.Generator().manual_seed(3)
    with torch.no_grad():
        along = torch.randn(numbers.shape, generator=random)
        moved = [pt.develop_linear(numbers + sign * 0.5 * along, light, isp=isp).double() for sign in (1, -1)]
        difference = ((moved[0] - moved[1]) * weights(2)).sum()
        assert float((numbers.grad * along).sum()) == pytest.approx(float(difference), rel=2e-3)
        across = torch.randn(light.shape, generator=random)
        moved = [pt.develop_linear(numbers, light + sign * 1e-3 * across, isp=isp).double() for sign in (1, -1)]
        difference = ((moved[0] - moved[1]) * weights(2)).sum() / 2e-3
        assert float((light.grad * across).sum()) == pytest.approx(float(difference), rel=2e-3)


def test_operators_pass_opcheck() -> None:
    ops, chip = torch.ops.petzval, pt.Isp(ISP, frame=FRAME)
    numbers, values = torch.stack([raw(), raw() + 5.0]), chip.values().detach().expand(2, -1)
    isp = chip._number
    torch.library.opcheck(ops.develop.default, (numbers, values, isp))
    torch.library.opcheck(ops.develop_backward.default, (numbers, values, weights(2), isp))
    from petzval.torch.develop import _number_linear

    isp, light = _number_linear(linear()), torch.ones(2, 3, *SHAPE)
    torch.library.opcheck(ops.develop_linear.default, (numbers, light, isp))
    torch.library.opcheck(ops.develop_linear_backward.default, (numbers, light, weights(2), isp))


def test_functional_transforms() -> None:
    values = torch.from_numpy(ISP.values())
    several = torch.stack([values, torch.from_numpy(ISP.with_(gain_stops=0.4).values())])

    def loss(values: Any, numbers: Any) -> Any:
        return pt.develop(numbers, values, isp=ISP, frame=FRAME).square().mean()

    mapped = torch.func.vmap(loss, in_dims=(0, None))(several, raw())
    single = torch.stack([loss(row, raw()) for row in several])
    torch.testing.assert_close(mapped, single)
    mapped = torch.func.vmap(torch.func.grad(loss), in_dims=(0, None))(several, raw())
    single = torch.stack([torch.func.grad(loss)(row, raw()) for row in several])
    torch.testing.assert_close(mapped, single)
    rows = torch.func.jacrev(lambda v: pt.develop(raw(), v, isp=ISP, frame=FRAME).mean((1, 2)))(values)
    assert rows.shape == (3, len(values))
    with pytest.raises(NotImplementedError, match="second derivatives"):
        torch.autograd.functional.hessian(lambda v: loss(v, raw()), values)


def test_it_compiles_as_one_graph() -> None:
    chip = pt.Isp(ISP, frame=FRAME, vary=["gain", "sharpen"])
    light = linear()
    whole = torch.compile(
        lambda raw: chip(raw).square().mean() + pt.develop_linear(raw, isp=light).mean(), fullgraph=True, backend="aot_eager"
    )
    whole(raw()).backward()
    compiled, chip.places.grad = chip.places.grad, None
    (chip(raw()).square().mean() + pt.develop_linear(raw(), isp=light).mean()).backward()
    torch.testing.assert_close(compiled, chip.places.grad, rtol=1e-5, atol=1e-8)


def test_a_module_moves_parameters_inside_their_ranges() -> None:
    chip = pt.Isp(ISP, frame=FRAME)
    assert len(chip.places) == len(ISP.parameters) and "vary" in repr(chip)
    np.testing.assert_allclose(chip.values().detach(), ISP.values(), rtol=1e-12, atol=1e-12)
    rows = list(ISP.parameters.values())
    for place, at in ((-3.0, [p.min for p in rows]), (5.0, [p.max for p in rows])):
        with torch.no_grad():
            chip.places.fill_(place)
        np.testing.assert_allclose(chip.values().detach(), at, rtol=1e-12)
        np.testing.assert_allclose(chip.isp().values(), at, rtol=1e-12)
        # Beyond a bound, derivatives that lead back pass, and no others.
        for sign in (1.0, -1.0):
            chip.places.grad = None
            (sign * chip.values().sum()).backward()
            assert bool((chip.places.grad != 0).all()) == ((place < 0) == (sign < 0))
    toe = pt.Isp(ISP, frame=FRAME, vary="gamma.toe")
    assert toe.varied == ("gamma.toe",)
    with torch.no_grad():
        toe.places.fill_(0.5)
    low, high = ISP.parameters["gamma.toe"].min, ISP.parameters["gamma.toe"].max
    assert toe.isp()["gamma.toe"] == pytest.approx(np.sqrt(low * high))
    again = pt.Isp(ISP, frame=FRAME, vary="gamma.toe")
    again.load_state_dict(toe.state_dict())
    assert torch.equal(again.values(), toe.values())


def test_a_pickled_module_develops_for_its_own_camera_in_another_process(tmp_path) -> None:
    # Companded numbers and meshes are known of the frame, too.
    grid = np.linspace(0.6, 1.0, 36)
    about = {"companding": ([0, 1000, 4095], [0, 1000, 60000]), "shading": grid.reshape(3, 3, 4), "warp": grid[:24].reshape(2, 3, 4)}
    colours = {"response": [0.7, 1.0, 0.81], "noise": (2e-4, 1e-6), "saturation": 1.4, "white_dn": 50000.0, "colour_matrix": np.eye(3) + 0.1}
    info = pz.FrameInfo(bits=12, cfa="GRBG", black_level_dn=64.0, gain_ev=1.5, **about, **colours)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pz.PetzvalWarning)
        frame = pz.RawFrame.like(info)
    assert pz.RawFrame._of_about(frame._about)._about == frame._about

    for known in (FRAME, frame):
        chip = pt.Isp(ISP, frame=known, vary="sharpen")
        with torch.no_grad():
            wanted = chip(raw())
        assert torch.equal(pickle.loads(pickle.dumps(chip))(raw()), wanted)
        assert torch.equal(copy.deepcopy(chip)(raw()), wanted)
        torch.save({"chip": chip, "raw": raw(), "wanted": wanted}, tmp_path / "chip.pt")
        # The other process has an ISP of its own first, of another camera.
        code = f"""
import sys, torch, petzval as pz, petzval.torch as pt
pz.set_threads(1)
pt.Isp(pz.Isp.load("neutral").with_(demosaic="bilinear"), frame=pz.FrameInfo(bits=12, cfa="RGGB", black_level_dn=200, white_dn=4000, noise=(1e-4, 0)))
kept = torch.load({str(tmp_path / "chip.pt")!r}, weights_only=False)
with torch.no_grad():
    print(torch.equal(kept["chip"](kept["raw"]), kept["wanted"]))
"""
        done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True)
        assert done.stdout == "True\n", done.stderr


def test_a_state_is_loaded_only_by_a_module_with_the_same_parameters() -> None:
    def made(vary: Any, isp: pz.Isp = ISP, frame: pz.RawFrame = FRAME) -> Any:
        return pt.Isp(isp, frame=frame, vary=vary)

    two = ["sharpen.amount", "sharpen.sigma"]
    kept = io.BytesIO()
    torch.save(torch.nn.Sequential(made(two)).state_dict(), kept)
    kept.seek(0)
    state = torch.load(kept, weights_only=True)
    again = torch.nn.Sequential(made(two))
    with torch.no_grad():
        again[0].places.add_(0.1)
    again.load_state_dict(state)
    assert torch.equal(again[0].places, made(two).places)

    gain = pz.RawFrame.like(replace(INFO, gain_ev=INFO.gain_ev + 1.0))
    # At another gain the values that do not vary are held as they are: the gain alone differs.
    for other, what in (
        (made(["gamma.exponent", "output.contrast"]), "parameters that vary"),
        (made(two, ISP.with_(gamma_exponent=1.1 * ISP["gamma.exponent"])), "do not vary"),
        (made(two, frame=gain), "gain"),
    ):
        before = other.places.detach().clone()
        with pytest.raises(pz.InputError, match=what):
            torch.nn.Sequential(other).load_state_dict(state)
        assert torch.equal(other.places, before)

    # States of earlier versions hold the places alone.
    with torch.no_grad():
        again[0].places.add_(0.1)
    with pytest.warns(pz.PetzvalWarning, match="earlier version"):
        again.load_state_dict({"0.places": state["0.places"]})
    assert torch.equal(again[0].places, state["0.places"])


def test_a_module_stays_float64_whatever_a_model_is_cast_to() -> None:
    chip = pt.Isp(ISP, frame=FRAME, vary="sharpen")
    places, wanted = chip.places.detach().clone(), chip.values().detach()
    for cast in (lambda: chip.half(), lambda: chip.to(torch.bfloat16), lambda: torch.nn.Sequential(chip).float()):
        cast()
        assert chip.places.dtype == torch.float64 and torch.equal(chip.places, places)
        assert torch.equal(chip.values(), wanted)
    assert chip(raw(dtype=torch.float16)).dtype == torch.float16
    state = {name: value.half() if isinstance(value, torch.Tensor) else value for name, value in chip.state_dict().items()}
    chip.load_state_dict(state, assign=True)
    assert chip.places.dtype == torch.float64


def test_parameters_are_found_by_descent() -> None:
    hidden = ISP.with_(gain_stops=0.6, white_balance_red=1.3)
    target = pt.develop(raw(), isp=hidden, frame=FRAME)
    chip = pt.Isp(ISP, frame=FRAME, vary=["gain.stops", "white_balance.red"])
    optimizer = torch.optim.Adam(chip.parameters(), lr=0.05)
    losses = []
    for step in range(50):
        optimizer.param_groups[0]["lr"] = 0.05 * (1 - step / 50)
        optimizer.zero_grad()
        loss = (chip(raw()) - target).square().mean()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 1e-3 * losses[0]
    found = chip.isp()
    assert found["gain.stops"] == pytest.approx(0.6, abs=0.02)
    assert found["white_balance.red"] == pytest.approx(1.3, abs=0.02)


def test_wrong_tensors_are_exceptions() -> None:
    values = torch.from_numpy(ISP.values())
    for call in (
        lambda: pt.develop(raw()[0], isp=ISP, frame=FRAME),
        lambda: pt.develop(raw()[:, :-1], isp=ISP, frame=FRAME),
        lambda: pt.develop(raw() * float("nan"), isp=ISP, frame=FRAME),
        lambda: pt.develop(raw(), values[:-1], isp=ISP, frame=FRAME),
        lambda: pt.develop(raw(), values + 1e4, isp=ISP, frame=FRAME),
        lambda: pt.develop(raw(), values[None, None], isp=ISP, frame=FRAME),
        lambda: pt.Isp(ISP, frame=FRAME, vary=["sharpness"]),
        lambda: pt.develop_linear(raw()[0], isp=linear()),
        lambda: pt.develop_linear(raw(), torch.ones(3, 4, 4), isp=linear()),
        lambda: pt.develop_linear(raw() * float("inf"), isp=linear()),
    ):
        with pytest.raises(pz.InputError):
            call()
    plain: list[tuple[str, Any]] = [
        ("raw", lambda: pt.develop(raw().numpy(), isp=ISP, frame=FRAME)),
        ("raw", lambda: pt.develop(raw() + 0j, isp=ISP, frame=FRAME)),
        ("raw", lambda: pt.develop(raw() > 100, isp=ISP, frame=FRAME)),
        ("isp", lambda: pt.develop(raw(), isp="quality", frame=FRAME)),
        ("isp", lambda: pt.Isp("quality", frame=FRAME)),
        ("frame", lambda: pt.develop(raw(), isp=ISP, frame="a")),
        ("isp", lambda: pt.develop_linear(raw(), isp="a")),
        ("illumination", lambda: pt.develop_linear(raw(), np.ones((3, *SHAPE)), isp=linear())),
    ]
    for key, call in plain:
        with pytest.raises(pz.InputError) as caught:
            call()
        assert caught.value.place.key == key and caught.value.hint


@pytest.mark.filterwarnings("ignore:.torch.jit")
def test_forward_derivatives_are_errors_and_never_zero() -> None:
    with pytest.raises(NotImplementedError):
        torch.func.jvp(lambda numbers: pt.develop(numbers, isp=ISP, frame=FRAME), (raw(),), (torch.ones_like(raw()),))
