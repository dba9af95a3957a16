"""Store images of numbers as runs of equal pixels, and expand them when they are looked at as arrays.

An image of instances or masks has some thousand runs, which take 10 KB where its pixels take 360 KB, and what the core
computes from them takes time a run, not a pixel.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from evonav._core import RunImage

C = TypeVar("C")


def with_run_images(*names: str) -> Callable[[type[C]], type[C]]:
    """Let fields of a dataclass with slots take a `RunImage` for an array, which they return in any case.

    What is stored, a `RunImage` or what else a field was set to, is under the field's name after `stored_`.
    """

    def change(owner: type[C]) -> type[C]:
        for name in names:
            slot = getattr(owner, name)
            setattr(owner, name, property(partial(_expanded, slot), slot.__set__))
            setattr(owner, f"stored_{name}", slot)
        return owner

    return change


def _expanded(slot: Any, owner: object) -> Any:  # noqa: ANN401 - the slot of any class, and what is in it
    image = slot.__get__(owner)
    if type(image) is RunImage:
        # Only one form is stored: an agent may write to the array.
        image = image.pixels()
        slot.__set__(owner, image)
    return image


def unexpanded(runs: RunImage) -> NDArray[np.int32]:
    """Return runs as the value of a field of `with_run_images`, which expands them when it is read."""
    return cast("NDArray[np.int32]", runs)
