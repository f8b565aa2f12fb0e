"""Weights come out as arrays and go back to the bit; what does not fit is named."""

import pickle
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import petzval as pz
from petzval.weights import Kind

DATA = Path(__file__).parents[2] / "petzval-data" / "data" / "weights"

SETTINGS: dict[Kind, dict[str, Any]] = {
    "u-net": {"base_channels": 8, "levels": 2, "in_channels": 4, "out_channels": 3},
    "restoration": {"base_channels": 8, "levels": 1},
    "restoration-naf": {"base_channels": 8, "levels": 2},
    "segmenter": {"classes": 5, "base_channels": 8, "levels": 2},
    "isp-proxy": {"parameters": 3, "base_channels": 8, "levels": 1, "thumbnail_channels": 4, "hidden": 16},
    "optics-proxy": {"inputs": 3, "hidden": 8, "channels": 8},
    "faster-rcnn": {"backbone": "small", "classes": 2},
    "fcos": {"backbone": "small", "classes": 2},
}


def _equal(one: pz.Weights, other: pz.Weights) -> bool:
    same = zip(one.tensors.items(), other.tensors.items(), strict=True)
    return one.kind == other.kind and all(a == b and np.array_equal(v, w) for (a, v), (b, w) in same)


def test_built_in_weights_are_those_of_the_file_and_go_back_to_the_bit(tmp_path: Path) -> None:
    weights = pz.Weights.built_in("restoration_naf")
    assert weights.kind == "restoration-naf" and weights.settings == {"base_channels": 16, "levels": 3}
    assert weights.detector is None and "restoration-naf" in repr(weights)
    assert weights.tensors["correction.encoder.0.halve.weight"].shape == (32, 16, 3, 3)
    file = DATA / "restoration_naf.safetensors"
    weights.save(tmp_path / "saved.safetensors")
    assert (tmp_path / "saved.safetensors").read_bytes() == file.read_bytes()
    assert _equal(pz.Weights.load(file), weights) and _equal(pickle.loads(pickle.dumps(weights)), weights)
    assert [path.name for path in tmp_path.iterdir()] == ["saved.safetensors"]


@pytest.mark.parametrize("kind", SETTINGS)
def test_kind_and_settings_follow_from_the_weights(kind: Kind, tmp_path: Path) -> None:
    weights = pz.Weights.drawn(kind, seed=3, **SETTINGS[kind])
    assert weights.kind == kind and weights.settings == SETTINGS[kind]
    weights.save(tmp_path / "weights.safetensors")
    loaded, made = pz.Weights.load(tmp_path), pz.Weights(weights.tensors)
    assert loaded.settings == made.settings == SETTINGS[kind] and made.detector == weights.detector
    assert _equal(loaded, weights) and _equal(made, weights)
    assert _equal(pz.Weights.drawn(kind, seed=3, **SETTINGS[kind]), weights)
    assert not _equal(pz.Weights.drawn(kind, seed=4, **SETTINGS[kind]), weights)


def test_a_detector_has_the_names_of_torchvision(tmp_path: Path) -> None:
    weights = pz.Weights.drawn("faster-rcnn", backbone="resnet18", classes=3)
    shapes = {name: tensor.shape for name, tensor in weights.tensors.items()}
    assert shapes["backbone.body.layer2.0.downsample.1.running_var"] == (128,)
    assert shapes["backbone.fpn.inner_blocks.3.0.weight"] == (256, 512, 1, 1)
    assert shapes["rpn.head.bbox_pred.bias"] == (12,)
    assert shapes["roi_heads.box_predictor.cls_score.weight"] == (4, 1024)
    assert weights.detector is not None and weights.detector["boxes"]["hidden"] == 1024

    # A file has them where it is said; all files of runs have the names of Petzval.
    file = tmp_path / "theirs.safetensors"
    weights.save(file, names="torchvision")
    assert b"backbone.body.layer1.0.conv1.weight" in file.read_bytes()[:60_000]
    assert _equal(pz.Weights.load(file), weights)
    for kind in ("fcos", "faster-rcnn"):
        with pytest.raises(pz.InputError, match="torchvision has no such network"):
            pz.Weights.drawn(kind, backbone="small", classes=1).save(file, names="torchvision")
    with pytest.raises(pz.InputError, match="names 'torch'"):
        weights.save(file, names="torch")  # type: ignore[arg-type]


def _write_png(file: Path, picture: np.ndarray) -> None:
    """An 8-bit PNG of ``[y, x, 3]``."""
    height, width, _ = picture.shape
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    chunks = ((b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    parts = (struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks)
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def test_a_detector_with_changed_weights_is_what_the_command_looks_with(tmp_path: Path) -> None:
    weights = pz.Weights.drawn("faster-rcnn", backbone="mobilenet-v2", classes=2)
    last = "roi_heads.box_predictor.cls_score.bias"
    # Smaller maps, so that the scores do not follow the rounding of a decoded picture.
    maps = {name: 0.2 * tensor for name, tensor in weights.tensors.items() if name.startswith("backbone.fpn.layer_blocks") and tensor.ndim == 4}
    weights = weights.with_({last: [0.0, 0.5, -0.5], **maps})
    weights.save(tmp_path / "weights.safetensors", names="torchvision")
    picture = np.random.default_rng(1).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    _write_png(tmp_path / "picture.png", picture)
    source = {"file": tmp_path / "weights.safetensors", "backbone": "mobilenet-v2", "classes": 2, "shorter_side": 48, "longer_side": 64}
    request = {"images": [tmp_path / "picture.png"], "detector": {"weights": source}, "least_score": 0.05}
    (of_picture,) = pz.jobs.run("detect", request)["pictures"]
    found = weights.run(pictures=picture.transpose(2, 0, 1)[None] / 255)
    assert len(found["scores"]) > 3
    np.testing.assert_allclose([of["score"] for of in of_picture["found"]], found["scores"], atol=1e-5)
    np.testing.assert_allclose([of["bbox"][:2] for of in of_picture["found"]], found["boxes"][:, :2], atol=1e-3)


def test_a_camera_of_a_run_is_found_by_name(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        folder = tmp_path / "cameras" / name
        folder.mkdir(parents=True)
        pz.Weights.drawn("segmenter", seed=seed, **SETTINGS["segmenter"]).save(folder / "network.safetensors")
    second = pz.Weights.load(tmp_path, camera="b")
    assert _equal(second, pz.Weights.load(tmp_path / "cameras" / "b"))
    assert _equal(second, pz.Weights.drawn("segmenter", seed=2, **SETTINGS["segmenter"]))
    for camera in (None, "c"):
        with pytest.raises(pz.InputError, match="cameras with a network are: a, b"):
            pz.Weights.load(tmp_path, camera=camera)
    with pytest.raises(pz.InputError, match="camera is 'b'"):
        pz.Weights.load(tmp_path / "cameras" / "b", camera="b")


def test_weights_that_fit_two_networks_are_taken_for_the_kind_that_is_given() -> None:
    weights = pz.Weights.drawn("segmenter", classes=3, base_channels=8, levels=1)
    assert pz.Weights(weights.tensors).kind == "u-net"
    segmenter = pz.Weights(weights.tensors, kind="segmenter")
    assert _equal(segmenter, weights)
    assert segmenter.with_({"last_bias": [1.0, 2.0, 3.0]}).kind == "segmenter"


def test_weights_that_do_not_fit_are_named() -> None:
    weights = pz.Weights.drawn("restoration-naf", base_channels=8, levels=1)
    name = "correction.bottom.0.join.weight"
    tensors = dict(weights.tensors)
    missing = {key: tensor for key, tensor in tensors.items() if key != name}
    wrong: list[tuple[dict[str, Any], str]] = [
        (missing, f"{name} is missing"),
        ({**tensors, name: tensors[name][:3]}, rf"{name} has shape \[3, 16\], and this network needs \[16, 16\]"),
        ({**tensors, name: np.full((16, 16), np.nan)}, f"{name} is not finite"),
        ({**tensors, name: np.full((16, 16), 1e300)}, f"{name} is not finite"),
        ({**tensors, "more": np.zeros(3)}, "more is no weight of a network of the kind restoration-naf"),
        ({**tensors, name: ["a"]}, f"tensors..{name}.. of type <U1: holds no real numbers"),
        ({**tensors, name: np.zeros((16, 16), complex)}, f"tensors..{name}.. of type complex128"),
        ({"x": np.zeros(3)}, "no network has weights such as x"),
        ({}, "no network has weights"),
        ({**tensors, "correction.encoder.1.halve.weight": np.zeros((1 << 12, 1 << 11, 1, 1))}, "correction.encoder.1.halve.weight has 4096"),
    ]
    for given, message in wrong:
        with pytest.raises(pz.InputError, match=message):
            pz.Weights(given)
    with pytest.raises(pz.InputError, match="`naf` is no kind of network; there are u-net, restoration"):
        pz.Weights(tensors, kind="naf")  # type: ignore[arg-type]
    with pytest.raises(pz.InputError, match="trunk.encoder.0.first.weight is missing"):
        pz.Weights(tensors, kind="segmenter")
    with pytest.raises(pz.InputError, match="tensors 'bias': there is no such weight"):
        weights.with_({"bias": 0.0})
    detector = pz.Weights.drawn("faster-rcnn", backbone="small", classes=1)
    with pytest.raises(pz.InputError, match=r"backbone.body.stem.bias has shape \[2\], and this network needs \[24\]"):
        detector.with_({"backbone.body.stem.bias": np.zeros(2)})
    with pytest.raises(ValueError, match="read-only"):
        detector.tensors["backbone.body.stem.bias"][0] = 1.0


def test_what_cannot_be_read_or_made_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "damaged.safetensors").write_bytes((DATA / "restoration_naf.safetensors").read_bytes()[:5000])
    lpips = DATA / "lpips_alex_f16.safetensors"
    for path, message in (
        (tmp_path / "none.safetensors", "none.safetensors: No such file"),
        (tmp_path, "directory"),
        (tmp_path / "damaged.safetensors", "not a safetensors file"),
        (lpips, "no network has weights such as features.0.bias"),
        (5, "path 5: is of the type int"),
    ):
        with pytest.raises(pz.InputError, match=message):
            pz.Weights.load(path)  # type: ignore[arg-type]
    with pytest.raises(pz.InputError, match="no-such"):
        pz.Weights.built_in("no-such")
    with pytest.raises(pz.InputError, match="none"):
        pz.Weights.built_in("restoration_naf").save(tmp_path / "none" / "x.safetensors")
    wrong: list[tuple[str, dict[str, Any]]] = [
        ("base_channels is 0", {"kind": "segmenter", "classes": 2, "base_channels": 0, "levels": 1}),
        ("missing field `levels`", {"kind": "segmenter", "classes": 2, "base_channels": 8}),
        ("unknown field `depth`", {"kind": "segmenter", "classes": 2, "base_channels": 8, "levels": 1, "depth": 1}),
        ("unknown variant `naf`", {"kind": "naf"}),
        ("unknown variant `vgg`", {"kind": "fcos", "backbone": "vgg", "classes": 1}),
        ("classes is 0", {"kind": "fcos", "backbone": "small", "classes": 0}),
        ("classes is 100000", {"kind": "faster-rcnn", "backbone": "small", "classes": 100_000}),
        ("seed -1: is no seed", {"kind": "fcos", "seed": -1}),
        ("settings", {"kind": "fcos", "backbone": object()}),
    ]
    for message, settings in wrong:
        with pytest.raises(pz.InputError, match=message):
            pz.Weights.drawn(**settings)


def test_a_network_runs_on_arrays() -> None:
    random = np.random.default_rng(1)
    weights = pz.Weights.drawn("u-net", base_channels=8, levels=2, in_channels=3, out_channels=3)
    pictures = random.random((2, 3, 21, 18))
    # Untrained, it changes nothing.
    np.testing.assert_allclose(weights.run(pictures=pictures)["finished"], pictures, atol=1e-6)
    shifted = weights.with_({"last_bias": [0.1, 0.2, 0.3]}).run(pictures=pictures)["finished"]
    np.testing.assert_allclose(shifted - pictures, np.broadcast_to([[[0.1]], [[0.2]], [[0.3]]], shifted.shape[1:])[None].repeat(2, 0), atol=1e-6)
    good = {"restored": np.zeros((1, 3, 8, 8)), "developed": np.zeros((1, 3, 8, 8)), "field": np.zeros((1, 1, 8, 8)), "noise": np.zeros((1, 1, 8, 8))}
    restoration = pz.Weights.built_in("restoration_naf")
    outputs = restoration.run(**good)
    assert outputs["finished"].shape == (1, 3, 8, 8) and outputs["curves"].shape == (3, 6)
    np.testing.assert_allclose(outputs["curves"], 4 * restoration.tensors["curves"])
    wrong: list[tuple[dict[str, Any], str]] = [
        ({**good, "field": np.zeros((1, 1, 8, 9))}, r"input `field` has shape \[1, 1, 8, 9\]; give \[1, 1, 8, 8\]"),
        ({**good, "noise": np.full((1, 1, 8, 8), np.inf)}, "input `noise` has a value of inf; give finite numbers"),
        ({**good, "restored": np.zeros((2, 3, 8, 8))}, r"input `restored` has shape \[2, 3, 8, 8\]; give \[1, 3, 8, 8\]"),
        ({**good, "developed": np.zeros((8, 8))}, r"input `developed` has shape \[8, 8\]; give \[any, 3, any, any\]"),
        ({**good, "developed": np.zeros((0, 3, 8, 8))}, "input `developed` has shape"),
        ({**good, "more": np.zeros(1)}, "input `more` is none of this network"),
        ({"developed": good["developed"]}, "input `restored` is missing"),
        ({**good, "noise": "x"}, "inputs..noise.. of type <U1: holds no real numbers"),
    ]
    for inputs, message in wrong:
        with pytest.raises(pz.InputError, match=message):
            restoration.run(**inputs)


def test_a_file_says_what_its_weights_do_not(tmp_path: Path) -> None:
    segmenter = pz.Weights.drawn("segmenter", classes=3, base_channels=8, levels=1)
    segmenter.save(tmp_path / "weights.safetensors")
    assert _equal(pz.Weights.load(tmp_path), segmenter) and _equal(pickle.loads(pickle.dumps(segmenter)), segmenter)
    assert pz.Weights(segmenter.tensors).kind == "u-net"
    assert _equal(pz.Weights(segmenter.tensors, kind="segmenter"), segmenter)


def test_a_checkpoint_of_a_run_names_the_file_to_load(run_folder: Path) -> None:
    camera = pz.Run(run_folder).cameras[0]
    network = run_folder / "cameras" / camera / "blocks" / "network"
    for path in (network, network / "weights.bin"):
        with pytest.raises(pz.InputError, match=r"petzval.Weights.load\(RUN, camera=NAME\)"):
            pz.Weights.load(path)
    assert pz.Weights.load(run_folder, camera=camera).kind == "restoration-naf"
    assert pz.Run(run_folder).weights[camera] == run_folder / "cameras" / camera / "network.safetensors"


def test_the_description_of_a_proxy_takes_weights_from_python(tmp_path: Path, triplet: pz.Lens) -> None:
    camera = pz.Camera(triplet, "imx249-fitted", size=(32, 32), place="centre")
    raw = camera.take(np.full((32, 32, 3), 0.4), seed=1).save(tmp_path / "shot")["raw"]
    values = [f'"{name}" = {parameter.value!r}' for name, parameter in pz.Isp.load("quality").parameters.items()]
    about = ['about = "drawn"', 'proxy_of = "quality"', 'weights = "weights.safetensors"', "base_channels = 8", "levels = 1"]
    file = tmp_path / "proxy.toml"
    file.write_text("\n".join([*about, 'varied = ["tone_map.dark"]', "[values]", *values]), encoding="utf-8")
    # One number for the parameter, and two for the noise of the frame. Drawn weights leave out the last layer.
    drawn = pz.Weights.drawn("isp-proxy", parameters=3, base_channels=8, levels=1)
    pictures = []
    for bias in (0.0, 0.1):
        drawn.with_({"last_bias": np.full_like(drawn.tensors["last_bias"], bias)}).save(tmp_path / "weights.safetensors")
        done = pz.jobs.run("isp-develop", {"raws": [raw], "isp": file, "out": tmp_path / f"{bias}"})
        pictures.append(pz.read_picture(done["pictures"][0]["picture"]))
    assert pictures[0].shape == (32, 32, 3) and not np.array_equal(*pictures)
    assert pz.Weights.load(tmp_path).kind == "isp-proxy"

    # It has no floating-point form of the automotive ISP, and its weights belong to its sizes.
    with pytest.raises(pz.InputError, match=r'petzval.jobs.run\("isp-develop"'):
        pz.Isp.load(file)
    pz.Weights.drawn("isp-proxy", parameters=3, base_channels=16, levels=1).save(tmp_path / "weights.safetensors")
    with pytest.raises(pz.InputError, match="belong together"):
        pz.jobs.run("isp-develop", {"raws": [raw], "isp": file, "out": tmp_path / "none"})


def test_the_state_of_a_class_of_ones_own_is_named(tmp_path: Path) -> None:
    camera = tmp_path / "run/cameras/nominal"
    state = camera / "blocks/network/weights.bin"
    state.parent.mkdir(parents=True)
    state.write_bytes(b"what save gave")
    (tmp_path / "run/config.toml").write_text('[network]\nkind = "python"\n')
    for path, camera_name in ((tmp_path / "run", None), (tmp_path / "run", "nominal"), (camera, None), (state, None)):
        with pytest.raises(pz.InputError, match="its network is a class in Python") as caught:
            pz.Weights.load(path, camera=camera_name)
        assert str(state) in caught.value.hint and "`save`" in caught.value.hint
