"""Transformers (Apache-2.0): boxes by Grounding DINO or OWLv2, masks by SAM, features by CLIP."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from evonav.perception.models.crops import CropEmbedder, unit
from evonav.perception.models.libraries import imported, loading, make_repeatable
from evonav.perception.models.prompted import Boxes, Masks, box_masks

_Model = TypeVar("_Model", bound="_OnDevice")
_LOADED: dict[tuple[type, str, str], object] = {}
"""Models by class, folder and device."""
_MAX_BOXES = 100
_NMS_IOU = 0.7
"""Largest number of boxes, as in YOLO-World: OWLv2 has a box for every patch of the image and drops none."""


@dataclass(eq=False)
class _OnDevice:
    """A model of the library with its processor, and the device to compute on."""

    name: ClassVar[str]
    parts: ClassVar[tuple[str, ...]]
    """The library's classes of the model, of its processor, and of what else it needs."""
    _model: Any
    _processor: Any
    _device: str

    @classmethod
    def load(cls: type[_Model], path: str, device: str) -> _Model:
        """Return the model of a folder, loaded once a process.

        Raises:
            PerceptionError: The library is not installed, or the folder holds no such model.
        """
        if (cls, path, device) not in _LOADED:
            transformers = imported("transformers")
            make_repeatable()
            transformers.utils.logging.disable_progress_bar()
            with loading(path, cls.name, "its files"):
                model, processor, *more = (
                    getattr(transformers, part).from_pretrained(path, local_files_only=True) for part in cls.parts
                )
                _LOADED[cls, path, device] = cls(model.eval().to(device), processor, device, *more)
        return cast("_Model", _LOADED[cls, path, device])


@dataclass(eq=False)
class GroundingDino(_OnDevice):
    """Boxes for phrases by a `GroundingDinoForObjectDetection`. All phrases go into one text: it is for short lists."""

    name = "Grounding DINO"
    parts = ("GroundingDinoForObjectDetection", "AutoProcessor")
    min_text: float = 0.25
    """Score from which a word of the text belongs to a box."""

    def find(self, images: Sequence[NDArray[np.uint8]], phrases: tuple[str, ...], min_confidence: float) -> list[Boxes]:
        """Boxes of all images, as one batch. A box whose phrase holds none of the words is dropped."""
        torch = imported("torch")
        text = " ".join(f"{word.lower()}." for word in phrases)
        inputs = self._processor(images=list(images), text=[text] * len(images), return_tensors="pt").to(self._device)
        with torch.inference_mode():
            outputs = self._model(**inputs)
        results = self._processor.post_process_grounded_object_detection(
            outputs,
            inputs["input_ids"],
            threshold=min_confidence,
            text_threshold=self.min_text,
            target_sizes=[image.shape[:2] for image in images],
        )
        return [
            _boxes(result["boxes"], [_word_in(phrase, phrases) for phrase in result["text_labels"]], result["scores"])
            for result in results
        ]


@dataclass(eq=False)
class Owlv2(_OnDevice):
    """Boxes for any number of words, by an `Owlv2ForObjectDetection`."""

    name = "OWLv2"
    parts = ("Owlv2ForObjectDetection", "Owlv2Processor")
    _queries: dict[tuple[str, ...], Any] = field(default_factory=dict)

    def find(self, images: Sequence[NDArray[np.uint8]], phrases: tuple[str, ...], min_confidence: float) -> list[Boxes]:
        """Boxes of all images, as one batch: the best 100 of each, none of them on a better one of its word."""
        torch, ops = imported("torch"), imported("torchvision.ops")
        pixels = self._processor(images=list(images), return_tensors="pt")["pixel_values"].to(self._device)
        with torch.inference_mode():
            queries = self._queries_of(phrases).expand(len(images), -1, -1)
            feature_map, _ = self._model.image_embedder(pixels)
            features = feature_map.flatten(1, 2)
            logits, _ = self._model.class_predictor(features, queries)
            outputs = SimpleNamespace(logits=logits, pred_boxes=self._model.box_predictor(features, feature_map))
            results = self._processor.post_process_grounded_object_detection(
                outputs, threshold=min_confidence, target_sizes=[image.shape[:2] for image in images]
            )
            chosen = [
                ops.batched_nms(result["boxes"].float(), result["scores"].float(), result["labels"], _NMS_IOU)
                for result in results
            ]
        return [
            _boxes(
                result["boxes"][rows[:_MAX_BOXES]],
                [phrases[int(index)] for index in result["labels"][rows[:_MAX_BOXES]]],
                result["scores"][rows[:_MAX_BOXES]],
                image.shape[:2],
            )
            for result, rows, image in zip(results, chosen, images, strict=True)
        ]

    def _queries_of(self, phrases: tuple[str, ...]) -> Any:  # noqa: ANN401 - a tensor
        """`(1, N, D)` embedded words; the same words are embedded once."""
        if phrases not in self._queries:
            prompts = [f"a photo of a {word}" for word in phrases]
            tokens = self._processor.tokenizer(
                prompts, padding="max_length", max_length=16, truncation=True, return_tensors="pt"
            ).to(self._device)
            features = self._model.owlv2.get_text_features(tokens["input_ids"], tokens["attention_mask"])
            self._queries[phrases] = _pooled(features)[None]
        return self._queries[phrases]


class Sam(_OnDevice):
    """Masks from boxes, by a `SamModel`."""

    name = "SAM"
    parts = ("SamModel", "AutoImageProcessor")

    def outline(self, images: Sequence[NDArray[np.uint8]], boxes_px: Sequence[NDArray[np.float32]]) -> list[Masks]:
        """Images with boxes are encoded as one batch, then masks are made; an empty one is the box itself."""
        torch = imported("torch")
        busy = [index for index, boxes in enumerate(boxes_px) if len(boxes)]
        made = [
            Masks(np.zeros((0, *image.shape[:2]), np.bool_), np.zeros(0, np.float32)) for image in images
        ]  # of images without boxes
        if not busy:
            return made
        inputs = self._processor(images=[images[index] for index in busy], return_tensors="pt").to(self._device)
        with torch.inference_mode():
            embedded = self._model.get_image_embeddings(inputs["pixel_values"])
            for row, index in enumerate(busy):
                original, seen = inputs["original_sizes"][row], inputs["reshaped_input_sizes"][row]
                scale = torch.as_tensor(
                    [seen[1] / original[1], seen[0] / original[0]] * 2, dtype=torch.float32, device=self._device
                )
                boxes = torch.from_numpy(np.ascontiguousarray(boxes_px[index])).to(self._device) * scale
                outputs = self._model(
                    image_embeddings=embedded[row : row + 1], input_boxes=boxes[None], multimask_output=False
                )
                (masks,) = self._processor.post_process_masks(
                    outputs.pred_masks.cpu(), [original.tolist()], [seen.tolist()]
                )
                found = masks[:, 0].numpy().astype(np.bool_)
                is_empty = ~found.any(axis=(1, 2))
                found[is_empty] = box_masks(boxes_px[index][is_empty], found.shape[1:])
                made[index] = Masks(found, outputs.iou_scores[0, :, 0].float().cpu().numpy())
        return made


@dataclass(eq=False)
class Clip(_OnDevice, CropEmbedder):
    """An `Embedder`, by a `CLIPModel`."""

    name = "CLIP"
    parts = ("CLIPModel", "AutoImageProcessor", "AutoTokenizer")
    _tokenizer: Any

    def __post_init__(self) -> None:
        """Read the length of features."""
        self.num_features = self._model.config.projection_dim

    def _encode(self, crops: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        # A crop of a few pixels' width is not to be taken for one with channels first.
        inputs = self._processor(images=crops, input_data_format="channels_last", return_tensors="pt")
        features = self._model.get_image_features(inputs["pixel_values"].to(self._device))
        encoded: NDArray[np.float32] = _pooled(features).float().cpu().numpy()
        return encoded

    def text_feature(self, text: str) -> NDArray[np.float32]:
        """`(D,)` of unit length; what is longer than the model reads is cut off."""
        torch = imported("torch")
        tokens = self._tokenizer([text], truncation=True, return_tensors="pt").to(self._device)
        with torch.inference_mode():
            features = _pooled(self._model.get_text_features(tokens["input_ids"], tokens["attention_mask"]))
        feature: NDArray[np.float32] = unit(features.float().cpu().numpy())[0]
        return feature


def _pooled(features: Any) -> Any:  # noqa: ANN401 - a tensor, which the library wraps since version 5
    return getattr(features, "pooler_output", features)


def _word_in(phrase: str, phrases: tuple[str, ...]) -> str | None:
    """Return the word that a phrase is or contains, the longest of several."""
    text = " ".join(phrase.lower().replace(".", " ").split())
    contained = [word for word in phrases if f" {word.lower()} " in f" {text} "]
    return text if text in phrases else max(contained, key=len, default=None)


def _boxes(boxes: Any, labels: Sequence[str | None], scores: Any, shape: Sequence[int] | None = None) -> Boxes:  # noqa: ANN401 - tensors
    chosen = [index for index, label in enumerate(labels) if label is not None]
    boxes_px = boxes.float().cpu().numpy().reshape(-1, 4)[chosen]
    if shape is not None:
        boxes_px = np.clip(boxes_px, 0.0, np.array([shape[1], shape[0]] * 2, np.float32))
    return Boxes(
        boxes_px=boxes_px.astype(np.float32),
        labels=tuple(label for label in labels if label is not None),
        confidences=scores.float().cpu().numpy().astype(np.float32)[chosen],
    )
