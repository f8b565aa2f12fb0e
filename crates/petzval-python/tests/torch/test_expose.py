import numpy as np
import pytest

import petzval as pz

torch = pytest.importorskip("torch")

from petzval.torch import expose  # noqa: E402

MODES = ["exact", "dequantised", "half_step", "straight_through", "gaussian", "off"]
PATTERN = {"specimen": 5, "dsnu_pixel_e": 20.0, "dsnu_row_e": 5.0, "prnu_pixel_percent": 2.0, "hot_pixel_share": 0.02, "hot_pixel_e_per_s": 4000.0}


@pytest.fixture(scope="module")
def sensor() -> pz.Sensor:
    return pz.Sensor.load("imx249-fitted")


def light(height: int, width: int, colours: int, most: float = 9000.0) -> np.ndarray:
    return np.random.default_rng(7).uniform(0.0, most, (height, width, colours)).astype(np.float32)


def batch(pixels: np.ndarray, dtype: object = torch.float32) -> "torch.Tensor":
    return torch.from_numpy(pixels).permute(2, 0, 1)[None].to(dtype)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("colours", [1, 3])
@pytest.mark.parametrize("size", [(16, 20), (17, 31)])
@pytest.mark.parametrize("cfa", ["RGGB", "mono", "GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG"])
@pytest.mark.parametrize("pattern", [{}, PATTERN])
def test_without_noise_it_is_petzvals_sensor(
    sensor: pz.Sensor, size: tuple[int, int], cfa: str, pattern: dict[str, float], colours: int, dtype: object
) -> None:
    for electronics in ("before_adc", "after_adc"):
        own = sensor.with_(cfa=cfa, nonuniformity=pattern, electronics=electronics)
        for most in (50.0, 9000.0, 90000.0):
            electrons = light(*size, colours, most)
            settings = {"time_s": 0.05, "linear_gain": 1.5, "row": 9, "column": 4}
            given = electrons[..., 0] if colours == 1 else electrons
            wanted = own.mean_dn(given, **settings)
            found = expose(batch(electrons, dtype), own, seed=0, mode="off", **settings)
            assert found.shape == (1, 1, *size)
            assert np.abs(found[0, 0].numpy() - wanted).max() <= 1e-5 * wanted.max()


@pytest.mark.parametrize("colours", [1, 3])
def test_without_noise_the_gradient_is_petzvals(sensor: pz.Sensor, colours: int) -> None:
    own = sensor.with_(nonuniformity=PATTERN, full_well_e=8000.0)
    electrons = light(12, 15, colours, 12000.0)
    tensor = batch(electrons, torch.float64).requires_grad_()
    expose(tensor, own, seed=0, mode="off", row=1, column=2).sum().backward()
    slope = own.expose_with_derivative(electrons[..., 0] if colours == 1 else electrons, "off", row=1, column=2)[1]
    rows, columns = (1 + np.arange(12)) % 2, (2 + np.arange(15)) % 2
    share = np.ones((12, 15, 1)) if colours == 1 else own.response[rows[:, None], columns[None, :]]
    wanted = slope[..., None] * share
    assert (wanted == 0.0).any() and (wanted > 0.0).any()
    np.testing.assert_allclose(tensor.grad[0].permute(1, 2, 0).numpy(), wanted, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "off"])
@pytest.mark.parametrize("electrons", [0.3, 6.0, 400.0, 12000.0])
def test_the_noise_has_petzvals_mean_and_variance(sensor: pz.Sensor, mode: str, electrons: float) -> None:
    own = sensor.with_(nonuniformity={"row_noise_e": 3.0, "column_noise_e": 2.0})
    flat = np.full((300, 400), electrons, dtype=np.float32)
    settings = {"time_s": 0.02, "linear_gain": 4.0 if electrons < 5000 else 1.0}
    found = expose(torch.from_numpy(flat)[None, None].double(), own, seed=11, mode=mode, **settings)[0, 0].numpy()
    assert np.all(found == np.round(found))
    exact = own.expose_with_derivative(flat, mode, seed=5, **settings)[0]
    scale = 0.14 * settings["linear_gain"]

    def rest(dn: np.ndarray) -> np.ndarray:
        """Without what rows and columns share."""
        return dn - dn.mean(0, keepdims=True) - dn.mean(1, keepdims=True) + dn.mean()

    # Rows and columns share noise: it sets the standard error of the mean of a frame.
    spread = scale * np.sqrt(9.0 / 300 + 4.0 / 400) + rest(exact).std() / np.sqrt(exact.size)
    assert abs(found.mean() - exact.mean()) <= 4 * np.sqrt(2.0) * spread
    # Each variance has a relative standard error of sqrt((kurtosis - 1) / n), 3 for normal noise; four of the difference.
    variances = [rest(dn).var() for dn in (found, exact)]
    kurtosis = (rest(exact) ** 4).mean() / variances[1] ** 2
    assert abs(variances[0] / variances[1] - 1.0) <= 4 * np.sqrt(2.0 * (kurtosis - 1.0) / exact.size)
    # What rows and columns share stands above the mean of their pixels' own noise; four standard errors of a deviation of 300 or 400.
    for axis, noise_e in ((1, 3.0), (0, 2.0)):
        own_e = np.sqrt(variances[0] / found.shape[axis]) / scale
        assert found.mean(axis).std() / scale == pytest.approx(np.hypot(noise_e, own_e), rel=4 / np.sqrt(2 * found.shape[1 - axis]))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("electrons", [0.02, 0.5, 5.0, 300.0])
def test_derivatives_have_the_moments_of_petzvals(sensor: pz.Sensor, mode: str, electrons: float) -> None:
    # A wide converter: nothing is cut off, so that the derivative is that of the electrons.
    own = sensor.with_(black_level_dn=2000.0, dark_current_e_per_s=0.0)
    flat = np.full((300, 400), electrons, dtype=np.float32)
    tensor = torch.from_numpy(flat)[None, None].double().requires_grad_()
    expose(tensor, own, seed=3, mode=mode).sum().backward()
    found, wanted = tensor.grad[0, 0].numpy(), own.expose_with_derivative(flat, mode, seed=9)[1].astype(np.float64)
    error = np.sqrt((found.var() + wanted.var()) / found.size)
    assert abs(found.mean() - wanted.mean()) <= 4 * error + 1e-7
    if wanted.std() > 1e-6:
        kurtosis = ((wanted - wanted.mean()) ** 4).mean() / wanted.var() ** 2
        assert abs(found.var() / wanted.var() - 1.0) <= 4 * np.sqrt(2.0 * (kurtosis - 1.0) / found.size)
    else:
        assert found.std() < 1e-9


def test_the_derivative_of_a_draw_is_that_of_its_mode(sensor: pz.Sensor) -> None:
    quiet = sensor.with_(read_noise_e=0.0, electronics_noise_dn=0.0, dark_current_e_per_s=0.0, gain_dn_per_e=1.0, bits=16)
    electrons = torch.full((1, 1, 50, 60), 40.0, dtype=torch.float64, requires_grad=True)
    found = expose(electrons, quiet, seed=1, mode="gaussian")
    found.sum().backward()
    # Digital numbers of gain 1 hold z to the rounding.
    z = (found.detach() - quiet.black_level_dn - quiet.electronics_mean_dn - quiet.read_noise_mean_e - 40.0) / 40.0**0.5
    torch.testing.assert_close(electrons.grad, 1.0 + z / (2.0 * 40.0**0.5), atol=0.51 / 80.0, rtol=0.0)


def test_seeds_and_generators(sensor: pz.Sensor) -> None:
    electrons = batch(light(20, 30, 3))
    one, same, other = (expose(electrons, sensor, seed=seed, mode="exact") for seed in (1, 1, 2))
    assert torch.equal(one, same) and not torch.equal(one, other)
    generator = torch.Generator().manual_seed(1)
    first, second = (expose(electrons, sensor, seed=generator, mode="exact") for _ in range(2))
    assert torch.equal(first, one) and not torch.equal(second, one)
    # Pictures of a batch have noise of their own, and the global generator is left alone.
    state = torch.random.get_rng_state()
    two = expose(torch.cat([electrons, electrons]), sensor, seed=1, mode="exact")
    assert not torch.equal(two[0], two[1]) and torch.equal(state, torch.random.get_rng_state())


def test_what_blocks_the_gradient(sensor: pz.Sensor) -> None:
    electrons = torch.tensor([[-5.0, 100.0, 40000.0, 28800.0, float("nan"), float("inf")]], dtype=torch.float64)[None, None].requires_grad_()
    dn = expose(electrons, sensor, seed=1, mode="straight_through")
    assert torch.isnan(dn[0, 0, 0, 4:]).all() and dn[0, 0, 0, 2] == 4095.0
    dn[0, 0, 0, :4].sum().backward()
    torch.testing.assert_close(electrons.grad[0, 0, 0, :4], torch.tensor([0.0, 0.14, 0.0, 0.0], dtype=torch.float64))
    for mode in MODES:
        expose(electrons.detach(), sensor, seed=1, mode=mode)


def test_gradients_are_those_of_differences(sensor: pz.Sensor) -> None:
    electrons = batch(light(6, 7, 3), torch.float64).requires_grad_()
    own = sensor.with_(nonuniformity=PATTERN)
    assert torch.autograd.gradcheck(lambda e: expose(e, own, seed=0, mode="off", time_s=0.1), [electrons], eps=1e-2, atol=1e-7)


def test_a_camera_learns_through_render_and_expose(sensor: pz.Sensor) -> None:
    from optics import picture, psfs
    from petzval.torch import render

    bank, scene = psfs(3, 3), batch(picture(24, 30, 3))
    values = torch.tensor(bank.values, dtype=torch.float32, requires_grad=True)
    irradiance = render(scene, pz.FieldPsfs(values, bank.field_radius_mm, bank.pitch_um, bank.illumination), pixel_um=5.0, patches=(3, 3))
    expose(8000.0 * irradiance, sensor, seed=1, mode="dequantised").square().mean().backward()
    assert torch.isfinite(values.grad).all() and values.grad.abs().max() > 0.0


def test_wrong_arguments_are_exceptions(sensor: pz.Sensor) -> None:
    flat = torch.ones((1, 1, 4, 4))
    for bad in (flat[0], flat[:, [0, 0]], flat.half(), flat.long(), flat.numpy(), None, flat[..., :0]):
        with pytest.raises(pz.InputError, match="electrons"):
            expose(bad, sensor, seed=0)
    for setting in (
        {"seed": -1},
        {"seed": 1.5},
        {"seed": None},
        {"mode": "poisson"},
        {"mode": None},
        {"row": 1197},
        {"column": -1},
        {"time_s": -1.0},
        {"time_s": float("nan")},
        {"linear_gain": 0.0},
    ):
        with pytest.raises(pz.InputError, match=next(iter(setting))):
            expose(flat, sensor, **{"seed": 0, **setting})
    with pytest.raises(pz.InputError, match="linear_gain"):
        expose(flat, sensor.with_(gain_steps=[1.0, 4.0]), seed=0, linear_gain=2.9)


@pytest.mark.parametrize("mode", MODES)
def test_gradients_of_functions_are_those_of_backward(sensor: pz.Sensor, mode: str) -> None:
    electrons = batch(light(6, 7, 3)).requires_grad_()

    def loss(electrons: "torch.Tensor") -> "torch.Tensor":
        return expose(electrons, sensor, seed=4, mode=mode).square().mean()

    loss(electrons).backward()
    assert electrons.grad.dtype == torch.float32 and (electrons.grad.abs().max() > 0.0) == (mode != "exact")
    torch.testing.assert_close(torch.func.grad(loss)(electrons.detach()), electrons.grad)
