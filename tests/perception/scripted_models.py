"""A detector and an embedder by rule, which look at colours and depth alone: models without models."""

from typing import ClassVar

import numpy as np

from evonav.perception.detector import Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.models.crops import padded_crops, unit

WORDS = ("couch", "dining table", "trash can", "gizmo")


def nothing_found(shape):
    return Found(np.zeros((0, *shape), np.bool_), np.zeros((0, 4), np.float32), (), np.zeros(0, np.float32))


class BandDetector:
    """In each quarter of an image, what is nearer than its neighbourhood is one of four things."""

    def detect(self, views):
        return [self._found(view.depth_m) for view in views]

    def _found(self, depth_m):
        height, width = depth_m.shape
        masks = np.zeros((4, height, width), np.bool_)
        for index, mask in enumerate(masks):
            band = slice(index * width // 4, (index + 1) * width // 4)
            near = depth_m[:, band]
            mask[:, band] = near < np.quantile(near, 0.3)
        boxes = []
        for mask in masks:
            rows, cols = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
            boxes.append([cols[0], rows[0], cols[-1] + 1, rows[-1] + 1] if len(rows) else [0, 0, 0, 0])
        return Found(masks, np.array(boxes, np.float32), WORDS, np.array([0.9, 0.8, 0.7, 0.6], np.float32))


class ColourEmbedder:
    """Mean colours of crops; a text is as its letters are."""

    def image_features(self, images, boxes_px):
        return [
            unit(
                np.array([[*crop.mean(axis=(0, 1)), 1.0] for crop in padded_crops(image, boxes)], np.float32).reshape(
                    -1, 4
                )
            )
            for image, boxes in zip(images, boxes_px, strict=True)
        ]

    def text_feature(self, text):
        return unit(np.array([[len(text), text.count("e"), text.count("a"), 1.0]], np.float32))[0]


def scripted_perception():
    return DetectorPerception(BandDetector(), embedder=ColourEmbedder())


class Counted:
    """Means that a test sets."""

    facts: ClassVar = {"scripted": {"weights": {"a.pt": "00"}}}

    def __init__(self):
        self._perception = scripted_perception()
        self.needs_rgb = True
        self.begin_stage, self.perceive = self._perception.begin_stage, self._perception.perceive
        self.text_feature = self._perception.text_feature

    def check(self, agents):
        return self.facts


def checked_perception():
    return Counted()
