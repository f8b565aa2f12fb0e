"""The operators of the optics: PyTorch's own checks, gradients by differences, and what they keep alive."""

import gc
from collections.abc import Callable

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import petzval as pz  # noqa: E402
import petzval.torch as pt  # noqa: E402
from petzval.torch import _ops  # noqa: E402

# PyTorch's own checks use what it advises against.
OF_OPCHECK = pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor", "ignore:.torch.jit")


def _plan(lens: pt.Lens, kind: str = "geometric") -> tuple:
    return lens._key, [0.0, 8.0], [0.55], 16, 4.0, kind, 64


def _cotangents(seed: int) -> tuple:
    random = torch.Generator().manual_seed(seed)
    return tuple(torch.randn(shape, dtype=torch.float64, generator=random) for shape in ((2, 1, 16, 16), (2, 1), (2, 2)))


@OF_OPCHECK
def test_opcheck_passes_on_every_operator(glass: pt.Lens) -> None:
    x = glass.x.detach()
    numbers = _ops.lens_numbers(x, glass._key)
    plan = _plan(glass)
    calls = {
        _ops.LENS_NUMBERS: (x, glass._key),
        _ops.LENS_PENALTY: (x, glass._key),
        _ops.PSF: (numbers, *plan),
        _ops.PSF_BACKWARD: (numbers, *_cotangents(1), *plan),
        _ops.PSF_FORWARD: (numbers, torch.linspace(-1.0, 1.0, len(numbers), dtype=torch.float64), *plan),
    }
    every = {name for name in vars(_ops) if isinstance(vars(_ops)[name], _ops._Operator)}
    assert len(calls) == len(every)
    for operator, arguments in calls.items():
        found = [torch.library.opcheck(operator.call, arguments)]
        # What has a gradient is checked with one, too.
        if operator not in (_ops.PSF_BACKWARD, _ops.PSF_FORWARD):
            found.append(torch.library.opcheck(operator.call, (arguments[0].clone().requires_grad_(), *arguments[1:])))
        assert all(len(tests) == 4 and set(tests.values()) == {"SUCCESS"} for tests in found)


def test_an_operator_called_by_name_has_a_gradient(glass: pt.Lens) -> None:
    x = glass.x.detach().requires_grad_()
    value, _ = torch.ops.petzval.lens_penalty(x, glass._key)
    numbers, _ = torch.ops.petzval.lens_numbers(x, glass._key)
    values, *_ = torch.ops.petzval.psf(numbers, *_plan(glass))
    (gradient,) = torch.autograd.grad(values.square().sum() + value, x)
    psfs = glass.psf(fields_deg=[0.0, 8.0], wavelengths_um=[0.55], grid=16, pitch_um=4.0)
    (psfs.values.square().sum() + glass.penalty()).backward()
    torch.testing.assert_close(gradient, glass.x.grad, rtol=1e-12, atol=1e-14)


def _slope(loss: Callable, x: torch.Tensor, direction: torch.Tensor, step: float) -> float:
    """The derivative along a direction: the mean of five central differences, which the rounding of aimed rays moves by 1e-7."""
    with torch.no_grad():
        along = [(loss(x + h * direction) - loss(x - h * direction)) / (2 * h) for h in (step * k for k in range(1, 6))]
        return float(sum(along) / 5)


def _gradient_and_direction(loss: Callable, glass: pt.Lens) -> tuple[float, torch.Tensor]:
    x = glass.x.detach().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(x), x)
    direction = torch.randn(len(x), dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    return float(gradient @ direction), direction


# A splat has kinks: with random cotangents a step must hardly move the rays. Waves have none.
@pytest.mark.parametrize(("kind", "step"), [("geometric", 1e-6), ("diffraction", 3e-6)])
def test_gradients_of_psfs_are_those_of_differences(glass: pt.Lens, kind: str, step: float) -> None:
    by_values, by_light, by_chief = _cotangents(2)

    def loss(x: torch.Tensor) -> torch.Tensor:
        values, light, chief, _ = _ops.psf(_ops.lens_numbers(x, glass._key), _plan(glass, kind))
        return (values * by_values).sum() + (light * by_light).sum() + (chief * by_chief).sum()

    exact, direction = _gradient_and_direction(loss, glass)
    assert abs(exact) > 1e-3
    assert exact == pytest.approx(_slope(loss, glass.x, direction, step), rel=1e-6)


def test_each_coordinate_has_its_slope(glass: pt.Lens) -> None:
    by_values, by_light, by_chief = _cotangents(4)

    def loss(x: torch.Tensor) -> torch.Tensor:
        values, light, chief, _ = _ops.psf(_ops.lens_numbers(x, glass._key), _plan(glass))
        return (values * by_values).sum() + (light * by_light).sum() + (chief * by_chief).sum()

    x = glass.x.detach().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(x), x)
    differences = [_slope(loss, x, one, 1e-6) for one in torch.eye(len(x), dtype=torch.float64)]
    torch.testing.assert_close(gradient, torch.tensor(differences, dtype=torch.float64), rtol=1e-6, atol=1e-6 * float(gradient.abs().max()))


def test_the_penalty_has_its_gradient(triplet: pz.Lens) -> None:
    glass = pt.Lens(triplet, triplet.variables(track_mm=10.0))

    def penalty(x: torch.Tensor) -> torch.Tensor:
        return _ops.lens_penalty(x, glass._key)

    exact, direction = _gradient_and_direction(penalty, glass)
    assert abs(exact) > 1e-2 and exact == pytest.approx(_slope(penalty, glass.x, direction, 1e-6), rel=1e-6)


def test_psfs_are_those_of_the_lens(glass: pt.Lens) -> None:
    with torch.no_grad():
        glass.x += 0.01
    options = {"fields_deg": [0.0, 8.0], "wavelengths_um": [0.486, 0.62], "grid": 32, "pitch_um": 3.0, "pupil_cells": 64}
    psfs = glass.psf(**options)
    bank = pz.psf(glass.lens(), **options, pupil_error=10.0)
    np.testing.assert_allclose(psfs.values.detach().numpy(), bank.values, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(psfs.illumination.detach().numpy(), bank.illumination, rtol=1e-12)
    np.testing.assert_allclose(psfs.chief_mm.detach().numpy(), bank.chief_mm, atol=1e-12)
    np.testing.assert_allclose(psfs.captured.numpy(), bank.captured, rtol=1e-12)
    assert not psfs.captured.requires_grad


@OF_OPCHECK
def test_second_derivatives_raise(glass: pt.Lens) -> None:
    x = glass.x
    psfs = glass.psf(fields_deg=[0.0], wavelengths_um=[0.55], grid=16, pitch_um=4.0)
    (first,) = torch.autograd.grad(psfs.values.square().sum() + glass.penalty(), x, create_graph=True)
    with pytest.raises(NotImplementedError, match="no second derivatives: leave out create_graph=True.*LevenbergMarquardt"):
        torch.autograd.grad(first.sum(), x)

    numbers = _ops.lens_numbers(x.detach(), glass._key)
    direction = torch.ones_like(numbers)

    def along(numbers: torch.Tensor) -> torch.Tensor:
        return torch.func.jvp(lambda n: _ops.psf(n, _plan(glass))[0].square().sum(), (numbers,), (direction,))[1]

    for second in (torch.func.grad(along), lambda n: torch.func.jvp(along, (n,), (direction,))):
        with pytest.raises(NotImplementedError, match="no second derivatives"):
            second(numbers)


def test_a_loss_that_ran_away_gives_nan_and_no_error(glass: pt.Lens) -> None:
    psfs = glass.psf(fields_deg=[0.0], wavelengths_um=[0.55], grid=16, pitch_um=4.0)
    (psfs.values.sum() * float("nan")).backward()
    assert glass.x.grad.isnan().all()


def test_a_graph_keeps_its_lens_and_nothing_else_does(triplet: pz.Lens) -> None:
    gc.collect()
    before = len(_ops._SPACES)
    glass = pt.Lens(triplet)
    x, key = glass.x, glass._key
    loss = glass.psf(fields_deg=[0.0], wavelengths_um=[0.55], grid=16, pitch_um=4.0).values.square().sum()
    del glass
    gc.collect()
    assert key in _ops._SPACES
    loss.backward()
    assert x.grad.abs().max() > 0.0
    del loss
    gc.collect()
    assert len(_ops._SPACES) == before
    with pytest.raises(pz.InputError, match="gone"):
        _ops.lens_penalty(x, key)


def test_ten_thousand_calls_leave_nothing_behind(glass: pt.Lens) -> None:
    def resident_kb() -> int:
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))

    def call(i: int) -> None:
        glass.x.grad = None
        loss = glass.penalty()
        if i % 10 == 0:
            # No plan is like the last ones.
            psfs = glass.psf(fields_deg=[1e-4 * i], wavelengths_um=[0.55], grid=16, pitch_um=8.0, pupil_cells=12)
            loss = loss + psfs.values.square().sum()
        loss.backward()

    for i in range(500):
        call(i)
    gc.collect()
    kb, spaces, plans = resident_kb(), len(_ops._SPACES), _ops._plan.cache_info().maxsize
    for i in range(10_000):
        call(i)
    gc.collect()
    assert len(_ops._SPACES) == len(_ops._KEYS) == spaces
    assert plans is not None and _ops._plan.cache_info().currsize <= plans
    assert resident_kb() - kb < 20_000


def test_an_operator_called_by_its_name_carries_tangents(glass: pt.Lens) -> None:
    numbers = _ops.lens_numbers(glass.x.detach(), glass._key)
    plan = (glass._key, [0.0, 8.0], [0.55], 16, 4.0, "geometric", 16)
    along = torch.full_like(numbers, 1e-3)
    _, right = torch.func.jvp(lambda numbers: _ops.psf(numbers, plan)[0], (numbers,), (along,))
    with torch.autograd.forward_ad.dual_level():
        values, *_ = torch.ops.petzval.psf(torch.autograd.forward_ad.make_dual(numbers, along), *plan)
        found = torch.autograd.forward_ad.unpack_dual(values).tangent
    assert right.abs().max() > 1e-6
    torch.testing.assert_close(found, right, rtol=0.0, atol=0.0)
