"""OpenCLIP (MIT): features of crops and of texts."""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import PerceptionError
from evonav.perception.models.crops import padded_crops, unit
from evonav.perception.models.libraries import imported, make_repeatable

_BATCH = 64


class OpenClip:
    """An `Embedder`."""

    def __init__(self, model: Any, preprocess: Any, tokenizer: Any, device: str) -> None:  # noqa: ANN401 - of open_clip
        """Make an embedder.

        Args:
            model: Model of `open_clip`.
            preprocess: Function from an image of PIL to the model's input.
            tokenizer: Tokenizer of the model.
            device: Device to compute on.
        """
        self._model = model
        self._preprocess = preprocess
        self._tokenizer = tokenizer
        self._device = device
        self._num_features = int(model.text_projection.shape[1])

    def image_features(
        self, images: Sequence[NDArray[np.uint8]], boxes_px: Sequence[NDArray[np.float32]]
    ) -> list[NDArray[np.float32]]:
        """Return unit features of padded crops, all images' in batches of 64."""
        torch = imported("torch")
        pil = imported("PIL.Image")
        crops = [
            self._preprocess(pil.fromarray(np.ascontiguousarray(crop)))
            for image, boxes in zip(images, boxes_px, strict=True)
            for crop in padded_crops(image, boxes)
        ]
        rows = [np.zeros((0, self._num_features), np.float32)]
        with torch.inference_mode():
            for start in range(0, len(crops), _BATCH):
                batch = torch.stack(crops[start : start + _BATCH]).to(self._device)
                rows.append(self._model.encode_image(batch).float().cpu().numpy())
        features = unit(np.concatenate(rows))
        ends = np.cumsum([0, *(len(boxes) for boxes in boxes_px)]).tolist()
        return [features[start:end] for start, end in pairwise(ends)]

    def text_feature(self, text: str) -> NDArray[np.float32]:
        """`(D,)` of unit length; what is longer than the model reads is cut off."""
        feature: NDArray[np.float32] = self.text_features((text,))[0]
        return feature

    def text_features(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """`(N, D)` of unit length."""
        torch = imported("torch")
        with torch.inference_mode():
            rows = [
                self._model.encode_text(self._tokenizer(list(texts[start : start + _BATCH])).to(self._device))
                .float()
                .cpu()
                .numpy()
                for start in range(0, len(texts), _BATCH)
            ]
        return unit(np.concatenate(rows))


@cache
def load_open_clip(architecture: str, path: str, device: str) -> OpenClip:
    """Return the model of a file, loaded once a process.

    Args:
        architecture: Architecture, as open_clip names it.
        path: File of its weights; empty: random ones.
        device: Device to compute on.

    Raises:
        PerceptionError: The library is not installed, or the file is no such model.
    """
    open_clip = imported("open_clip")
    make_repeatable()
    try:
        model, _, preprocess = open_clip.create_model_and_transforms(
            architecture, pretrained=path or None, device=device
        )
        tokenizer = open_clip.get_tokenizer(architecture)
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise PerceptionError(
            f"{path or architecture}: cannot be loaded as {architecture} ({type(error).__name__}: {reason}); get the "
            "file again"
        ) from error
    return OpenClip(model.eval(), preprocess, tokenizer, device)
