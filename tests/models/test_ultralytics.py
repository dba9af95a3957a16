"""YOLO-World and SAM through ultralytics, with random weights: 3D-Mem's stack."""

import os
from pathlib import Path

import numpy as np
import pytest

from evonav.errors import PerceptionError
from evonav.perception import StageScene
from evonav.perception.models import libraries, open_clip_models, ultralytics_models
from evonav.perception.predicted import StackConfig, StackPerception, facts_of
from evonav.tasks.public import Goal
from evonav.world.embedded import EmbeddedSimulator

pytest.importorskip("ultralytics", reason="needs ultralytics: make test-models")

LEAST = 1e-6
"""Random networks are never sure of anything."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The smallest YOLO-World and SAM under the names of the catalogue, and one CLIP under two."""
    import torch

    folder = tmp_path_factory.mktemp("ultralytics")
    os.environ["YOLO_CONFIG_DIR"] = str(folder)
    ultralytics = libraries.imported("ultralytics")
    from ultralytics.models.sam.build import build_mobile_sam

    torch.manual_seed(0)
    ultralytics.YOLOWorld("yolov8s-worldv2.yaml").save(str(folder / "yolov8s-worldv2.pt"))
    torch.save(build_mobile_sam().state_dict(), folder / "mobile_sam.pt")
    encoder = open_clip_models.load_open_clip("ViT-B-32", "", "cpu")
    from safetensors.torch import save_file

    first, second = (
        folder / name / "open_clip_model.safetensors"
        for name in ("timm/vit_base_patch32_clip_224.openai", "laion/CLIP-ViT-B-32-laion2B-s34B-b79K")
    )
    first.parent.mkdir(parents=True)
    second.parent.mkdir(parents=True)
    save_file({key: value.contiguous() for key, value in encoder._model.state_dict().items()}, str(first))
    second.hardlink_to(first)
    return folder


@pytest.fixture(scope="module")
def yolo(folder: Path) -> ultralytics_models.YoloWorld:
    text = folder / "timm/vit_base_patch32_clip_224.openai/open_clip_model.safetensors"
    return ultralytics_models.load_yolo_world(str(folder / "yolov8s-worldv2.pt"), str(text), "cpu")


@pytest.fixture(scope="module")
def sam(folder: Path) -> ultralytics_models.UltralyticsSam:
    return ultralytics_models.load_ultralytics_sam(str(folder / "mobile_sam.pt"), "cpu")


def test_yolo_world_finds_words_changes_them_and_takes_batches(yolo, images) -> None:
    first = yolo.find(images[:2], ("chair", "table", "sofa"), LEAST)
    for one, image in zip(first, images, strict=False):
        assert one.boxes_px.shape == (len(one.labels), 4)
        assert len(one.labels) > 0
        assert set(one.labels) <= {"chair", "table", "sofa"}
        (alone,) = yolo.find([image], ("chair", "table", "sofa"), LEAST)
        assert len(alone.labels) == len(one.labels)
        np.testing.assert_allclose(np.sort(alone.confidences), np.sort(one.confidences), rtol=1e-2)
    other = yolo.find(images[:1], ("bed",), LEAST)
    assert set(other[0].labels) == {"bed"}
    again = yolo.find(images[:1], ("chair", "table", "sofa"), LEAST)
    assert again[0].labels == yolo.find(images[:1], ("chair", "table", "sofa"), LEAST)[0].labels
    assert set(again[0].labels) <= {"chair", "table", "sofa"}
    assert yolo.find(images[:1], ("chair",), 0.99)[0].labels == ()


def test_words_go_in_as_features_of_their_own(yolo) -> None:
    yolo.find([np.zeros((96, 96, 3), np.uint8)], ("chair", "bed"), 0.5)
    features = yolo._model.model.txt_feats
    assert features.shape == (1, 2, 512)
    np.testing.assert_allclose(np.linalg.norm(features.numpy(), axis=-1), 1.0, atol=1e-5)
    expected = yolo._encoder.text_features(("chair", "bed"))
    np.testing.assert_allclose(features[0].numpy(), expected, atol=1e-6)


def test_colours_go_in_as_the_library_takes_them(yolo, sam, images, monkeypatch) -> None:
    seen = []
    for model in (yolo, sam):

        def predict(source, *args, **kwargs):
            seen.append(source[0] if isinstance(source, list) else source)
            raise RuntimeError("seen")

        monkeypatch.setattr(model._model, "predict", predict)
    with pytest.raises(RuntimeError, match="seen"):
        yolo.find(images[:1], ("chair",), 0.5)
    with pytest.raises(RuntimeError, match="seen"):
        sam.outline(images[:1], [np.array([[1, 1, 9, 9]], np.float32)])
    assert all(np.array_equal(image[..., ::-1], images[0]) for image in seen)


def test_sam_never_has_fewer_masks_than_boxes(sam, images) -> None:
    """With random weights it drops nearly all: what it drops is the box."""
    boxes = [np.array([[10, 10, 50, 60], [0, 0, 3, 96], [30, 30, 90, 90]], np.float32), np.zeros((0, 4), np.float32)]
    made = sam.outline(images[:2], boxes)
    assert [one.masks.shape for one in made] == [(3, 96, 96), (0, 96, 96)]
    assert all(mask.any() for mask in made[0].masks)


def test_masks_stay_with_their_boxes_when_some_are_dropped(sam, images, monkeypatch) -> None:
    import torch

    class Result:
        masks = type("Masks", (), {"data": torch.zeros(2, 96, 96, dtype=torch.bool)})
        masks.data[0, 5:9, 5:9] = True  # of the third box; that of the first is empty
        boxes = type("Boxes", (), {"cls": torch.tensor([2.0, 0.0]), "conf": torch.tensor([0.7, 0.6])})

    monkeypatch.setattr(sam._model, "predict", lambda *args, **kwargs: [Result()])
    boxes = np.array([[0, 0, 10, 10], [20, 20, 30, 30], [5, 5, 9, 9]], np.float32)
    (made,) = sam.outline(images[:1], [boxes])
    assert [int(mask.sum()) for mask in made.masks] == [100, 100, 16]
    assert made.scores.tolist() == pytest.approx([0.6, 0.0, 0.7])


def test_a_round_with_3d_mems_stack(folder: Path, yolo) -> None:
    from evonav.house import bundled_houses

    simulator = EmbeddedSimulator()
    simulator.reset(next(iter(bundled_houses())).to_json())
    frame = simulator.render(instances=False)
    assert frame.rgb is not None
    (boxes,) = yolo.find([frame.rgb], ("bed", "table"), LEAST)
    sixth = float(np.sort(boxes.confidences)[-6])  # a network that is sure of nothing finds 300 things
    config = StackConfig(
        vocabulary="bed;table", min_confidence=sixth, detector="yolov8s-worldv2.pt", sam="mobile_sam.pt"
    )
    facts = facts_of("3d-mem", config, str(folder))
    assert set(facts["libraries"]) == {"torch", "open_clip_torch", "ultralytics"}
    assert len(facts["weights"]) == 4
    perception = StackPerception("auto", config, str(folder), "cpu")
    goal = Goal(1, "Bed", "", "", "the bed", np.zeros((300, 300, 3), np.uint8))
    perception.begin_stage(StageScene("task", goal, "fu", 0, ()))
    (percept,) = perception.perceive([frame])
    assert set(percept.detections.labels) <= {"Bed", "table"}
    assert percept.detections.features is not None
    assert percept.detections.features.shape == (len(percept.detections.labels), 512)
    text = perception.text_feature("the bed in the kitchen")
    assert text is not None
    assert text.shape == (512,)


def test_a_file_that_is_no_model_is_refused(folder: Path) -> None:
    bad = folder / "sam_b.pt"
    bad.write_bytes(b"no model")
    with pytest.raises(PerceptionError, match=r"sam_b\.pt: cannot be loaded as SAM"):
        ultralytics_models.load_ultralytics_sam(str(bad), "cpu")
