"""Detectors: torchvision's Faster R-CNN with Petzval's settings, and Petzval's detector of one stage. Needs torchvision."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..._errors import InputError, Place
from ...weights import Kind, Weights
from ._base import Mix, PetzvalModule, depthwise, gated, load, normal, normalized, zeros

# Mean and standard deviation of the pictures on which torchvision's backbones were trained (R, G, B).
_MEAN, _DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

# Sides of the pictures that backbones see are multiples of this.
_SIDE_UNIT = 32

# Slope of the rectifiers of the small backbone and of the towers, and largest logarithm of a distance in strides.
_SLOPE, _LARGEST_LOG = 0.1, 5.0

# Smallest side of a box of the detector of one stage, pixels.
_LEAST_SIDE = 1.0

# The small backbone: channels and blocks of its stages, channels behind its first convolution, side of the kernels that look around.
_WIDTHS, _BLOCKS, _STEM, _KERNEL = (32, 64, 96, 128), (1, 2, 2, 2), 24, 5


class Around(nn.Module):
    """A kernel for each channel."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = normal(channels, _KERNEL, _KERNEL, deviation=1 / _KERNEL)
        self.bias = zeros(channels)

    def forward(self, x: Tensor) -> Tensor:
        return depthwise(x, self.weight, self.bias)


class SmallBlock(nn.Module):
    """``x + mix(gate(spread(normalised(around(x)))))``."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.around = Around(channels)
        self.spread = Mix(channels, 4 * channels)
        self.mix = Mix(2 * channels, channels)
        # A block starts as the identity.
        nn.init.zeros_(self.mix.weight)

    def forward(self, x: Tensor) -> Tensor:
        return x + self.mix(gated(self.spread(normalized(self.around(x)))))


class SmallStage(nn.Module):
    """A convolution that halves the picture, then blocks. What a detector sees of it is normalised over the channels of each pixel."""

    def __init__(self, inputs: int, channels: int, blocks: int) -> None:
        super().__init__()
        self.down = _halving(inputs, channels)
        self.blocks = nn.Sequential(*(SmallBlock(channels) for _ in range(blocks)))
        self.shown = Mix(channels, channels)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """What goes on to the next stage, and what a detector sees."""
        x = self.blocks(F.leaky_relu(self.down(x), _SLOPE))
        return x, self.shown(normalized(x))


class SmallBackbone(nn.Module):
    """Petzval's backbone that trains on two processor cores: features 4, 8, 16 and 32 times smaller than the pictures."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = _halving(3, _STEM)
        inputs = (_STEM, *_WIDTHS)
        self.stages = nn.ModuleList(SmallStage(*sizes) for sizes in zip(inputs[:-1], _WIDTHS, _BLOCKS, strict=True))

    def forward(self, pictures: Tensor) -> OrderedDict[str, Tensor]:
        x = F.leaky_relu(self.stem(pictures), _SLOPE)
        features: OrderedDict[str, Tensor] = OrderedDict()
        for number, stage in enumerate(self.stages):
            x, features[str(number)] = stage(x)
        return features


class SmallPyramid(nn.Module):
    """The small backbone with torchvision's feature pyramid."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        from torchvision.ops.feature_pyramid_network import FeaturePyramidNetwork, LastLevelMaxPool

        self.body = SmallBackbone()
        self.fpn = FeaturePyramidNetwork(list(_WIDTHS), channels, extra_blocks=LastLevelMaxPool())
        self.out_channels = channels

    def forward(self, pictures: Tensor) -> OrderedDict[str, Tensor]:
        return self.fpn(self.body(pictures))


def _halving(inputs: int, outputs: int) -> nn.Conv2d:
    """A 3x3 convolution that keeps the even rows and columns."""
    conv = nn.Conv2d(inputs, outputs, 3, stride=2, padding=1)
    return _started(conv, math.sqrt(2 / (9 * inputs)))


def _started(conv: nn.Conv2d, deviation: float, bias: float = 0.0) -> nn.Conv2d:
    """A convolution with normal weights of this standard deviation."""
    nn.init.normal_(conv.weight, std=deviation)
    if conv.bias is not None:
        nn.init.constant_(conv.bias, bias)
    return conv


def _pyramid(backbone: str, channels: int) -> nn.Module:
    """A backbone with its feature pyramid: those of torchvision have its own modules, with frozen batch normalisation."""
    from torchvision.models import mobilenet_v2
    from torchvision.models.detection.backbone_utils import BackboneWithFPN, resnet_fpn_backbone
    from torchvision.ops.misc import FrozenBatchNorm2d

    if backbone == "small":
        return SmallPyramid(channels)
    if backbone == "mobilenet-v2":
        layers = {"3": "0", "6": "1", "13": "2", "18": "3"}
        features = mobilenet_v2(weights=None, norm_layer=FrozenBatchNorm2d).features
        return BackboneWithFPN(features, layers, [24, 32, 96, 1280], channels)
    return resnet_fpn_backbone(backbone_name=backbone, weights=None, trainable_layers=5, norm_layer=FrozenBatchNorm2d)


def faster_rcnn(weights: Weights) -> nn.Module:
    """Torchvision's `FasterRCNN` with the weights and the settings of a detector of two stages, on the CPU, in evaluation mode.

    It takes a list of pictures ``[3, y, x]``, sRGB-encoded, 0 to 1, and does not change their size. Its labels are Petzval's classes plus 1:
    0 is the background. On ``"resnet50"`` it is ``fasterrcnn_resnet50_fpn`` but for that. The small backbone has anchors, numbers of proposals and a
    pooling of its own.

    In training it lacks two things that Petzval has: regions that are ignored, and the weight of the loss of proposed boxes on the small backbone.

    Raises:
        InputError: The weights are those of another kind of network.
        ImportError: torchvision is not installed.
    """
    from torchvision.models.detection.faster_rcnn import FasterRCNN, FastRCNNPredictor, TwoMLPHead
    from torchvision.models.detection.rpn import AnchorGenerator
    from torchvision.ops import MultiScaleRoIAlign

    settings = weights.detector
    if weights.kind != "faster-rcnn" or settings is None:
        place = Place(key="weights", value=weights.kind)
        raise InputError(f"weights are those of a network {weights.kind!r}; faster_rcnn takes 'faster-rcnn'", place=place)
    first, second, channels = settings["proposals"], settings["boxes"], settings["channels"]
    align, level, (sides, _) = second["roi_align"], second["level"], second["roi_align"]["size"]
    if align["is_aligned"]:
        pool = _aligned_pool(sides, align["samples"], level)
    else:
        names = [str(number) for number in range(level["coarsest"] - level["finest"] + 1)]
        size, of = level["canonical_size"], level["canonical_level"]
        pool = MultiScaleRoIAlign(names, sides, align["samples"], canonical_scale=size, canonical_level=of)
    sizes, ratios = first["anchors"]["sizes"], first["anchors"]["aspect_ratios"]
    model: nn.Module = FasterRCNN(
        _pyramid(settings["backbone"], channels),
        rpn_anchor_generator=AnchorGenerator(tuple(map(tuple, sizes)), (tuple(ratios),) * len(sizes)),
        rpn_pre_nms_top_n_train=first["before_suppression"][0],
        rpn_pre_nms_top_n_test=first["before_suppression"][1],
        rpn_post_nms_top_n_train=first["after_suppression"][0],
        rpn_post_nms_top_n_test=first["after_suppression"][1],
        rpn_nms_thresh=first["most_overlap"],
        rpn_fg_iou_thresh=first["matcher"]["high"],
        rpn_bg_iou_thresh=first["matcher"]["low"],
        rpn_batch_size_per_image=first["sampled"],
        box_roi_pool=pool,
        box_head=TwoMLPHead(channels * sides * sides, second["hidden"]),
        box_predictor=FastRCNNPredictor(second["hidden"], second["classes"] + 1),
        box_score_thresh=second["least_score"],
        box_nms_thresh=second["most_overlap"],
        box_detections_per_img=second["most_detections"],
        box_batch_size_per_image=second["sampled"],
        box_positive_fraction=second["positive"],
    )
    model.transform = _same_size()
    load(model, weights)
    return model


def is_faster_rcnn(module: nn.Module) -> bool:
    """Whether a module is torchvision's `FasterRCNN`."""
    try:
        from torchvision.models.detection import FasterRCNN
    except ImportError:
        return False
    return isinstance(module, FasterRCNN)


def _same_size() -> nn.Module:
    """Torchvision's transform of pictures without its scaling."""
    from torchvision.models.detection.transform import GeneralizedRCNNTransform

    class SameSize(GeneralizedRCNNTransform):  # type: ignore[misc]
        def resize(self, image: Tensor, target: Any = None) -> tuple[Tensor, Any]:
            return image, target

    return SameSize(0, 0, list(_MEAN), list(_DEVIATION), size_divisible=_SIDE_UNIT)


def _aligned_pool(sides: int, samples: int, level: dict[str, Any]) -> nn.Module:
    """Torchvision's pooling of regions on a pyramid, with the centre of the first pixel at half a pixel."""
    from torchvision.ops import MultiScaleRoIAlign, roi_align
    from torchvision.ops.poolers import LevelMapper

    finest, coarsest = level["finest"], level["coarsest"]
    names = [str(number) for number in range(coarsest - finest + 1)]
    level_of = LevelMapper(finest, coarsest, level["canonical_size"], level["canonical_level"])

    class AlignedPool(MultiScaleRoIAlign):  # type: ignore[misc]
        def forward(self, x: dict[str, Tensor], boxes: list[Tensor], image_shapes: list[tuple[int, int]]) -> Tensor:
            number = level_of(boxes)[:, None, None, None]
            regions = torch.cat([torch.cat([torch.full_like(of[:, :1], i), of], 1) for i, of in enumerate(boxes)])
            pooled = None
            for i, name in enumerate(names):
                # Every region on every level: which level it belongs to is data.
                found = roi_align(x[name], regions, (sides, sides), 0.5 ** (finest + i), samples, aligned=True)
                pooled = found if pooled is None else torch.where(number == i, found, pooled)
            assert pooled is not None
            return pooled

    return AlignedPool(names, sides, samples, canonical_scale=level["canonical_size"], canonical_level=level["canonical_level"])


class Head(nn.Module):
    """Two towers of convolutions over every level, and what they say at every place."""

    def __init__(self, channels: int, depth: int, classes: int) -> None:
        super().__init__()

        def tower() -> nn.ModuleList:
            convs = (nn.Conv2d(channels, channels, 3, padding=1) for _ in range(depth))
            return nn.ModuleList(_started(conv, math.sqrt(2 / (9 * channels))) for conv in convs)

        def last(outputs: int, bias: float) -> nn.Conv2d:
            return _started(nn.Conv2d(channels, outputs, 3, padding=1), 0.01, bias)

        self.class_tower = tower()
        self.box_tower = tower()
        self.logits = last(classes, math.log(0.01 / 0.99))
        self.distances = last(4, 1.0)
        self.centredness = last(1, 0.0)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Logits, logarithms of distances and logits of centredness, ``[batch, value, y, x]``."""
        classes = boxes = x
        for conv in self.class_tower:
            classes = F.leaky_relu(conv(classes), _SLOPE)
        for conv in self.box_tower:
            boxes = F.leaky_relu(conv(boxes), _SLOPE)
        return self.logits(classes), self.distances(boxes), self.centredness(boxes)


class Fcos(PetzvalModule):
    """Petzval's detector of one stage: every place of the pyramid says which object its centre lies in, and how far the sides of its box are.

    Source: Z. Tian et al., "FCOS", ICCV 2019.

    Args:
        backbone: ``"small"``, ``"resnet18"``, ``"resnet50"`` or ``"mobilenet-v2"``.
        channels: Channels of the pyramid and of the towers.
        depth: Convolutions of each tower.
        classes: Number of classes.
        least_score: Least score of a detection.
        most_overlap: Overlap above which the better of two detections of a class suppresses the other.
        most_detections: Most detections of a picture.
    """

    kind: ClassVar[Kind] = "fcos"

    def __init__(
        self,
        backbone: str,
        channels: int,
        depth: int,
        classes: int,
        *,
        least_score: float,
        most_overlap: float,
        most_detections: int,
    ) -> None:
        super().__init__()
        self.backbone = _pyramid(backbone, channels)
        self.head = Head(channels, depth, classes)
        self.least_score, self.most_overlap, self.most_detections = least_score, most_overlap, most_detections
        self.register_buffer("mean", torch.tensor(_MEAN)[:, None, None], persistent=False)
        self.register_buffer("deviation", torch.tensor(_DEVIATION)[:, None, None], persistent=False)
        self.mean: Tensor
        self.deviation: Tensor

    @classmethod
    def from_weights(cls, weights: Weights) -> Self:
        """See `PetzvalModule.from_weights`."""
        if weights.kind != cls.kind or weights.detector is None:
            return super().from_weights(weights)
        settings = {name: value for name, value in weights.detector.items() if name not in ("radius", "reach")}
        module = cls(**settings)
        load(module, weights)
        return module

    def heads(self, pictures: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """What the last layers say at every place of the pyramid; for a loss of one's own.

        Args:
            pictures: ``[batch, 3, y, x]``, sRGB-encoded, 0 to 1.

        Returns:
            Logits ``[batch, place, class]``; logarithms of the distances to the left, upper, right and lower side in strides,
            ``[batch, place, 4]``; logits of centredness ``[batch, place]``; and the places, x, y and stride in pixels, ``[place, 3]``.
        """
        height, width = pictures.shape[2:]
        x = (pictures - self.mean) / self.deviation
        x = F.pad(x, (0, -width % _SIDE_UNIT, 0, -height % _SIDE_UNIT))
        logits: list[Tensor] = []
        distances: list[Tensor] = []
        centredness: list[Tensor] = []
        places: list[Tensor] = []
        for level in self.backbone(x).values():
            rows, columns = level.shape[2:]
            stride = 2.0 ** round(math.log2(max(x.shape[2] / rows, x.shape[3] / columns)))
            said = (of.flatten(2).transpose(1, 2) for of in self.head(level))
            for all_levels, of in zip((logits, distances, centredness), said, strict=True):
                all_levels.append(of)
            y, x_ = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
            centre = torch.stack([x_.flatten(), y.flatten()], 1).to(pictures) * stride + 0.5 * stride
            places.append(torch.cat([centre, torch.full_like(centre[:, :1], stride)], 1))
        return (
            torch.cat(logits, 1),
            torch.cat(distances, 1).clamp(max=_LARGEST_LOG),
            torch.cat(centredness, 1)[..., 0],
            torch.cat(places),
        )

    def forward(self, pictures: Tensor | Sequence[Tensor]) -> list[dict[str, Tensor]]:
        """What is found in each picture, best first.

        Args:
            pictures: ``[batch, 3, y, x]``, or a list of ``[3, y, x]``, sRGB-encoded, 0 to 1.

        Returns:
            For each picture ``boxes`` ``[found, 4]`` (x1, y1, x2, y2 in pixels), ``labels`` ``[found]`` (Petzval's classes, from 0: there is no
            background) and ``scores`` ``[found]``.
        """
        from torchvision.ops import batched_nms

        found = []
        for picture in pictures:
            height, width = picture.shape[1:]
            (logits,), (distances,), (centredness,), places = self.heads(picture[None])

            # Boxes around the places, cut at the border of the picture.
            centre, stride = places[:, :2], places[:, 2:]
            sides = distances.exp() * stride
            low, high = centre - sides[:, :2], centre + sides[:, 2:]
            x1, x2 = (of[:, 0].clamp(0.0, width) for of in (low, high))
            y1, y2 = (of[:, 1].clamp(0.0, height) for of in (low, high))
            boxes = torch.stack([x1, y1, x2, y2], 1)

            # Every class of every place that is sure enough.
            scores = (logits.sigmoid() * centredness.sigmoid()[:, None]).sqrt()
            is_large = (x2 - x1 >= _LEAST_SIDE) & (y2 - y1 >= _LEAST_SIDE)
            place, label = torch.nonzero((scores > self.least_score) & is_large[:, None], as_tuple=True)
            boxes, scores = boxes[place], scores[place, label]
            kept = batched_nms(boxes, scores, label, self.most_overlap)[: self.most_detections]
            found.append({"boxes": boxes[kept], "labels": label[kept], "scores": scores[kept]})
        return found
