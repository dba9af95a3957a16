"""Translate ProcTHOR's object types to the vocabularies of UniGoal's detectors, by fixed tables.

With perfect perception the tables replace the detectors. A type gets a label if the label names it in plain English:
an armchair is a `chair`, but a stool is not, and a dog bed is not a `bed`. Types without a label are invisible to the
agent; docs/agents.md gives the number of goals that this excludes.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from evonav.sensors.observation import Detections

CODE_CATEGORIES = ("chair", "couch", "plant", "bed", "toilet", "tv")
"""Categories that the released code accepts as a text goal."""

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
"""All categories of the map's detector."""

ASSOCIATED_CATEGORY: dict[str, str] = {
    **dict.fromkeys(("AlarmClock", "DogBed", "Dresser", "LaundryHamper", "Pillow", "TeddyBear"), "bed"),
    **dict.fromkeys(("CoffeeTable", "FloorLamp", "Newspaper", "Ottoman"), "couch"),
    **dict.fromkeys(("RoomDecor", "TableTopDecor", "Vase", "WateringCan"), "plant"),
    **dict.fromkeys(("CD", "Desktop", "Laptop", "RemoteControl", "TVStand"), "tv"),
    **dict.fromkeys(("Cloth", "Faucet", "HandTowel", "HandTowelHolder", "Plunger", "ScrubBrush"), "toilet"),
    **dict.fromkeys(("ShowerCurtain", "ShowerHead", "Sink", "SoapBar", "SoapBottle", "SprayBottle"), "toilet"),
    **dict.fromkeys(("TissueBox", "ToiletPaper", "ToiletPaperHanger", "Towel", "TowelHolder"), "toilet"),
}
"""The category of `CODE_CATEGORIES` that is thought of first with a type that none of them names; else a chair.

The original forces a language model to name one of the six; this stands in for its answer. It is our choice by
meaning, and no rate was looked at."""
FALLBACK_CATEGORY = CODE_CATEGORIES[0]
"""The released code's category after ten answers that name none: a chair."""

NO_CATEGORY = "none"
"""Category of a goal that the detector does not know."""

LABEL_OF_TYPE: dict[str, str] = {
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
    "Window": "windows",
}
"""The scene graph's labels (Grounding-DINO with a fixed list of 15).

Four of them are not used: `kitchen`, `bedroom` and `living room` are not objects, and `picture` means the same as
`painting`. Doors have no label in it.
"""

LABEL_TRANSLATION: dict[str, str] = {**{label: label for label in LABEL_OF_TYPE.values()}, **LABEL_OF_TYPE}
"""The same, with the labels themselves: a detection labelled `table` may be any of ProcTHOR's tables."""


def relabelled(detections: Detections, translation: Mapping[str, str]) -> Detections:
    """Return what a detector with a limited vocabulary finds.

    Args:
        detections: Detections labelled with types, or with the detector's own labels.
        translation: The detector's label by label; a label without one is not detected.
    """
    detected = [index for index, label in enumerate(detections.labels) if label in translation]
    found = detections.taken(detected)
    return replace(found, labels=tuple(translation[label] for label in found.labels))


def category_image(detections: Detections) -> NDArray[np.int32]:
    """Return each pixel's `(H, W)` index into `MAP_CATEGORIES`, -1 where the map's detector finds nothing."""
    index = [
        MAP_CATEGORIES.index(CATEGORY_OF_TYPE[label]) if label in CATEGORY_OF_TYPE else -1
        for label in detections.labels
    ]
    return np.array([*index, -1], np.int32)[detections.masks]
