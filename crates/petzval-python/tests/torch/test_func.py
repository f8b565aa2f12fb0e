"""Function transforms: each is the same as backward, one lens or one output at a time."""

from collections.abc import Callable

import pytest

torch = pytest.importorskip("torch")

import petzval as pz  # noqa: E402
import petzval.torch as pt  # noqa: E402
from petzval.torch import _ops  # noqa: E402

OPTIONS = {"fields_deg": [0.0, 8.0], "wavelengths_um": [0.55], "grid": 16, "pitch_um": 4.0}


def _psfs(glass: pt.Lens) -> Callable:
    return lambda x: torch.func.functional_call(glass, {"x": x}, kwargs=OPTIONS)


def _loss(glass: pt.Lens) -> Callable:
    psfs_of, weights = _psfs(glass), torch.linspace(0.0, 1.0, 16, dtype=torch.float64)

    def loss(x: torch.Tensor) -> torch.Tensor:
        psfs = psfs_of(x)
        return (psfs.values * weights).square().sum() + psfs.illumination.sum() + psfs.chief_mm.square().sum()

    return loss


def _some(glass: pt.Lens) -> torch.Tensor:
    random = torch.Generator().manual_seed(1)
    x = glass.x.detach()
    return x + 1e-2 * torch.randn((3, len(x)), dtype=torch.float64, generator=random)


def _backward(loss: Callable, x: torch.Tensor) -> torch.Tensor:
    x = x.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(x), x)
    return gradient


def test_grad(glass: pt.Lens) -> None:
    loss = _loss(glass)
    for x in _some(glass):
        torch.testing.assert_close(torch.func.grad(loss)(x), _backward(loss, x), rtol=1e-12, atol=1e-14)


def test_jacrev(glass: pt.Lens) -> None:
    x = glass.x.detach()
    for output in ("illumination", "chief_mm"):
        jacobian = torch.func.jacrev(lambda x: getattr(_psfs(glass)(x), output))(x)
        rows = getattr(_psfs(glass)(x), output)
        assert jacobian.shape == (*rows.shape, len(x))
        for i in range(rows.numel()):
            row = _backward(lambda x: getattr(_psfs(glass)(x), output).flatten()[i], x)
            torch.testing.assert_close(jacobian.reshape(-1, len(x))[i], row, rtol=1e-12, atol=1e-14)


def test_vmap_of_values_and_of_gradients(glass: pt.Lens) -> None:
    some, loss = _some(glass), _loss(glass)
    values = torch.func.vmap(lambda x: _psfs(glass)(x).values)(some)
    assert values.shape == (3, 2, 1, 16, 16)
    gradients = torch.func.vmap(torch.func.grad(loss))(some)
    for x, value, gradient in zip(some, values, gradients):
        torch.testing.assert_close(value, _psfs(glass)(x).values, rtol=0.0, atol=1e-14)
        torch.testing.assert_close(gradient, _backward(loss, x), rtol=1e-12, atol=1e-14)


# PyTorch's forward mode uses what it advises against.
@pytest.mark.filterwarnings("ignore:.torch.jit")
def test_forward_derivatives_of_numbers_and_penalty(triplet) -> None:
    glass = pt.Lens(triplet, triplet.variables(track_mm=10.0))
    x = glass.x.detach()
    direction = torch.linspace(-1.0, 1.0, len(x), dtype=torch.float64)

    def penalty(x: torch.Tensor) -> torch.Tensor:
        return _ops.lens_penalty(x, glass._key)

    _, along = torch.func.jvp(penalty, (x,), (direction,))
    torch.testing.assert_close(along, _backward(penalty, x) @ direction, rtol=1e-12, atol=0.0)

    def numbers(x: torch.Tensor) -> torch.Tensor:
        return _ops.lens_numbers(x, glass._key)

    torch.testing.assert_close(torch.func.jacfwd(numbers)(x), torch.func.jacrev(numbers)(x), rtol=1e-12, atol=1e-15)


def _random(shape: torch.Size | tuple[int, ...], seed: int) -> torch.Tensor:
    return torch.randn(shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


# Rays, and waves on as few cells.
@pytest.mark.parametrize("kind", ["geometric", "diffraction"])
@pytest.mark.filterwarnings("ignore:.torch.jit")
def test_jvp_is_the_gradient_along_a_direction(glass: pt.Lens, kind: str) -> None:
    x, u = glass.x.detach(), _random(glass.x.shape, 5)
    weights = [_random(shape, seed) for seed, shape in enumerate([(2, 1, 16, 16), (2, 1), (2, 2)])]

    def outputs(x: torch.Tensor) -> tuple[torch.Tensor, ...]:
        psfs = torch.func.functional_call(glass, {"x": x}, kwargs={**OPTIONS, "kind": kind})
        return psfs.values, psfs.illumination, psfs.chief_mm, psfs.captured

    def loss(x: torch.Tensor) -> torch.Tensor:
        return sum((output * weight).sum() for output, weight in zip(outputs(x), weights))

    slope = torch.func.grad(loss)(x) @ u
    assert abs(float(slope)) > 1e-3
    _, along = torch.func.jvp(loss, (x,), (u,))
    torch.testing.assert_close(along, slope, rtol=1e-9, atol=0.0)
    values, changes = torch.func.jvp(outputs, (x,), (u,))
    torch.testing.assert_close(values, outputs(x), rtol=0.0, atol=0.0)
    # The captured share has no gradient, forward as backward.
    assert not changes[3].any()
    with torch.autograd.forward_ad.dual_level():
        dual = loss(torch.autograd.forward_ad.make_dual(x, u))
        torch.testing.assert_close(torch.autograd.forward_ad.unpack_dual(dual).tangent, slope, rtol=1e-9, atol=0.0)


@pytest.mark.filterwarnings("ignore:.torch.jit")
def test_jacfwd_is_jacrev(glass: pt.Lens) -> None:
    x = glass.x.detach()

    def outputs(x: torch.Tensor) -> tuple[torch.Tensor, ...]:
        # All light of a field, and the cells of one row: jacrev takes one backward an output.
        psfs = torch.func.functional_call(glass, {"x": x}, kwargs={**OPTIONS, "fields_deg": [8.0]})
        return psfs.values[0, 0, 7, 4:12], psfs.illumination, psfs.chief_mm

    for forward, backward in zip(torch.func.jacfwd(outputs)(x), torch.func.jacrev(outputs)(x)):
        torch.testing.assert_close(forward, backward, rtol=1e-9, atol=1e-12)


@pytest.mark.filterwarnings("ignore:.torch.jit")
def test_vmap_of_jvp(glass: pt.Lens) -> None:
    loss, some = _loss(glass), _some(glass)
    directions = _random(some.shape, 7)
    slopes = torch.func.vmap(lambda x, u: torch.func.jvp(loss, (x,), (u,))[1])(some, directions)
    for x, u, slope in zip(some, directions, slopes):
        torch.testing.assert_close(slope, _backward(loss, x) @ u, rtol=1e-9, atol=1e-14)


@pytest.mark.filterwarnings("ignore:.torch.jit")
def test_derivatives_of_vmap(glass: pt.Lens) -> None:
    losses, some = torch.func.vmap(_loss(glass)), _some(glass)
    directions = _random(some.shape, 9)
    gradient = torch.func.grad(lambda some: losses(some).sum())(some)
    for x, row in zip(some, gradient):
        torch.testing.assert_close(row, _backward(_loss(glass), x), rtol=1e-12, atol=1e-14)
    _, slopes = torch.func.jvp(losses, (some,), (directions,))
    torch.testing.assert_close(slopes, (gradient * directions).sum(1), rtol=1e-9, atol=0.0)


@pytest.mark.filterwarnings("ignore:.torch.jit")
@pytest.mark.parametrize("outer", ["jacfwd", "jacrev"])
@pytest.mark.parametrize("inner", ["jacfwd", "jacrev"])
def test_second_derivatives_raise_in_every_order(glass: pt.Lens, outer: str, inner: str) -> None:
    second = getattr(torch.func, outer)(getattr(torch.func, inner)(_loss(glass)))
    with pytest.raises(NotImplementedError, match="no second derivatives"):
        second(glass.x.detach())


def test_a_direction_is_checked(glass: pt.Lens) -> None:
    numbers = _ops.lens_numbers(glass.x.detach(), glass._key)
    plan = (glass._key, [0.0, 8.0], [0.55], 16, 4.0, "geometric", 64)
    with pytest.raises(pz.InputError, match=r"direction of shape \[19\]: has the wrong shape"):
        _ops.PSF_FORWARD.call(numbers, numbers[:-1], *plan)
    # A tangent that has run away stays NaN, as gradients do.
    assert all(output.isnan().all() for output in _ops.PSF_FORWARD.call(numbers, numbers * torch.nan, *plan))


def test_coordinates_in_float32_are_traced_in_float64(glass: pt.Lens) -> None:
    x = glass.x.detach().float()
    gradient = torch.func.grad(_loss(glass))(x)
    assert gradient.dtype == torch.float32 and _psfs(glass)(x).values.dtype == torch.float64
    torch.testing.assert_close(gradient, torch.func.grad(_loss(glass))(x.double()).float(), rtol=1e-6, atol=0.0)
