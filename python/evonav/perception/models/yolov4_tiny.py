"""YOLOv4-tiny (Bochkovskiy, Wang and Liao, 2020; Darknet's licence, public domain): boxes of COCO's 80 classes.

The published weights are a file of Darknet, which OpenCV 5 no longer reads. The network is 21 convolutions, so numpy
runs it: no torch, no OpenCV, no ONNX.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.errors import PerceptionError
from evonav.perception.models.prompted import Boxes
from evonav.tasks.language import phrases_of

Array = NDArray[np.float32]

STRIDE = 32
"""Sides of the network's image are multiples of it."""
_HEADER_BYTES = 20
"""Darknet's: three numbers of its version, and how many images the network has seen."""
# Of each convolution: channels in, channels out, size of the kernel, stride; the heads' last ones have no batch norm.
_CONVOLUTIONS = (
    (3, 32, 3, 2),
    (32, 64, 3, 2),
    *((64, 64, 3, 1), (32, 32, 3, 1), (32, 32, 3, 1), (64, 64, 1, 1)),
    *((128, 128, 3, 1), (64, 64, 3, 1), (64, 64, 3, 1), (128, 128, 1, 1)),
    *((256, 256, 3, 1), (128, 128, 3, 1), (128, 128, 3, 1), (256, 256, 1, 1)),
    (512, 512, 3, 1),
    *((512, 256, 1, 1), (256, 512, 3, 1), (512, 255, 1, 1)),
    *((256, 128, 1, 1), (384, 256, 3, 1), (256, 255, 1, 1)),
)
_PLAIN = (17, 20)
"""Convolutions without batch normalisation and activation: what the heads say."""
_ANCHORS_PX = (((81.0, 82.0), (135.0, 169.0), (344.0, 319.0)), ((23.0, 27.0), (37.0, 58.0), (81.0, 82.0)))
"""Width and height of the coarse head's and the fine head's boxes, in pixels of the network's image."""
_XY_SCALE = 1.05
_LEAK = np.float32(0.1)
_EPSILON = 1e-6
_MAX_IOU = 0.45
"""Overlap above which the less confident one of two boxes of a class is dropped: Darknet's."""
COCO_CLASSES = phrases_of(
    """
    person; bicycle; car; motorcycle; airplane; bus; train; truck; boat; traffic light; fire hydrant; stop sign;
    parking meter; bench; bird; cat; dog; horse; sheep; cow; elephant; bear; zebra; giraffe; backpack; umbrella;
    handbag; tie; suitcase; frisbee; skis; snowboard; sports ball; kite; baseball bat; baseball glove; skateboard;
    surfboard; tennis racket; bottle; wine glass; cup; fork; knife; spoon; bowl; banana; apple; sandwich; orange;
    broccoli; carrot; hot dog; pizza; donut; cake; chair; couch; potted plant; bed; dining table; toilet; tv; laptop;
    mouse; remote; keyboard; cell phone; microwave; oven; toaster; sink; refrigerator; book; clock; vase; scissors;
    teddy bear; hair drier; toothbrush
    """
)
"""COCO's 80 classes, in its order."""


@dataclass(frozen=True, slots=True)
class _Convolution:
    """Weights with their batch normalisation multiplied in."""

    weights: Array
    """`(out, in * size * size)`."""
    bias: Array
    size: int
    stride: int
    is_leaky: bool

    def __call__(self, image: Array) -> Array:
        """Return `(out, H / stride, W / stride)` of `(in, H, W)`, padded with zeros."""
        height, width = image.shape[1] // self.stride, image.shape[2] // self.stride
        columns = image.reshape(len(image), -1) if self.size == 1 else _columns(image, self.stride)
        result = self.weights @ columns
        result += self.bias[:, None]
        if self.is_leaky:
            np.maximum(result, result * _LEAK, out=result)
        return result.reshape(-1, height, width)


class YoloV4Tiny:
    """The network with its weights. It keeps nothing between calls."""

    def __init__(self, darknet: bytes) -> None:
        """Read the weights.

        Args:
            darknet: The file `yolov4-tiny.weights`.

        Raises:
            ValueError: It is too short or too long.
        """
        values = np.frombuffer(darknet[_HEADER_BYTES:], np.float32)
        self._convolutions = tuple(_read(values))

    def detect(self, rgb: NDArray[np.uint8], *, side_px: int = 608, min_confidence: float = 0.1) -> Boxes:
        """Detect objects.

        Args:
            rgb: Image `(H, W, 3)`; it is stretched to a square.
            side_px: Side of the square that the network sees, a multiple of 32.
            min_confidence: Least confidence of a detection.
        """
        square = Image.fromarray(rgb).resize((side_px, side_px), Image.Resampling.BILINEAR)
        image = np.ascontiguousarray(np.asarray(square, np.float32).transpose(2, 0, 1)) / np.float32(255.0)
        found = [
            _decoded(output, anchors, side_px, min_confidence)
            for output, anchors in zip(self._outputs(image), _ANCHORS_PX, strict=True)
        ]
        boxes, classes, confidences = (np.concatenate(parts) for parts in zip(*found, strict=True))
        remaining = _without_doubles(boxes, classes, confidences)
        size_px = np.array([rgb.shape[1], rgb.shape[0]] * 2, np.float32)
        inside = np.clip(boxes[remaining], 0.0, 1.0) * size_px
        names = tuple(COCO_CLASSES[number] for number in classes[remaining].tolist())
        return Boxes(inside.astype(np.float32), names, confidences[remaining])

    def _outputs(self, image: Array) -> tuple[Array, Array]:
        """Return what the two heads say: `(255, H, W)` at a 32nd and at a 16th of the image's size."""
        stem, blocks, (*neck, coarse), (narrow, *fine) = (
            self._convolutions[start:end] for start, end in ((0, 2), (2, 14), (14, 18), (18, 21))
        )
        image = _through(stem, image)
        deepest = image
        for first in range(0, len(blocks), 4):  # cross stage partial blocks: half of the channels take the long way
            whole = blocks[first](image)
            inner = blocks[first + 1](whole[len(whole) // 2 :])
            deepest = blocks[first + 3](np.concatenate([blocks[first + 2](inner), inner]))
            image = _halved(np.concatenate([whole, deepest]))
        image = _through(neck[:2], image)
        coarse_head = coarse(_through(neck[2:], image))
        enlarged = narrow(image).repeat(2, axis=1).repeat(2, axis=2)
        fine_head = _through(fine, np.concatenate([enlarged, deepest]))
        return coarse_head, fine_head


def _through(convolutions: Sequence[_Convolution], image: Array) -> Array:
    """Return an image after one convolution after another."""
    for convolution in convolutions:
        image = convolution(image)
    return image


def _read(values: Array) -> Iterator[_Convolution]:
    """Yield the convolutions of a file's numbers, in its order: bias, normalisation, kernel."""
    num_plain = sum(out for index, (_, out, _, _) in enumerate(_CONVOLUTIONS) if index in _PLAIN)
    num_normed = sum(out for index, (_, out, _, _) in enumerate(_CONVOLUTIONS) if index not in _PLAIN)
    expected = num_plain + 4 * num_normed + sum(into * out * size**2 for into, out, size, _ in _CONVOLUTIONS)
    if len(values) != expected:
        raise ValueError(f"{len(values)} numbers, expected {expected}")
    start = 0
    for index, (into, out, size, stride) in enumerate(_CONVOLUTIONS):
        is_normed = index not in _PLAIN
        num_rows = 4 if is_normed else 1
        rows = values[start : start + num_rows * out].reshape(num_rows, out).astype(np.float64)
        start += num_rows * out
        kernel = values[start : start + out * into * size**2].reshape(out, -1).astype(np.float64)
        start += kernel.size
        bias = rows[0]
        if is_normed:
            _, scale, mean, variance = rows
            factor = scale / np.sqrt(variance + _EPSILON)
            kernel, bias = kernel * factor[:, None], bias - mean * factor
        yield _Convolution(kernel.astype(np.float32), bias.astype(np.float32), size, stride, is_normed)


def _columns(image: Array, stride: int) -> Array:
    """Return the 3x3 neighbourhoods of the pixels of `(C, H, W)` as columns `(C * 9, H * W / stride^2)`."""
    num, height, width = image.shape
    padded = np.zeros((num, height + 2, width + 2), np.float32)
    padded[:, 1:-1, 1:-1] = image
    columns = np.empty((num, 3, 3, height // stride, width // stride), np.float32)
    for row in range(3):
        for col in range(3):
            columns[:, row, col] = padded[:, row : row + height : stride, col : col + width : stride]
    return columns.reshape(num * 9, -1)


def _halved(image: Array) -> Array:
    """Return the greatest of each 2x2 pixels."""
    num, height, width = image.shape
    halved: Array = image.reshape(num, height // 2, 2, width // 2, 2).max(axis=(2, 4))
    return halved


def _decoded(
    output: Array, anchors_px: tuple[tuple[float, float], ...], side_px: int, min_confidence: float
) -> tuple[Array, NDArray[np.int64], Array]:
    """Return boxes (in parts of the image), classes and confidences of what a head says."""
    _, height, width = output.shape
    cells = output.reshape(len(anchors_px), -1, height, width)
    is_object = _sigmoid(cells[:, 4])
    anchor, row, col = np.nonzero(is_object >= min_confidence)
    outputs = cells[anchor, :, row, col]
    scores = is_object[anchor, row, col][:, None] * _sigmoid(outputs[:, 5:])
    centre = _sigmoid(outputs[:, :2]) * _XY_SCALE - (_XY_SCALE - 1.0) / 2.0 + np.stack([col, row], axis=1)
    centre = centre / np.array([width, height])
    half = np.exp(outputs[:, 2:4]) * np.array(anchors_px)[anchor] / side_px / 2.0
    boxes = np.concatenate([centre - half, centre + half], axis=1).astype(np.float32)
    classes, confidences = scores.argmax(axis=1), scores.max(axis=1, initial=0.0).astype(np.float32)
    is_sure = confidences >= min_confidence
    return boxes[is_sure], classes[is_sure], confidences[is_sure]


def _sigmoid(values: Array) -> Array:
    return np.float32(1.0) / (np.float32(1.0) + np.exp(-values))


def _without_doubles(boxes: Array, classes: NDArray[np.int64], confidences: Array) -> NDArray[np.int64]:
    """Return the indices of the remaining boxes, the most confident first: of each class by itself."""
    remaining: list[int] = []
    for index in np.argsort(-confidences, kind="stable").tolist():
        rivals = [other for other in remaining if classes[other] == classes[index]]
        if not rivals or box_ious(boxes[[index]], boxes[rivals]).max() <= _MAX_IOU:
            remaining.append(index)
    return np.array(remaining, np.int64)


def box_ious(first: Array, second: Array) -> Array:
    """Return the intersection over union `(N, M)` of boxes `(N, 4)` and `(M, 4)`."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    areas = [(boxes[:, 2:] - boxes[:, :2]).prod(axis=1) for boxes in (first, second)]
    ious: Array = shared / np.maximum(areas[0][:, None] + areas[1][None, :] - shared, 1e-9)
    return ious


@cache
def load_yolov4_tiny(path: Path) -> YoloV4Tiny:
    """Return the network of a file, loaded once a process.

    Args:
        path: The file `yolov4-tiny.weights`.

    Raises:
        PerceptionError: It cannot be read, or holds no such network.
    """
    try:
        return YoloV4Tiny(path.read_bytes())
    except (OSError, ValueError) as error:
        raise PerceptionError(f"{path}: cannot be loaded as YOLOv4-tiny ({error}); get the file again") from error
