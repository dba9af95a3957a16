"""Predicted perception with a detector by rule: what it takes over from it, and a whole episode with it."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import scripted_models
from bundled_run import bundled_run
from scripted_models import ColourEmbedder, nothing_found, scripted_perception

from evonav.component import Component
from evonav.errors import InvalidArgumentError, PerceptionError, StoreError
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.settings import PerceptionSettings
from evonav.house import bundled_houses
from evonav.perception.detector import Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.filters import FilterConfig
from evonav.perception.models.prompted import Boxes, Masks, PromptedDetector
from evonav.perception.predicted import (
    EVERYTHING,
    JointDetector,
    StackConfig,
    predicted_perception,
    stack_of,
    weights_of,
)
from evonav.perception.shorthand import parse_perception
from evonav.perception.vocabulary import (
    COCO_UNIGOAL,
    DINO_UNIGOAL,
    PROCTHOR_NOUNS,
    PROCTHOR_TYPES,
    SCANNET200,
    TYPE_OF_WORD,
    type_of_word,
)
from evonav.sensors.observation import Detections
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.tasks.vocabulary import CATEGORY_OF_TYPE, LABEL_TRANSLATION, category_image, relabelled
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics

SIDE = 64


class Told:
    """Finds what it is told to."""

    def __init__(self, *found):
        self.found = found

    def detect(self, views):
        return list(self.found)


def frame(instances=None):
    depth_m = np.random.default_rng(1).uniform(1.0, 4.0, (SIDE, SIDE)).astype(np.float32)
    rgb = np.random.default_rng(2).integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8)
    return Frame(Pose(1, 1.5, 2, 0.3), Intrinsics(SIDE, SIDE, math.pi / 2), depth_m, rgb, instances)


def found(*parts):
    """Masks that fill their boxes (left, top, right, bottom)."""
    masks = np.zeros((len(parts), SIDE, SIDE), np.bool_)
    for mask, (left, top, right, bottom), _, _ in zip(masks, *zip(*parts, strict=True), strict=True):
        mask[top:bottom, left:right] = True
    boxes, labels, confidences = zip(*parts, strict=True)
    return Found(masks, np.array(boxes, np.float32), labels, np.array(confidences, np.float32))


def same(a: Detections, b: Detections) -> bool:
    return (
        a.labels == b.labels
        and np.array_equal(a.masks, b.masks)
        and np.array_equal(a.confidences, b.confidences)
        and np.array_equal(a.features, b.features)
    )


def test_no_ground_truth_goes_in() -> None:
    nonsense = np.random.default_rng(3).integers(0, 10**6, (SIDE, SIDE)).astype(np.int32)
    without, with_nonsense = (scripted_perception().perceive([frame(instances)])[0] for instances in (None, nonsense))
    assert len(without.detections.labels) > 1
    assert same(without.detections, with_nonsense.detections)
    assert with_nonsense.pose == frame().pose
    assert np.array_equal(with_nonsense.depth_m, frame().depth_m)


def test_words_become_types_and_words_without_one_stay() -> None:
    (percept,) = scripted_perception().perceive([frame()])
    assert set(percept.detections.labels) == {"Sofa", "DiningTable", "GarbageCan", "gizmo"}
    assert percept.detections.features is not None
    assert percept.detections.features.shape == (4, 4)


def test_masks_confidences_and_features_stay_together_when_some_are_dropped() -> None:
    parts = found(((0, 0, 30, 20), "cup", 0.5), ((32, 32, 60, 50), "sofa", 0.3), ((40, 2, 60, 30), "bed", 0.9))
    features = np.eye(3, dtype=np.float32)
    (percept,) = DetectorPerception(Told(replace(parts, features=features))).perceive([frame()])
    assert percept.detections.labels == ("Bed", "Cup")  # the doubtful one went, the most confident is first
    assert percept.detections.confidences.tolist() == pytest.approx([0.9, 0.5])
    assert percept.detections.features.tolist() == [[0, 0, 1], [1, 0, 0]]
    assert (percept.detections.masks[2:30, 40:60] == 0).all()
    assert (percept.detections.masks[0:20, 0:30] == 1).all()


def test_a_mask_that_smaller_ones_cover_goes_and_the_rest_is_renumbered() -> None:
    whole = found(((0, 0, 40, 40), "bed", 0.9), ((50, 50, 60, 60), "cup", 0.8))
    halves = found(((0, 0, 20, 40), "pillow", 0.7), ((20, 0, 40, 40), "book", 0.6))
    both = Found(
        np.concatenate([whole.masks, halves.masks]),
        np.concatenate([whole.boxes_px, halves.boxes_px]),
        whole.labels + halves.labels,
        np.concatenate([whole.confidences, halves.confidences]),
        np.eye(4, dtype=np.float32),
    )
    (percept,) = DetectorPerception(Told(both), EVERYTHING).perceive([frame()])
    assert percept.detections.labels == ("Cup", "Pillow", "Book")
    assert percept.detections.features.argmax(axis=1).tolist() == [1, 2, 3]
    assert sorted(np.unique(percept.detections.masks).tolist()) == [-1, 0, 1, 2]
    assert percept.detections.masks[55, 55] == 0


def test_nothing_found_is_no_error_and_wrong_shapes_are() -> None:
    (percept,) = DetectorPerception(Told(nothing_found((SIDE, SIDE))), embedder=ColourEmbedder()).perceive([frame()])
    assert percept.detections.labels == ()
    assert percept.detections.features.shape == (0, 4)
    with pytest.raises(InvalidArgumentError, match="1 results for 2 views"):
        DetectorPerception(Told(nothing_found((SIDE, SIDE)))).perceive([frame(), frame()])
    with pytest.raises(InvalidArgumentError, match="a detector's `masks`"):
        DetectorPerception(Told(replace(found(((0, 0, 9, 9), "a", 1.0)), labels=("a", "b")))).perceive([frame()])
    with pytest.raises(InvalidArgumentError, match="no colours"):
        scripted_perception().perceive([replace(frame(), rgb=None)])


def test_unigoals_detectors_are_one_and_the_maps_word_stands() -> None:
    class Network:
        def detect(self, images, words, min_confidence):
            return [found(((0, 0, 30, 30), "couch", 0.6))]

    graph = found(((0, 0, 30, 31), "sofa", 0.9), ((40, 40, 60, 60), "painting", 0.9), ((0, 0, 64, 40), "kitchen", 0.9))
    joint = JointDetector(Network(), 0.5, Told(graph))
    (percept,) = DetectorPerception(joint, EVERYTHING).perceive([frame()])
    assert set(percept.detections.labels) == {"Sofa", "Painting"}  # a box over half the image is no object


def test_colours_can_be_swapped_as_3d_mems_code_does() -> None:
    class Looking:
        shown = ()

        def find(self, images, phrases, min_confidence):
            self.shown += (*images,)
            return [Boxes(np.zeros((0, 4), np.float32), (), np.zeros(0, np.float32))]

        def outline(self, images, boxes_px):
            self.shown += (*images,)
            return [Masks(np.zeros((0, SIDE, SIDE), np.bool_), np.zeros(0, np.float32))]

    looking, one = Looking(), frame()
    DetectorPerception(PromptedDetector(looking, looking, ("bed",), 0.5, swaps_colours=True)).perceive([one])
    for image in looking.shown:
        np.testing.assert_array_equal(image, one.rgb[..., [2, 1, 0]])
    assert len(looking.shown) == 2
    word = parse_perception("predicted:3d-mem,swapped_colours=true")
    assert weights_of("3d-mem", StackConfig(swapped_colours=word.options["swapped_colours"]))
    with pytest.raises(InvalidArgumentError, match="predicted:unigoal: swapped_colours is of 3d-mem"):
        weights_of("unigoal", StackConfig(swapped_colours=True))
    with pytest.raises(InvalidArgumentError, match="swapped_colours = 'yes': Input should be a valid boolean"):
        StackConfig(swapped_colours="yes")


def test_vocabularies_are_what_they_say() -> None:
    types = set()
    simulator = EmbeddedSimulator()
    for house in list(bundled_houses())[:20]:
        simulator.reset(house.to_json())
        types |= {body.category for body in simulator.objects if body.kind == "object"}
    assert len(types) > 60
    assert types <= set(PROCTHOR_TYPES)
    assert len(SCANNET200) == len(set(SCANNET200)) == 200
    assert {"wall", "floor", "mattress"} <= set(SCANNET200)
    assert set(TYPE_OF_WORD.values()) <= {*PROCTHOR_TYPES, *STRUCTURE_TYPES}
    assert [TYPE_OF_WORD[word] for word in ("door", "window", "windows")] == ["Doorway", "Window", "Window"]
    assert [TYPE_OF_WORD[noun] for noun in PROCTHOR_NOUNS] == list(PROCTHOR_TYPES)
    assert type_of_word("Trash cans") == "GarbageCan"
    assert type_of_word("table") is None  # dining, coffee or side
    assert type_of_word("wall") is None
    assert set(FilterConfig().background) & set(TYPE_OF_WORD) == set()


def test_unigoal_reads_its_own_words_again() -> None:
    """A word becomes a type on the way to the agent, whose tables must lead back to the word."""
    for word in COCO_UNIGOAL:
        kind = TYPE_OF_WORD.get(word)
        assert word == "oven" if kind is None else CATEGORY_OF_TYPE[kind] == word
    label = {word: TYPE_OF_WORD.get(word, word) for word in DINO_UNIGOAL}
    told = Detections(
        np.arange(len(label), dtype=np.int32)[None], tuple(label.values()), np.ones(len(label), np.float32)
    )
    kept = relabelled(told, LABEL_TRANSLATION).labels
    assert {"table", "tv", "chair", "sofa", "bed", "plant", "painting", "cabinet", "mirror", "curtain"} <= set(kept)
    assert "windows" in kept
    assert category_image(told).shape == (1, len(label))


def test_stacks_are_chosen_by_the_agent_and_options_are_checked() -> None:
    assert [stack_of(name) for name in ("unigoal", "unigoal-paper", "fu", "3d-mem")] == [
        "unigoal",
        "unigoal",
        "3d-mem",
        "3d-mem",
    ]
    assert predicted_perception().needs_rgb
    assert weights_of("3d-mem", StackConfig(sam="mobile_sam.pt"))["sam"].name == "mobile_sam.pt"
    assert StackConfig().phrases == (*PROCTHOR_NOUNS, "door", "window")
    assert StackConfig(vocabulary="Sofa; tv ;sofa").phrases == ("sofa", "tv")
    with pytest.raises(InvalidArgumentError, match="no option 'confidence'; did you mean min_confidence"):
        predicted_perception(confidence=0.5)
    with pytest.raises(InvalidArgumentError, match="min_confidence = 2"):
        predicted_perception(min_confidence=2)
    with pytest.raises(InvalidArgumentError, match="no stack 'yolo'"):
        predicted_perception("yolo")
    with pytest.raises(InvalidArgumentError, match=r"sam is 'sam_l\.pt', expected weights of transformers"):
        weights_of("transformers", StackConfig(sam="sam_l.pt"))
    with pytest.raises(InvalidArgumentError, match="words of its own"):
        weights_of("unigoal", StackConfig(vocabulary="procthor"))
    with pytest.raises(PerceptionError, match=r"no weights 'yolo\.pt' are known; there are .*yolov8x-world\.pt"):
        weights_of("3d-mem", StackConfig(detector="yolo.pt"))
    with pytest.raises(InvalidArgumentError, match="no vocabulary 'coco'"):
        _ = StackConfig(vocabulary="coco").phrases


def test_folder_and_device_are_no_part_of_what_makes_runs_the_same() -> None:
    backend = Backend(
        perception=PerceptionSettings(
            make="predicted:3d-mem,models=/somewhere,device=cpu,min_confidence=0.5"
        ).component()
    )
    assert backend.perception.host_options == {"models": "/somewhere", "device": "cpu"}
    assert backend.identity()["perception_options"] == {"stack": "3d-mem", "min_confidence": 0.5}
    assert "/somewhere" not in json.dumps(backend.identity())


def run(folder, perception, agents=("fu",)):
    backend = Backend(perception=Component(f"scripted_models:{perception}"))
    return bundled_run(folder, agents, backend, max_rounds=4, max_actions=10)


def test_a_whole_episode_with_a_scripted_detector(tmp_path) -> None:
    records = run(tmp_path / "run", "scripted_perception", agents=("3d-mem", "unigoal"))
    assert len(records) >= 6
    assert all(record.is_scored for record in records)
    labels = {entry.label for record in records if record.agent == "3d-mem" for entry in record.entries}
    assert labels
    assert labels <= {"Sofa", "DiningTable", "GarbageCan", "gizmo"}
    with RunStore(tmp_path / "run") as store:
        costs = store.costs()
    assert all(cost["perception_wall_s"] > 0.0 for cost in costs.values())
    assert len(costs) == len(records)


def test_a_run_goes_on_with_the_same_weights_alone(tmp_path, monkeypatch) -> None:
    run(tmp_path, "checked_perception")
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["perception_models"] == {"scripted": {"weights": {"a.pt": "00"}}}
    monkeypatch.setattr(scripted_models.Counted, "facts", {"scripted": {"weights": {"a.pt": "11"}}})
    run(tmp_path, "checked_perception")  # nothing is left to do
    with pytest.raises(StoreError, match=r"scripted\.weights\.a\.pt: there '00', asked '11'"):
        run(tmp_path, "checked_perception", agents=("stage-reset",))


def test_what_cannot_begin_leaves_nothing_behind(tmp_path, monkeypatch) -> None:
    def refuse(self, agents):
        raise PerceptionError(f"no weights for {agents}")

    monkeypatch.setattr(scripted_models.Counted, "check", refuse)
    with pytest.raises(PerceptionError, match="no weights for"):
        run(tmp_path / "run", "checked_perception")
    assert not (tmp_path / "run").exists()
