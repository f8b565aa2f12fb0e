"""torch.compile without a break of the graph gives the values and gradients of eager mode."""

import os
import shutil
import warnings

import pytest

torch = pytest.importorskip("torch")

import petzval as pz  # noqa: E402
import petzval.torch as pt  # noqa: E402

pytestmark = [
    pytest.mark.filterwarnings("ignore"),
    pytest.mark.skipif(
        not any(shutil.which(name) for name in (os.environ.get("CXX", "g++"), "g++", "clang++")),
        reason="NOT TESTED: torch.compile needs a C++ compiler, and none was found",
    ),
]


def test_a_compiled_step_is_the_eager_one(glass: pt.Lens, triplet: pz.Lens) -> None:
    torch.compiler.reset()
    scale = torch.linspace(0.5, 2.0, 16)

    def loss(glass: pt.Lens) -> torch.Tensor:
        psfs = glass.psf(fields_deg=[0.0, 8.0], wavelengths_um=[0.55], grid=16, pitch_um=4.0).to(torch.float32)
        return (psfs.values * scale).square().sum() + psfs.illumination.sum() + glass.penalty()

    compiled = torch.compile(loss, fullgraph=True)
    tight = pt.Lens(triplet, triplet.variables(track_mm=10.0))
    # The second lens has another key: the same code, another space.
    for one in (glass, tight):
        found = []
        for of in (loss, compiled):
            one.x.grad = None
            value = of(one)
            value.backward()
            found.append((value.detach(), one.x.grad.clone()))
        (value, gradient), (compiled_value, compiled_gradient) = found
        assert gradient.abs().max() > 0.0
        torch.testing.assert_close(compiled_value, value, rtol=1e-6, atol=0.0)
        torch.testing.assert_close(compiled_gradient, gradient, rtol=1e-5, atol=1e-7)
    assert float(tight.penalty()) > float(glass.penalty())


def test_curvature_steps_take_a_compiled_loss(triplet: pz.Lens) -> None:
    torch.compiler.reset()

    def loss(glass: pt.Lens) -> torch.Tensor:
        return glass.psf(fields_deg=[0.0, 8.0], wavelengths_um=[0.55], grid=16, pitch_um=4.0).values.square().sum()

    found = []
    for of in (loss, torch.compile(loss, fullgraph=True, backend="aot_eager")):
        glass = pt.Lens(triplet)
        with torch.no_grad():
            glass.x += 0.02
        optimizer = pt.LevenbergMarquardt(glass)

        def closure(glass: pt.Lens = glass, of=of) -> torch.Tensor:
            value = of(glass)
            value.backward()
            return value

        for _ in range(3):
            optimizer.step(closure)
        found.append(glass.x.detach())
    torch.testing.assert_close(found[1], found[0], rtol=0.0, atol=1e-12)


def test_wrong_arguments_are_errors_of_the_compiled_step_too(glass: pt.Lens) -> None:
    torch.compiler.reset()
    compiled = torch.compile(lambda: glass.psf(fields_deg=[0.0], grid=2).values.sum(), fullgraph=True, backend="aot_eager")
    with warnings.catch_warnings(), pytest.raises(Exception, match="16 to 1024"):
        warnings.simplefilter("ignore")
        compiled()


@pytest.mark.parametrize("of", ["jvp", "jacfwd"])
def test_forward_derivatives_are_refused_within_a_graph_and_never_zero(glass: pt.Lens, of: str) -> None:
    x = glass.x.detach()

    def light(x: torch.Tensor) -> torch.Tensor:
        options = {"fields_deg": [0.0, 8.0], "wavelengths_um": [0.55], "grid": 16, "pitch_um": 4.0}
        return torch.func.functional_call(glass, {"x": x}, kwargs=options).chief_mm

    def forward(x: torch.Tensor) -> torch.Tensor:
        return torch.func.jvp(light, (x,), (torch.ones_like(x),))[1] if of == "jvp" else torch.func.jacfwd(light)(x)

    assert forward(x).abs().max() > 1e-6
    torch.compiler.reset()
    with pytest.raises(Exception, match="torch.compile has no forward derivatives"):
        torch.compile(forward, fullgraph=True, backend="eager")(x)
    torch.compiler.reset()
    with pytest.raises(NotImplementedError, match="torch.compile has no forward derivatives"):
        torch.func.jvp(torch.compile(light, backend="eager"), (x,), (torch.ones_like(x),))
