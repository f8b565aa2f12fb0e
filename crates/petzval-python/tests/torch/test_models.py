"""Torch modules give what Petzval's networks give, and their weights go back to the bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import petzval as pz  # noqa: E402
from petzval.torch import models  # noqa: E402
from petzval.weights import Kind  # noqa: E402

SIZES: dict[Kind, dict[str, Any]] = {
    "u-net": {"base_channels": 8, "levels": 2, "in_channels": 3, "out_channels": 3},
    "restoration": {"base_channels": 8, "levels": 1},
    "restoration-naf": {"base_channels": 8, "levels": 2},
    "segmenter": {"classes": 5, "base_channels": 8, "levels": 2},
    "isp-proxy": {"parameters": 3, "base_channels": 8, "levels": 2, "thumbnail_channels": 4, "hidden": 16},
    "optics-proxy": {"inputs": 3, "hidden": 8, "channels": 8},
}


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


def _trained(kind: Kind, seed: int = 1, **settings: Any) -> pz.Weights:
    """Weights none of which is where it started: those that start at 0 or 1 move, too."""
    weights = pz.Weights.drawn(kind, seed=seed, **settings)
    random = np.random.default_rng(seed)
    moved = {name: tensor + 0.1 * random.normal(size=tensor.shape) for name, tensor in weights.tensors.items() if np.ptp(tensor) == 0.0}
    return weights.with_(moved)


def _inputs(weights: pz.Weights, height: int, width: int, batch: int = 2) -> dict[str, Any]:
    random = np.random.default_rng(5)

    def uniform(*shape: int) -> Any:
        return random.random(shape, dtype=np.float32)

    match weights.kind:
        case "isp-proxy":
            return {"raw": uniform(batch, 4, height, width), "theta": 2 * uniform(batch, weights.settings["parameters"]) - 1}
        case "optics-proxy":
            return {"inputs": 4 * uniform(batch, weights.settings["inputs"]) - 2}
        case "restoration" | "restoration-naf":
            planes = {name: uniform(batch, 3, height, width) for name in ("restored", "developed")}
            return {**planes, "field": uniform(batch, 1, height, width), "noise": 0.05 * uniform(batch, 1, height, width)}
        case _:
            return {"pictures": uniform(batch, 3, height, width)}


def _outputs(module: Any, inputs: dict[str, Any]) -> list[Any]:
    with torch.no_grad():
        outputs = module(*map(torch.from_numpy, inputs.values()))
    return [output.numpy() for output in (outputs if isinstance(outputs, tuple) else (outputs,))]


@pytest.mark.parametrize("kind", SIZES)
def test_a_module_gives_what_the_network_gives(kind: Kind) -> None:
    weights = _trained(kind, **SIZES[kind])
    module = models.from_weights(weights)
    for height, width in ((24, 32), (19, 22)):
        inputs = _inputs(weights, height, width)
        wanted = list(weights.run(**inputs).values())
        for found, of_petzval in zip(_outputs(module, inputs), wanted, strict=False):
            assert found.shape == of_petzval.shape and np.ptp(of_petzval) > 0.0
            assert np.abs(found - of_petzval).max() < 1e-5 * max(1.0, np.abs(of_petzval).max())
    if isinstance(module, models.Restoration):
        np.testing.assert_allclose(module.restoration_curves.detach().numpy(), wanted[1], rtol=1e-6)


def test_the_built_in_network_in_torch() -> None:
    weights = pz.Weights.built_in("restoration_naf")
    inputs = _inputs(weights, 70, 52, batch=1)
    (found,) = _outputs(models.from_weights(weights), inputs)
    assert np.abs(found - weights.run(**inputs)["finished"]).max() < 1e-5


@pytest.mark.parametrize("kind", SIZES)
def test_weights_go_back_to_the_bit_and_learn_on(kind: Kind) -> None:
    weights = _trained(kind, **SIZES[kind])
    module = models.from_weights(weights)
    back = models.to_weights(module)
    assert back.kind == kind and back.settings == weights.settings
    assert all(np.array_equal(back.tensors[name], tensor) for name, tensor in weights.tensors.items())

    # A step of an optimiser, and the network goes home.
    inputs = {name: torch.from_numpy(value) for name, value in _inputs(weights, 16, 16).items()}
    optimizer = torch.optim.Adam(module.parameters(), lr=1e-3)
    output = module.train()(*inputs.values())
    (output[0] if isinstance(output, tuple) else output).square().sum().backward()
    optimizer.step()
    moved = models.to_weights(module)
    assert sum(not np.array_equal(moved.tensors[name], tensor) for name, tensor in weights.tensors.items()) > len(weights.tensors) // 2
    found = _outputs(module.eval(), _inputs(weights, 16, 16))[0]
    of_petzval = next(iter(moved.run(**_inputs(weights, 16, 16)).values()))
    assert np.abs(found - of_petzval).max() < 1e-5 * max(1.0, np.abs(of_petzval).max())


@pytest.mark.parametrize("kind", SIZES)
def test_a_module_from_scratch_begins_like_the_network(kind: Kind) -> None:
    torch.manual_seed(1)
    drawn = pz.Weights.drawn(kind, **SIZES[kind])
    module = type(models.from_weights(drawn))(**SIZES[kind])
    assert isinstance(module, models.PetzvalModule)
    for name, tensor in module.to_weights().tensors.items():
        assert np.ptp(tensor) == 0.0 if np.ptp(drawn.tensors[name]) == 0.0 else 0.6 < tensor.std() / drawn.tensors[name].std() < 1.6, name


def test_what_petzval_does_not_have_is_an_input_error() -> None:
    weights = pz.Weights.drawn("segmenter", **SIZES["segmenter"])
    with pytest.raises(pz.InputError, match="network 'segmenter'; UNet takes 'u-net'"):
        models.UNet.from_weights(weights)
    with pytest.raises(pz.InputError, match="give petzval.Weights"):
        models.from_weights({})  # type: ignore[arg-type]
    with pytest.raises(pz.InputError, match="module is a Linear"):
        models.to_weights(torch.nn.Linear(2, 2))
    module = models.from_weights(weights)
    with torch.no_grad():
        module.get_parameter("last_bias").fill_(float("nan"))
    with pytest.raises(pz.InputError, match="last_bias is not finite"):
        models.to_weights(module)


def _detector(kind: Kind, backbone: str) -> pz.Weights:
    """A detector whose scores are far apart, so that rounding does not change which boxes are chosen."""
    pytest.importorskip("torchvision")
    weights = pz.Weights.drawn(kind, seed=2, backbone=backbone, classes=3)
    spread = {"rpn.head.cls_logits.weight": 10.0, "roi_heads.box_predictor.cls_score.weight": 2.0}
    spread |= {"head.logits.weight": 5.0, "head.logits.bias": 0.2, "head.centredness.weight": 5.0}
    # Untrained backbones with frozen normalisation amplify; the maps of all of them have values of about 1 here.
    spread |= {f"backbone.fpn.layer_blocks.{i}.0.weight": {"small": 1.0, "resnet18": 0.04, "mobilenet-v2": 0.2}[backbone] for i in range(4)}
    return weights.with_({name: factor * weights.tensors[name] for name, factor in spread.items() if name in weights.tensors})


def _found(weights: pz.Weights, picture: Any) -> dict[str, Any]:
    found = weights.run(pictures=picture[None])
    return {"boxes": found["boxes"], "labels": found["classes"] + (weights.kind == "faster-rcnn"), "scores": found["scores"], **found}


def _assert_same(found: dict[str, Any], wanted: dict[str, Any], side: int) -> None:
    assert len(wanted["scores"]) > 10 and len(found["scores"]) == len(wanted["scores"])
    # The order of two detections whose scores differ by rounding alone is not compared.
    far = np.abs(found["scores"][:, None] - wanted["scores"]) / 1e-5
    far = np.maximum(far, np.abs(found["boxes"][:, None] - wanted["boxes"]).max(2) / (1e-5 * side))
    far = np.where(found["labels"][:, None] == wanted["labels"], far, np.inf)
    assert sorted(far.argmin(1)) == list(range(len(far))), np.sort(far.min(1))[-5:]
    assert far.min(1).max() < 1.0, np.sort(far.min(1))[-5:]


@pytest.mark.parametrize("backbone", ["small", "resnet18", "mobilenet-v2"])
def test_a_detector_is_torchvisions(backbone: str) -> None:
    weights = _detector("faster-rcnn", backbone)
    model = models.from_weights(weights)
    picture = np.random.default_rng(7).random((3, 90, 120), dtype=np.float32)
    with torch.no_grad():
        (found,) = model([torch.from_numpy(picture)])
        seen, _ = model.transform([torch.from_numpy(picture)])
        objectness, offsets = model.rpn.head(list(model.backbone(seen.tensors).values()))
    wanted = _found(weights, picture)
    anchors = [of.permute(0, 2, 3, 1).reshape(1, -1) for of in objectness]
    of_offsets = [of.permute(0, 2, 3, 1).reshape(1, -1, 4) for of in offsets]
    for ours, theirs in ((wanted["objectness"], torch.cat(anchors, 1)), (wanted["offsets"], torch.cat(of_offsets, 1))):
        assert np.abs(ours - theirs.numpy()).max() < 1e-5 * np.abs(ours).max()
    _assert_same({name: value.numpy() for name, value in found.items()}, wanted, 120)
    back = models.to_weights(model)
    assert back.settings == weights.settings
    assert all(np.array_equal(back.tensors[name], tensor) for name, tensor in weights.tensors.items())


def test_all_names_of_the_detector_on_resnet50_are_torchvisions() -> None:
    detection = pytest.importorskip("torchvision.models.detection")
    weights = pz.Weights.drawn("faster-rcnn", backbone="resnet50", classes=90)
    theirs = detection.fasterrcnn_resnet50_fpn(weights=None, weights_backbone=None, num_classes=91)
    shapes = {name: tuple(of.shape) for name, of in theirs.state_dict().items() if not name.endswith("num_batches_tracked")}
    assert {name: of.shape for name, of in weights.tensors.items()} == shapes
    assert models.to_weights(theirs).settings == weights.settings


@pytest.mark.parametrize("backbone", ["small", "resnet18"])
def test_the_detector_of_one_stage_in_torch(backbone: str) -> None:
    weights = _detector("fcos", backbone)
    module = models.from_weights(weights)
    assert isinstance(module, models.Fcos)
    picture = np.random.default_rng(7).random((3, 90, 120), dtype=np.float32)
    with torch.no_grad():
        (found,) = module([torch.from_numpy(picture)])
        heads = module.heads(torch.from_numpy(picture[None]))
    wanted = _found(weights, picture)
    for name, said in zip(("logits", "distances", "centredness"), heads, strict=False):
        assert np.abs(wanted[name] - said.numpy()).max() < 1e-5 * np.abs(wanted[name]).max(), name
    _assert_same({name: value.numpy() for name, value in found.items()}, wanted, 120)
    assert all(np.array_equal(models.to_weights(module).tensors[name], tensor) for name, tensor in weights.tensors.items())


def _session(path: Path) -> Any:
    return pytest.importorskip("onnxruntime").InferenceSession(path)


@pytest.mark.parametrize("kind", SIZES)
def test_onnx_files_give_what_the_network_gives(kind: Kind, tmp_path: Path) -> None:
    pytest.importorskip("onnxscript")
    weights = _trained(kind, **SIZES[kind])
    is_dynamic = kind in ("restoration", "optics-proxy")
    models.to_onnx(models.from_weights(weights), tmp_path / "x.onnx", height=32, width=24, batch=2, is_dynamic=is_dynamic)
    session = _session(tmp_path / "x.onnx")
    halves = 2 if kind == "isp-proxy" else 1
    for height, width, batch in ((32, 24, 2), (20, 44, 3))[: 1 + is_dynamic]:
        inputs = _inputs(weights, height // halves, width // halves, batch)
        assert [of.name for of in session.get_inputs()] == list(inputs)
        wanted = weights.run(**inputs)
        for name, found in zip([of.name for of in session.get_outputs()], session.run(None, inputs), strict=True):
            assert np.abs(found - wanted[name]).max() < 1e-5 * max(1.0, np.abs(wanted[name]).max())


@pytest.mark.parametrize("kind", ["faster-rcnn", "fcos"])
def test_onnx_files_of_detectors_find_what_the_network_finds(kind: Kind, tmp_path: Path) -> None:
    weights = _detector(kind, "small")
    is_dynamic = kind == "faster-rcnn"
    models.to_onnx(models.from_weights(weights), tmp_path / "x.onnx", height=64, width=96, is_dynamic=is_dynamic)
    session = _session(tmp_path / "x.onnx")
    for height, width in ((64, 96), (80, 70))[: 1 + is_dynamic]:
        picture = np.random.default_rng(3).random((3, height, width), dtype=np.float32)
        names = [of.name for of in session.get_outputs()]
        _assert_same(dict(zip(names, session.run(None, {"picture": picture}), strict=True)), _found(weights, picture), 96)


def test_onnx_refuses_what_it_cannot_write(tmp_path: Path) -> None:
    module = models.from_weights(pz.Weights.drawn("segmenter", **SIZES["segmenter"]))
    for options, message in (
        ({"height": 0}, "height is 0"),
        ({"width": 1.5}, "width is 1.5"),
        ({"height": 30, "is_dynamic": True}, "multiples of 4"),
    ):
        with pytest.raises(pz.InputError, match=message):
            models.to_onnx(module, tmp_path / "x.onnx", **options)  # type: ignore[arg-type]
    with pytest.raises(pz.InputError, match="module is a ReLU"):
        models.to_onnx(torch.nn.ReLU(), tmp_path / "x.onnx")
    assert not list(tmp_path.iterdir())
