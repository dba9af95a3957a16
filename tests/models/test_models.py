"""Every library's models, built from their configurations with random weights: shapes, batches, words, caching.

Random networks find nothing in particular; what is tested is that what goes in and out of them is what we take it for.
"""

from pathlib import Path

import numpy as np
import pytest

from evonav.errors import PerceptionError
from evonav.perception.models import libraries, open_clip_models, torchvision_models, transformers_models
from evonav.perception.models.prompted import Boxes
from evonav.perception.predicted import _COCO
from evonav.perception.vocabulary import DINO_UNIGOAL

pytest.importorskip("torch", reason="needs PyTorch: make test-models")

BOXES = [
    np.array([[10, 10, 50, 60], [0, 0, 2, 96], [-5, 80, 200, 120]], np.float32),
    np.zeros((0, 4), np.float32),
    np.array([[30, 30, 90, 90]], np.float32),
]


def assert_fit(found: list[Boxes], words: tuple[str, ...]) -> None:
    for one in found:
        assert one.boxes_px.shape == (len(one.labels), 4)
        assert one.boxes_px.dtype == one.confidences.dtype == np.float32
        assert one.confidences.shape == (len(one.labels),)
        assert set(one.labels) <= set(words)


def assert_same(batch: list[Boxes], single: list[Boxes]) -> None:
    """Batching changes the last digits alone, which may swap two boxes of nearly equal confidence."""
    for together, alone in zip(batch, single, strict=True):
        assert len(together.labels) == len(alone.labels) > 0
        np.testing.assert_allclose(np.sort(together.confidences), np.sort(alone.confidences), atol=1e-4)
        np.testing.assert_allclose(together.boxes_px.mean(axis=0), alone.boxes_px.mean(axis=0), atol=0.5)


@pytest.fixture
def grounding_dino(tiny_models: Path) -> transformers_models.GroundingDino:
    return transformers_models.GroundingDino.load(str(tiny_models / "IDEA-Research/grounding-dino-tiny"), "cpu")


@pytest.fixture
def owlv2(tiny_models: Path) -> transformers_models.Owlv2:
    return transformers_models.Owlv2.load(str(tiny_models / "google/owlv2-base-patch16-ensemble"), "cpu")


@pytest.fixture
def sam(tiny_models: Path) -> transformers_models.Sam:
    return transformers_models.Sam.load(str(tiny_models / "facebook/sam-vit-large"), "cpu")


@pytest.fixture
def clip(tiny_models: Path) -> transformers_models.Clip:
    return transformers_models.Clip.load(str(tiny_models / "laion/CLIP-ViT-B-32-laion2B-s34B-b79K"), "cpu")


def test_grounding_dino_finds_words_and_a_batch_is_its_images_one_by_one(grounding_dino, images) -> None:
    everything = transformers_models.GroundingDino(
        grounding_dino._model, grounding_dino._processor, "cpu", min_text=0.0
    )
    found = everything.find(images, DINO_UNIGOAL, 0.0)
    assert_fit(found, DINO_UNIGOAL)
    assert_same(found, [everything.find([image], DINO_UNIGOAL, 0.0)[0] for image in images])
    assert all(not one.labels for one in grounding_dino.find(images, DINO_UNIGOAL, 1.0))


def test_a_phrase_counts_as_the_longest_word_in_it() -> None:
    words = ("room", "living room", "tv")
    assert transformers_models._word_in("living room", words) == "living room"
    assert transformers_models._word_in("tv. living room.", words) == "living room"
    assert transformers_models._word_in("rooms", words) is None
    assert transformers_models._word_in("", words) is None


def test_owlv2_finds_words_and_changes_them(owlv2, images) -> None:
    first = owlv2.find(images, ("chair", "table"), 0.0)
    assert_fit(first, ("chair", "table"))
    assert_same(first, [owlv2.find([image], ("chair", "table"), 0.0)[0] for image in images])
    for one, image in zip(first, images, strict=True):
        assert (one.boxes_px >= 0.0).all()
        assert (one.boxes_px <= image.shape[0]).all()
    other = owlv2.find(images, ("sofa",), 0.0)
    assert {label for one in other for label in one.labels} == {"sofa"}
    again = owlv2.find(images, ("chair", "table"), 0.0)
    assert [one.labels for one in again] == [one.labels for one in first]
    least = float(np.median(first[0].confidences))
    assert 0 < len(owlv2.find(images[:1], ("chair", "table"), least)[0].labels) < len(first[0].labels)


def test_owlv2s_scores_are_those_of_its_own_forward_pass(owlv2, images) -> None:
    """We embed words once and not for every image: the same logits, by the library's own way."""
    import torch

    inputs = owlv2._processor(text=[["chair", "table"]], images=[images[0]], return_tensors="pt")
    tokens = owlv2._processor.tokenizer(
        ["a photo of a chair", "a photo of a table"], padding="max_length", max_length=16, return_tensors="pt"
    )
    with torch.inference_mode():
        whole = owlv2._model(**{**inputs, "input_ids": tokens["input_ids"], "attention_mask": tokens["attention_mask"]})
    best = float(torch.sigmoid(whole.logits.max()))
    found = owlv2.find(images[:1], ("chair", "table"), 0.0)
    assert float(found[0].confidences.max()) == pytest.approx(best, abs=1e-5)


def test_sam_makes_a_mask_for_every_box(sam, images) -> None:
    made = sam.outline(images, BOXES)
    assert [one.masks.shape for one in made] == [(3, 96, 96), (0, 96, 96), (1, 96, 96)]
    assert all(one.masks.dtype == np.bool_ and one.scores.shape == (len(one.masks),) for one in made)
    assert all(mask.any() for one in made for mask in one.masks)
    for image, boxes, together in zip(images, BOXES, made, strict=True):
        (alone,) = sam.outline([image], [boxes])
        assert np.mean(alone.masks != together.masks) < 0.01 if len(boxes) else True
        np.testing.assert_allclose(alone.scores, together.scores, atol=1e-4)


@pytest.mark.parametrize("name", ["clip", "open_clip"])
def test_crops_and_texts_have_unit_features_in_one_space(name, clip, images, request) -> None:
    model = clip if name == "clip" else request.getfixturevalue("tiny_open_clip")
    features = model.image_features(images, BOXES)
    assert [len(one) for one in features] == [3, 0, 1]
    assert all(one.dtype == np.float32 and one.shape[1] == features[0].shape[1] for one in features)
    for row in np.concatenate(features):
        assert np.linalg.norm(row) == pytest.approx(1.0, abs=1e-5)
    alone = model.image_features(images[2:], BOXES[2:])
    np.testing.assert_allclose(alone[0], features[2], atol=1e-5)
    assert not np.allclose(features[0][0], features[0][1], atol=1e-4)
    text = model.text_feature("the brown chair in the kitchen " * 40)  # longer than it reads
    assert text.shape == (features[0].shape[1],)
    assert np.linalg.norm(text) == pytest.approx(1.0, abs=1e-5)


@pytest.fixture(scope="module")
def tiny_open_clip() -> open_clip_models.OpenClip:
    """The library's own code at a hundredth of the 151 million parameters of ViT-B/32."""
    import open_clip

    vision = {"image_size": 32, "layers": 2, "width": 64, "patch_size": 8}
    text = {"context_length": 77, "vocab_size": 49408, "width": 32, "heads": 4, "layers": 2}
    model = open_clip.CLIP(embed_dim=24, vision_cfg=vision, text_cfg=text)
    preprocess = open_clip.image_transform(32, is_train=False)
    return open_clip_models.OpenClip(model.eval(), preprocess, open_clip.get_tokenizer("ViT-B-32"), "cpu")


def test_mask_rcnn_finds_cocos_categories_in_unigoals_words(images) -> None:
    network = torchvision_models.load_mask_rcnn("", "cpu")
    network._model.transform.min_size = (64,)  # 800 px of noise take a minute
    network._model.roi_heads.detections_per_img = 8
    found = network.detect(images, _COCO, 0.0)
    for one in found:
        one.check((96, 96))
    assert {label for one in found for label in one.labels} <= set(_COCO.values())
    assert any(len(one) for one in found)
    alone = [network.detect([image], _COCO, 0.0)[0] for image in images]
    assert [len(one) for one in alone] == [len(one) for one in found]
    assert all(len(one) == 0 for one in network.detect(images, _COCO, 1.1))
    assert all(len(one) == 0 for one in network.detect(images, {}, 0.0))
    names = set(network._categories)
    assert set(_COCO) <= names, "torchvision calls its categories otherwise"


def test_models_are_loaded_once_a_process(tiny_models: Path) -> None:
    path = str(tiny_models / "facebook/sam-vit-large")
    assert transformers_models.Sam.load(path, "cpu") is transformers_models.Sam.load(path, "cpu")
    other = str(tiny_models / "facebook/sam-vit-huge")
    assert transformers_models.Sam.load(path, "cpu") is not transformers_models.Sam.load(other, "cpu")


def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    bad = tmp_path / "mask.pth"
    bad.write_bytes(b"no model")
    with pytest.raises(PerceptionError, match=r"mask\.pth: cannot be loaded as Mask R-CNN .* get the file again"):
        torchvision_models.load_mask_rcnn(str(bad), "cpu")
    with pytest.raises(PerceptionError, match="cannot be loaded as SAM"):
        transformers_models.Sam.load(str(tmp_path), "cpu")


def test_devices_are_found_or_refused() -> None:
    import torch

    assert libraries.device_of("cpu") == "cpu"
    assert libraries.device_of("auto") == ("cuda" if torch.cuda.is_available() else "cpu")
    with pytest.raises(PerceptionError, match="expected auto, cpu, cuda or cuda:N"):
        libraries.device_of("tpu")
    with pytest.raises(PerceptionError, match="finds no such GPU"):
        libraries.device_of("cuda:99")
