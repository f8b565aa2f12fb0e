"""Function transforms: each is the same as backward, one lens or one output at a time."""

from collections.abc import Callable

import pytest

torch = pytest.importorskip("torch")

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


def test_coordinates_in_float32_are_traced_in_float64(glass: pt.Lens) -> None:
    x = glass.x.detach().float()
    gradient = torch.func.grad(_loss(glass))(x)
    assert gradient.dtype == torch.float32 and _psfs(glass)(x).values.dtype == torch.float64
    torch.testing.assert_close(gradient, torch.func.grad(_loss(glass))(x.double()).float(), rtol=1e-6, atol=0.0)
