"""Curvature steps: against Adam, against the formula in NumPy, and their state."""

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import petzval as pz  # noqa: E402
import petzval.torch as pt  # noqa: E402

OPTIONS = {"fields_deg": [0.0, 7.0, 14.0], "wavelengths_um": [0.486, 0.55, 0.62], "grid": 32, "pitch_um": 4.0, "pupil_cells": 32}


def _spot(glass: pt.Lens, options: dict = OPTIONS) -> torch.Tensor:
    """Mean squared radius of the PSFs about their chief ray, cells^2."""
    values = glass.psf(**options).values
    at = torch.arange(values.shape[-1], dtype=torch.float64) - 0.5 * (values.shape[-1] - 1)
    return (values * (at[:, None] ** 2 + at[None, :] ** 2)).sum((-1, -2)).mean()


def _losses(glass: pt.Lens, optimizer: torch.optim.Optimizer, steps: int, penalty: float) -> list[float]:
    losses = []

    def closure() -> torch.Tensor:
        optimizer.zero_grad()
        loss = _spot(glass)
        losses.append(float(loss.detach()))
        (loss + penalty * glass.penalty()).backward()
        return loss

    for _ in range(steps):
        optimizer.step(closure)
    return losses


def _moved(triplet: pz.Lens) -> pt.Lens:
    glass = pt.Lens(triplet)
    random = np.random.default_rng(1)
    with torch.no_grad():
        glass.x += torch.from_numpy(0.05 * random.normal(size=len(glass.x)))
    return glass


def test_a_loss_falls_faster_than_by_adam(triplet: pz.Lens) -> None:
    glass = _moved(triplet)
    curved = _losses(glass, pt.LevenbergMarquardt(glass, penalty_weight=10.0), 13, 0.0)
    assert curved[-1] < 0.45 * curved[0]
    # Adam at its best rate does not come that far with five times as many steps.
    for rate in (3e-3, 1e-2, 3e-2):
        glass = _moved(triplet)
        losses = _losses(glass, torch.optim.Adam(glass.parameters(), lr=rate), 61, 10.0)
        assert losses[0] == curved[0]
        assert min(losses) > 1.1 * curved[-1], rate


def test_a_step_is_that_of_the_formula(triplet: pz.Lens) -> None:
    glass = _moved(triplet)
    x = glass.x.detach().clone()
    optimizer = pt.LevenbergMarquardt(glass, lr=1e-3, penalty_weight=0.0)

    def closure() -> torch.Tensor:
        loss = _spot(glass)
        loss.backward()
        return loss

    loss = float(optimizer.step(closure).detach())
    gradient = glass.x.grad.numpy()
    state = optimizer.state[glass.x]
    curvature = state["curvature"].numpy() / (1.0 - 0.95)
    np.testing.assert_allclose(curvature, curvature.T, rtol=1e-9, atol=1e-9 * np.abs(curvature).max())
    assert np.linalg.eigvalsh(curvature).min() > -1e-9 * np.abs(curvature).max()
    np.testing.assert_allclose(state["gradient"].numpy() / (1.0 - 0.9), 0.5 * gradient, rtol=1e-9)
    # Damped by a hundredth of each coordinate's own curvature.
    damped = curvature + np.diag(1e-2 * np.diag(curvature) + 1e-9 * np.diag(curvature).max())
    step = -1e-3 * np.linalg.solve(damped, 0.5 * gradient)
    np.testing.assert_allclose(glass.x.detach().numpy() - x.numpy(), step, rtol=1e-6, atol=1e-12)
    # The minimum of the undamped paraboloid is at most as low as zero: g' (w J'J)^-1 g <= L, with g half of the gradient.
    explained = 0.25 * gradient @ np.linalg.pinv(curvature, rcond=1e-11) @ gradient
    assert 0.0 < explained <= loss * (1.0 + 1e-6)


def test_the_curvature_is_the_motion_of_rays(triplet: pz.Lens) -> None:
    glass = _moved(triplet)
    x = glass.x.detach().numpy().copy()
    optimizer = pt.LevenbergMarquardt(glass, lr=1e-3, penalty_weight=0.0)

    def closure() -> torch.Tensor:
        loss = _spot(glass)
        loss.backward()
        return loss

    optimizer.step(closure)
    curvature = optimizer.state[glass.x]["curvature"].numpy()

    # Rays of spot diagrams by differences: about their chief ray, and the chief ray itself, um.
    def landings(x: np.ndarray) -> list[np.ndarray]:
        spots = glass.space.lens_at(x).with_(wavelengths_um=OPTIONS["wavelengths_um"]).spots(OPTIONS["fields_deg"])
        about_chief = [np.concatenate(points) / np.sqrt(sum(map(len, points))) for points in spots.points_um]
        return [*about_chief, 1e3 * spots.chief_mm]

    moved = [zip(landings(x + h), landings(x - h)) for h in 1e-5 * np.eye(len(x))]
    jacobian = np.stack([np.concatenate([(a - b).ravel() for a, b in pairs]) for pairs in moved], axis=-1)
    motion = jacobian.T @ jacobian
    scale = (curvature * motion).sum() / (motion * motion).sum()
    # The rays of the step sample the whole stop by Gauss-Legendre quadrature, those of the diagram a grid that apertures cut.
    assert np.linalg.norm(curvature - scale * motion) < 0.06 * np.linalg.norm(curvature)


def test_the_gradient_after_a_step_is_that_of_backward(triplet: pz.Lens) -> None:
    glass = _moved(triplet)
    (_spot(glass) + glass.x.square().sum()).backward()
    wanted = glass.x.grad.clone()
    optimizer = pt.LevenbergMarquardt(glass)

    def closure() -> torch.Tensor:
        # By two PSF calls, and by the coordinates directly.
        near = _spot(glass, {**OPTIONS, "fields_deg": [0.0]}) / 3
        far = 2 * _spot(glass, {**OPTIONS, "fields_deg": [7.0, 14.0]}) / 3
        loss = near + far + glass.x.square().sum()
        loss.backward()
        return loss

    optimizer.step(closure)
    torch.testing.assert_close(glass.x.grad, wanted, rtol=1e-9, atol=1e-11)


def test_violated_limits_are_mended(triplet: pz.Lens) -> None:
    glass = pt.Lens(triplet, triplet.variables(back_focal_mm=(0.0, 0.97 * triplet.bfl_mm)))
    before = float(glass.penalty().detach())
    assert before > 0.5
    _losses(glass, pt.LevenbergMarquardt(glass, lr=0.5, penalty_weight=100.0), 20, 0.0)
    assert float(glass.penalty().detach()) < 0.05 * before


def test_a_resumed_run_takes_the_same_steps(triplet: pz.Lens) -> None:
    whole = _moved(triplet)
    optimizer = pt.LevenbergMarquardt(whole)
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.5)
    _losses(whole, optimizer, 3, 0.0)
    part = pt.Lens(triplet)
    part.load_state_dict(whole.state_dict())
    other = pt.LevenbergMarquardt(part)
    other.load_state_dict(optimizer.state_dict())
    for glass, of in ((whole, optimizer), (part, other)):
        _losses(glass, of, 2, 0.0)
    assert torch.equal(whole.x, part.x)
    schedule.step()
    assert optimizer.param_groups[0]["lr"] == pytest.approx(0.15)


def test_wrong_losses_and_arguments(glass: pt.Lens) -> None:
    for arguments in ({"lens": None}, {"lens": glass, "lr": 0.0}, {"lens": glass, "lr": math.nan}, {"lens": glass, "lr": "1"}):
        with pytest.raises(pz.InputError):
            pt.LevenbergMarquardt(**arguments)
    with pytest.raises(pz.InputError, match="penalty_weight"):
        pt.LevenbergMarquardt(glass, penalty_weight=-1.0)
    x = glass.x.detach().clone()
    optimizer = pt.LevenbergMarquardt(glass)
    for scale, match in ((-1.0, "loss"), (0.0, "loss"), (math.nan, "loss"), (math.inf, "loss")):
        def closure(scale: float = scale) -> torch.Tensor:
            loss = scale * _spot(glass)
            loss.backward()
            return loss

        with pytest.raises(pz.InputError, match=match):
            optimizer.step(closure)
    with pytest.raises(pz.InputError, match="no gradient by PSFs"):
        optimizer.step(lambda: _spot(glass))
    with pytest.raises(pz.InputError, match="no gradient by PSFs"):
        optimizer.step(lambda: glass.x.square().sum())
    assert torch.equal(glass.x.detach(), x)
    # A closure that fails leaves the lens as it was, with its graph whole.
    with pytest.raises(ZeroDivisionError):
        optimizer.step(lambda: 1 / 0)
    assert _spot(glass).requires_grad and glass._cut is None


def test_a_loss_that_no_ray_moves_leaves_the_lens(glass: pt.Lens) -> None:
    x = glass.x.detach().clone()

    def closure() -> torch.Tensor:
        loss = 1.0 + 0.0 * _spot(glass)
        loss.backward()
        return loss

    with pytest.warns(pz.PetzvalWarning, match="the lens stays"):
        pt.LevenbergMarquardt(glass).step(closure)
    assert torch.equal(glass.x.detach(), x)


def test_a_closure_returns_its_loss(triplet: pz.Lens) -> None:
    glass = pt.Lens(triplet)
    steps = pt.LevenbergMarquardt(glass)
    for wrong in (None, 1.0, torch.ones(2)):
        with pytest.raises(pz.InputError, match="closure: it returned"):
            steps.step(lambda wrong=wrong: wrong)
