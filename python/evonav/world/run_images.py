"""Store images of numbers as runs of equal pixels, and expand them when they are looked at as arrays.

An image of instances or masks has some thousand runs, which take 10 KB where its pixels take 360 KB, and what the core
computes from them takes time a run, not a pixel.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from evonav._core import RunImage

C = TypeVar("C")


class _Image:
    """A field whose value is an array of pixels, stored as runs until somebody asks for it."""

    def __init__(self, slot: Any) -> None:  # noqa: ANN401 - a slot of any class
        self._slot = slot

    def __get__(self, owner: Any, kind: type | None = None) -> Any:  # noqa: ANN401
        if owner is None:
            return self
        image = self._slot.__get__(owner)
        if type(image) is RunImage:
            # Only one form is stored: an agent may write to the array.
            image = image.pixels()
            self._slot.__set__(owner, image)
        return image

    def __set__(self, owner: object, image: object) -> None:
        self._slot.__set__(owner, image)

    def stored(self, owner: object) -> Any:  # noqa: ANN401
        return self._slot.__get__(owner)


def with_run_images(*names: str) -> Callable[[type[C]], type[C]]:
    """Let fields of a dataclass with slots take a `RunImage` for an array, which they return in any case."""

    def change(owner: type[C]) -> type[C]:
        for name in names:
            setattr(owner, name, _Image(getattr(owner, name)))
        return owner

    return change


def unexpanded(runs: RunImage) -> NDArray[np.int32]:
    """Return runs as the value of a field of `with_run_images`, which expands them when it is read."""
    return cast("NDArray[np.int32]", runs)


def stored(owner: object, name: str) -> Any:  # noqa: ANN401 - a `RunImage`, or what else the field was set to
    """Return the value of a field of `with_run_images` in the form in which it is stored."""
    return getattr(type(owner), name).stored(owner)
