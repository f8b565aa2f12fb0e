import numpy as np
import pytest

import petzval as pz
from optics import picture, psfs

torch = pytest.importorskip("torch")

from petzval.torch import restore  # noqa: E402


def batch(pixels: np.ndarray, dtype: object = torch.float32) -> "torch.Tensor":
    return torch.from_numpy(pixels).permute(2, 0, 1)[None].to(dtype)


@pytest.mark.parametrize(("colours", "dtype"), [(1, torch.float32), (3, torch.float32), (3, torch.float64)])
@pytest.mark.parametrize(("size", "patches", "fields"), [((48, 64), (1, 1), 1), ((51, 37), (3, 4), 2), ((33, 50), (5, 5), 17)])
@pytest.mark.parametrize("noise", [1e-4, 0.3])
def test_it_is_petzvals_restoration(
    size: tuple[int, int], patches: tuple[int, int], fields: int, colours: int, noise: float, dtype: object
) -> None:
    bank, blurred = psfs(fields, colours), picture(*size, colours)
    curves = np.random.default_rng(1).normal(scale=0.5, size=(colours, 6))
    for wiener in (pz.Wiener(noise=noise), pz.Wiener(noise=noise, power=1.5, curves=curves)):
        wanted = pz.restore(blurred, bank, pixel_um=3.0, wiener=wiener, patches=patches)
        found = restore(batch(blurred, dtype), bank, pixel_um=3.0, wiener=wiener, patches=patches)[0].permute(1, 2, 0).numpy()
        assert found.shape == wanted.shape
        assert np.abs(found - wanted).max() <= 1e-5 * np.abs(wanted).max()


def test_a_window_has_the_filters_of_its_place() -> None:
    bank, blurred = psfs(5, 3, pitch_um=5.0), picture(30, 35, 3)
    options = {"pixel_um": 5.0, "patches": (4, 3), "shape": (90, 120), "row": 50, "column": 60}
    wanted = pz.restore(blurred, bank, **options)
    found = restore(batch(blurred), bank, **options)[0].permute(1, 2, 0).numpy()
    assert np.abs(found - wanted).max() <= 1e-5 * np.abs(wanted).max()
    elsewhere = restore(batch(blurred), bank, **{**options, "row": 0, "column": 0})[0].permute(1, 2, 0).numpy()
    assert np.abs(found - elsewhere).max() > 1e-3


def test_gradients_are_those_of_differences() -> None:
    bank = psfs(2, 2, grid=4, corner_mm=0.03)
    values, radius = torch.tensor(bank.values), torch.tensor(bank.field_radius_mm)
    blurred, random = batch(picture(6, 5, 2), torch.float64), np.random.default_rng(0)
    noise, curves = torch.tensor(0.01, dtype=torch.float64), torch.tensor(random.normal(scale=0.3, size=(2, 6)))
    power = torch.tensor(2.0, dtype=torch.float64)

    def restored(*inputs: "torch.Tensor") -> "torch.Tensor":
        blurred, values, radius, noise, power, curves = inputs
        psfs_ = pz.FieldPsfs(values, radius, bank.pitch_um, bank.illumination)
        return restore(blurred, psfs_, pixel_um=5.0, wiener=pz.Wiener(noise, power, curves), patches=(1, 2))

    inputs = [of.clone().requires_grad_() for of in (blurred, values, radius, noise, power, curves)]
    assert torch.autograd.gradcheck(restored, inputs, eps=1e-6, atol=1e-6)


def test_wrong_arguments_are_exceptions() -> None:
    bank, blurred = psfs(3, 3), batch(picture(20, 24, 3))
    for bad in (blurred[0], blurred[:, :2], blurred.half(), blurred.numpy(), blurred[..., :0]):
        with pytest.raises(pz.InputError):
            restore(bad, bank, pixel_um=5.0)
    for curves in (np.zeros((2, 6)), np.zeros((3, 5)), np.zeros(6)):
        with pytest.raises(pz.InputError, match="curves"):
            restore(blurred, bank, pixel_um=5.0, wiener=pz.Wiener(curves=curves))
    for name, value in (("pixel_um", -1.0), ("patches", (0, 1)), ("shape", (10, 10)), ("row", 1), ("column", -1)):
        with pytest.raises(pz.InputError):
            restore(blurred, bank, **{"pixel_um": 5.0, name: value})
