"""The words that UniGoal's detectors know, as fixed tables from ProcTHOR's object types.

With ground-truth perception the tables stand for its detectors' vocabularies. A type goes under a word if the word,
in plain English, names it: an armchair is a chair, a stool and a dog bed are not what `chair` and `bed` mean. Types
without a word are invisible to the agent; docs/agents.md says how many goals that leaves out.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from evonav.sensors.observation import Detections

CODE_CATEGORIES = ("chair", "couch", "plant", "bed", "toilet", "tv")
"""What the released code lets a text goal be."""

CATEGORY_OF_TYPE: dict[str, str] = {
    "Chair": "chair",
    "ArmChair": "chair",
    "Sofa": "couch",
    "HousePlant": "plant",
    "Bed": "bed",
    "Toilet": "toilet",
    "Television": "tv",
    "DiningTable": "dining table",
    "Sink": "sink",
    "SinkBasin": "sink",
    "Fridge": "refrigerator",
    "Book": "book",
    "AlarmClock": "clock",
    "Vase": "vase",
    "Cup": "cup",
    "Mug": "cup",
    "Bottle": "bottle",
    "SoapBottle": "bottle",
    "SprayBottle": "bottle",
    "WineBottle": "bottle",
}
"""The map's 15 categories (Mask R-CNN on COCO); ProcTHOR has no oven."""

MAP_CATEGORIES = (
    *CODE_CATEGORIES,
    *("dining table", "oven", "sink", "refrigerator", "book", "clock", "vase", "cup", "bottle"),
)
"""All that the map's detector knows."""

NO_CATEGORY = "none"
"""What a goal's category is called that the detector does not know."""

WORD_OF_TYPE: dict[str, str] = {
    "DiningTable": "table",
    "CoffeeTable": "table",
    "SideTable": "table",
    "Desk": "table",
    "Television": "tv",
    "Chair": "chair",
    "ArmChair": "chair",
    "Cabinet": "cabinet",
    "Dresser": "cabinet",
    "TVStand": "cabinet",
    "Sofa": "sofa",
    "Bed": "bed",
    "Mirror": "mirror",
    "HousePlant": "plant",
    "Curtains": "curtain",
    "ShowerCurtain": "curtain",
    "Painting": "painting",
}
"""The scene graph's words (Grounding-DINO with a fixed list).

Of the 15, `windows` are background to our perception, `kitchen`, `bedroom` and `living room` are no objects, and
`picture` is what `painting` already names.
"""

WORD_OF_LABEL: dict[str, str] = {**{word: word for word in WORD_OF_TYPE.values()}, **WORD_OF_TYPE}
"""The same, and the words themselves: a detector that says `table` cannot tell which of ProcTHOR's tables it is."""


def relabelled(detections: Detections, words: Mapping[str, str]) -> Detections:
    """What a detector that knows only certain words finds.

    Args:
        detections: Labelled with types, or in the detector's own words.
        words: Word by label; a label without one is not detected.
    """
    kept = [index for index, label in enumerate(detections.labels) if label in words]
    if len(kept) == len(detections.labels):
        masks = detections.masks
    else:
        renumbered = np.full(len(detections.labels) + 1, -1, np.int32)  # the last is what -1 finds
        renumbered[kept] = np.arange(len(kept), dtype=np.int32)
        masks = renumbered[detections.masks]
    return Detections(
        masks=masks,
        labels=tuple(words[detections.labels[index]] for index in kept),
        confidences=detections.confidences[kept],
        features=None if detections.features is None else detections.features[kept],
    )


def category_image(detections: Detections) -> NDArray[np.int32]:
    """`(H, W)` index into `MAP_CATEGORIES` of each pixel, -1 where nothing that the map's detector knows is."""
    index = [
        MAP_CATEGORIES.index(CATEGORY_OF_TYPE[label]) if label in CATEGORY_OF_TYPE else -1
        for label in detections.labels
    ]
    return np.array([*index, -1], np.int32)[detections.masks]
