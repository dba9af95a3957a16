"""Whole stacks from a folder of weights, through an episode, as `--perception predicted:STACK` has it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled_run import bundled_run

from evonav.errors import PerceptionError, StoreError
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.settings import PerceptionSettings
from evonav.perception import StageScene, weights
from evonav.perception.predicted import predicted_perception
from evonav.perception.vocabulary import PROCTHOR_TYPES
from evonav.replay.replay import RunReplay
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.tasks.public import Goal
from evonav.world.embedded import EmbeddedSimulator

pytest.importorskip("torch", reason="needs PyTorch: make test-models")

MASK_RCNN = "maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth"


@pytest.fixture(scope="module")
def all_models(tiny_models: Path) -> Path:
    """With Mask R-CNN, of random weights, whose published hash is left out of the catalogue."""
    import torch
    from torchvision.models.detection import maskrcnn_resnet50_fpn

    torch.manual_seed(0)
    network = maskrcnn_resnet50_fpn(weights=None, weights_backbone=None)
    torch.save(network.state_dict(), tiny_models / MASK_RCNN)
    return tiny_models


@pytest.fixture
def without_published_hash(monkeypatch: pytest.MonkeyPatch) -> None:
    known = weights.CATALOGUE[MASK_RCNN]
    files = tuple(replace(file, sha256="") for file in known.files)
    monkeypatch.setitem(weights.CATALOGUE, MASK_RCNN, replace(known, files=files))


def run(folder: Path, agent: str, word: str, models: Path, **limits: int) -> None:
    settings = PerceptionSettings(make=word, options={"models": str(models), "device": "cpu"})
    bundled_run(folder, [agent], Backend(perception=settings.component()), **limits)


def assert_looked(folder: Path, agent: str) -> None:
    """Every stage was scored, its time told by component, and the weights are in the summary."""
    with RunStore(folder) as store:
        records = list(store.records(agent))
        costs = store.costs()
    assert records
    assert all(record.is_scored for record in records)
    for record in records:
        cost = costs[agent, record.task_id, record.stage]
        assert 0.0 < cost["perception_wall_s"] < cost["wall_s"]
    print(f"{agent}: perception {cost['perception_wall_s']:.2f} s of {cost['wall_s']:.2f} s in the last stage")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    (facts,) = summary["perception_models"].values()
    assert all(len(digest) == 64 for digest in facts["weights"].values())
    assert "torch" in facts["libraries"]


def test_an_episode_with_owlv2_sam_and_clip(tiny_models: Path, tmp_path: Path) -> None:
    run(tmp_path / "run", "fu", "predicted:transformers,min_confidence=0.3", tiny_models, max_rounds=2)
    assert_looked(tmp_path / "run", "fu")


def test_a_replay_finds_the_models_where_the_run_had_them(
    tiny_models: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(weights.MODELS_VARIABLE, raising=False)
    run(tmp_path / "run", "fu", "predicted:transformers,min_confidence=0.3", tiny_models, max_rounds=1)
    (task,) = task_files(BUNDLED_TASKS, 1)
    replay = RunReplay(tmp_path / "run", lambda _: task.path)
    stages = list(replay.episode("fu", task.task_id))
    assert replay.backend.perception.host_options == {"models": str(tiny_models)}
    assert [stage.record.stage for stage in stages] == list(range(1, task.num_stages + 1))
    assert not any(stage.differences for stage in stages)
    monkeypatch.setenv(weights.MODELS_VARIABLE, str(tmp_path / "gone"))
    (first, *_) = RunReplay(tmp_path / "run", lambda _: task.path).episode("fu", task.task_id)
    assert first.differences
    assert first.record.error is not None
    assert "EVONAV_MODELS" in first.record.error.message


def test_an_episode_with_unigoals_detectors(all_models: Path, without_published_hash: None, tmp_path: Path) -> None:
    from evonav.perception.models.torchvision_models import load_mask_rcnn

    network = load_mask_rcnn(str(all_models / MASK_RCNN), "cpu", 0.05)
    network._model.transform.min_size = (64,)  # 800 px of noise take a minute a view
    network._model.roi_heads.detections_per_img = 8
    run(tmp_path / "run", "unigoal", "predicted,min_confidence=0.5,min_mask_score=0", all_models, max_actions=2)
    assert_looked(tmp_path / "run", "unigoal")


def test_the_published_hash_keeps_other_weights_out(all_models: Path, tmp_path: Path) -> None:
    with pytest.raises(PerceptionError, match="published is bf2d0c1e"):
        run(tmp_path / "run", "unigoal", "predicted:unigoal", all_models)


def test_a_run_is_not_resumed_with_other_weights(tiny_models: Path, tmp_path: Path) -> None:
    models = tmp_path / "models"
    shutil.copytree(tiny_models, models)
    run(tmp_path / "run", "fu", "predicted:transformers", models, max_rounds=1)
    sam = models / "facebook/sam-vit-large/config.json"
    sam.write_text(sam.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    with pytest.raises(PerceptionError, match="when it was first used"):
        run(tmp_path / "run", "stage-reset", "predicted:transformers", models, max_rounds=1)
    (models / weights.LOCK_NAME).unlink()
    with pytest.raises(StoreError, match=r"facebook/sam-vit-large/config\.json: there"):
        run(tmp_path / "run", "stage-reset", "predicted:transformers", models, max_rounds=1)


def test_percepts_hold_types_features_and_one_label_a_pixel(tiny_models: Path) -> None:
    perception = predicted_perception("transformers", str(tiny_models), "cpu", min_confidence=0.0)
    goal = Goal(1, "Bed", "", "", "the bed", np.zeros((300, 300, 3), np.uint8))
    perception.begin_stage(StageScene("task", goal, "fu", 0, ()))
    simulator = EmbeddedSimulator()
    from evonav.house import bundled_houses

    simulator.reset(next(iter(bundled_houses())).to_json())
    frames = [simulator.render(instances=False)]
    (percept,) = perception.perceive(frames)
    (again,) = perception.perceive(frames)
    detections = percept.detections
    assert np.array_equal(detections.masks, again.detections.masks)
    assert set(detections.labels) <= set(PROCTHOR_TYPES)
    assert detections.labels
    assert sorted(set(np.unique(detections.masks).tolist()) - {-1}) == list(range(len(detections.labels)))
    assert detections.features is not None
    assert detections.features.shape[0] == len(detections.labels)
    text = perception.text_feature("bed")
    assert text is not None
    assert text.shape == detections.features.shape[1:]
