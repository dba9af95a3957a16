"""Compare instructions and labels by meaning: a stand-in for CLIP's image features if a perception has none.

Needs the extra `evonav[text]`. It is a reading of ours, not the paper's: Sec. C.4 compares images with text.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from evonav.decision.text.language import canonical
from evonav.decision.text.minilm import encoder

_DECIMALS = 4
"""Decimals of a similarity: the number of threads changes a product in the seventh."""


@lru_cache(maxsize=4096)
def text_feature(text: str) -> NDArray[np.float32]:
    """Return the `(384,)` unit feature of a sentence.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    feature = encoder().encode(text)
    feature.setflags(write=False)
    return feature


def similarity_of_label(instruction: str, label: str) -> float:
    """Return the cosine between an instruction and a label, -1 to 1.

    Args:
        instruction: English text.
        label: ProcTHOR's type or a detector's word.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    return round(float(text_feature(instruction) @ text_feature(canonical(label))), _DECIMALS)
