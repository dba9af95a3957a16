"""Write the prompts for instructions (paper, Sec. A.4), and check a model's answers."""

import re

import numpy as np
from numpy.typing import NDArray

from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, Text
from evonav.tasks.language import noun_of

APPEARANCE_PROMPT = (
    "Given the target category, the basic instruction, and the reference image, write one short navigation instruction "
    "that identifies the target mainly by visible appearance, including shape and color first, and material, texture, "
    "size, or distinctive parts when helpful.\n"
    "Do not mention coordinates, object IDs, simulator terms, or invisible attributes."
)
"""The paper's prompt for appearance instructions."""
UNIFIED_PROMPT = (
    "Given the basic instruction, the appearance instruction, and the reference image, write one concise navigation "
    "instruction that combines spatial relations with visual appearance.\n"
    "Keep relations such as on, next to, near, or below only when they are supported by the image."
)
"""The paper's prompt for unified instructions."""
UNIFIED_TEXT_PROMPT = (
    "Given the basic instruction and the appearance instruction, write one concise navigation instruction that "
    "combines spatial relations with visual appearance."
)
"""The same without what it says of the reference image, for models that read text only."""

MAX_CHARACTERS = 2000
MAX_SENTENCES = 2

_FAULTS: tuple[tuple[str, str], ...] = (
    (r"[\w.]\|[+-]?\w", "names an object id"),
    (r"\b[A-Za-z]+_[A-Za-z0-9_]+\b", "names an object id"),
    (r"\b(?:object|instance|asset)[ -]?ids?\b", "names an object id"),
    (r"\(\s*-?\d+(?:\.\d+)?\s*,\s*-?\d", "gives coordinates"),
    (r"\b[xyz]\s*[=:]\s*-?\d", "gives coordinates"),
    (r"\bcoordinates?\b", "gives coordinates"),
    (r"\b(?:simulat\w+|ai2[- ]?thor|procthor|ithor|unity|prefab|asset|rendered|rendering|3d model|bounding box)\b",
     "uses words of the simulator"),
)  # fmt: skip


def appearance_question(category: str, basic: str, image: NDArray[np.uint8]) -> Prompt:
    """Return the prompt that asks for an appearance instruction.

    Args:
        category: The target's category, as ProcTHOR spells it.
        basic: The target's basic instruction.
        image: `(H, W, 3)` RGB reference image.
    """
    inputs = f"Target category: {noun_of(category)}\nBasic instruction: {basic}\nReference image:"
    return Prompt.of(Text(f"{APPEARANCE_PROMPT}\n\n{inputs}"), Picture(image))


def unified_question(basic: str, appearance: str, image: NDArray[np.uint8] | None) -> Prompt:
    """Return the prompt that asks for a unified instruction.

    Args:
        basic: The target's basic instruction.
        appearance: The target's appearance instruction.
        image: `(H, W, 3)` RGB reference image; `None` for a model that reads text only, which is not told of one.
    """
    inputs = f"Basic instruction: {basic}\nAppearance instruction: {appearance}"
    if image is None:
        return Prompt.of(Text(f"{UNIFIED_TEXT_PROMPT}\n\n{inputs}"))
    return Prompt.of(Text(f"{UNIFIED_PROMPT}\n\n{inputs}\nReference image:"), Picture(image))


def repair_request(fault: str) -> str:
    """Return the request to correct an unusable answer."""
    return f"This {fault}. Write it again as one or two plain sentences, and nothing else."


def cleaned(answer: str) -> str:
    """Return an answer as one line, without the quotes, labels and formatting that models add around it."""
    line = " ".join(answer.split()).strip()
    line = re.sub(r"^(?:\*\*|__)?[A-Za-z ]{0,30}instruction(?:\*\*|__)?\s*:\s*(?:\*\*|__)?\s*", "", line, flags=re.I)
    line = line.strip("*` ")
    if len(line) > 1 and line[0] in "\"'“‘" and line[-1] in "\"'”’":
        line = line[1:-1].strip()
    return line


def fault_of(text: str) -> str | None:
    """Return the reason why a text is no usable instruction, or `None` if it is usable."""
    if not re.search(r"[A-Za-z]{2}", text):
        return "has no words"
    if len(text) > MAX_CHARACTERS:
        return f"is {len(text)} characters long"
    num_sentences = len([part for part in re.split(r"(?<=[.!?])[\"'”’)]*\s+(?=[A-Z\"'“(])", text) if part.strip()])
    if num_sentences > MAX_SENTENCES:
        return f"has {num_sentences} sentences"
    if any(ord(character) < 32 for character in text):
        return "has control characters"
    return next((fault for pattern, fault in _FAULTS if re.search(pattern, text, re.IGNORECASE)), None)
