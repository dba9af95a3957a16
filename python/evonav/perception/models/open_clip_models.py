"""OpenCLIP (MIT): features of crops and of texts."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.perception.models.crops import BATCH, CropEmbedder, unit
from evonav.perception.models.libraries import imported, loading, make_repeatable


class OpenClip(CropEmbedder):
    """An `Embedder` by CLIP."""

    def __init__(self, model: Any, preprocess: Any, tokenizer: Any, device: str) -> None:  # noqa: ANN401 - of open_clip
        """Make an embedder.

        Args:
            model: Model of `open_clip`.
            preprocess: Function from an image of PIL to the model's input.
        """
        self._model = model
        self._preprocess = preprocess
        self._tokenizer = tokenizer
        self._device = device
        self.num_features = int(model.text_projection.shape[1])

    def _encode(self, crops: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        torch, pil = imported("torch"), imported("PIL.Image")
        batch = torch.stack([self._preprocess(pil.fromarray(crop)) for crop in crops]).to(self._device)
        features: NDArray[np.float32] = self._model.encode_image(batch).float().cpu().numpy()
        return features

    def text_feature(self, text: str) -> NDArray[np.float32]:
        """`(D,)` of unit length; what is longer than the model reads is cut off."""
        feature: NDArray[np.float32] = self.text_features((text,))[0]
        return feature

    def text_features(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """`(N, D)` of unit length."""
        torch = imported("torch")
        with torch.inference_mode():
            rows = [
                self._model.encode_text(self._tokenizer(list(texts[start : start + BATCH])).to(self._device))
                .float()
                .cpu()
                .numpy()
                for start in range(0, len(texts), BATCH)
            ]
        return unit(np.concatenate(rows))


@cache
def load_open_clip(architecture: str, path: str, device: str) -> OpenClip:
    """Return the model of a file, loaded once a process.

    Args:
        path: File of its weights; empty: random ones.

    Raises:
        PerceptionError: The library is not installed, or the file is no such model.
    """
    open_clip = imported("open_clip")
    make_repeatable()
    with loading(path or architecture, architecture):
        model, _, preprocess = open_clip.create_model_and_transforms(
            architecture, pretrained=path or None, device=device
        )
        tokenizer = open_clip.get_tokenizer(architecture)
    return OpenClip(model.eval(), preprocess, tokenizer, device)
