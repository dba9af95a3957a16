"""Instructions and labels compared by meaning: a stand-in for CLIP's image features where a perception has none.

Needs the extra `evonav[text]`. It is a reading of ours, not the paper's: Sec. C.4 compares images with text.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from evonav.decision.text.language import canonical
from evonav.decision.text.minilm import encoder

_DECIMALS = 4
"""Of a similarity: how many threads add up a product shows in the seventh."""


@lru_cache(maxsize=4096)
def text_feature(text: str) -> NDArray[np.float32]:
    """`(384,)` unit feature of a sentence.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    feature = encoder().encode(text)
    feature.setflags(write=False)
    return feature


def similarity_of_label(instruction: str, label: str) -> float:
    """Cosine between an instruction and what a label says, -1 to 1.

    Args:
        instruction: English.
        label: ProcTHOR's type or a detector's word.

    Raises:
        InvalidArgumentError: The extra is missing or broken.
    """
    return round(float(text_feature(instruction) @ text_feature(canonical(label))), _DECIMALS)
