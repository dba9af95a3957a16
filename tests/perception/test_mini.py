"""The mini detector with its shipped weights: what it finds, that it always finds the same, and an episode with it."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, replace
from pathlib import Path

import mini_frames
import numpy as np
import pytest
from bundled_run import bundled_run

from evonav import _core
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.settings import PerceptionSettings
from evonav.perception import mini
from evonav.perception.detector import DetectorView
from evonav.perception.mini import MiniConfig, MiniDetector
from evonav.perception.vocabulary import PROCTHOR_TYPES
from evonav.tasks.listing import BUNDLED_TASKS

MIN_AREA_PX = 1000
MIN_RECALL, MIN_PRECISION = 0.7, 0.7
"""Of objects and detections of that size."""


def views(tilted: float = 0.0) -> list[mini_frames.LabelledFrame]:
    """Of bundled houses, which are of the test split: none was trained on."""
    return list(mini_frames.frames(mini_frames.house_files(BUNDLED_TASKS)[:16], 4, 3, tilted))


@pytest.fixture(scope="module")
def frames() -> list[mini_frames.LabelledFrame]:
    return views()


def view_of(frame: mini_frames.LabelledFrame) -> DetectorView:
    return DetectorView(frame.rgb, frame.depth_m, frame.horizon_rad)


@pytest.mark.parametrize("tilted", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_it_finds_most_large_objects_and_is_mostly_right(tilted: float) -> None:
    """However far down the camera looks: houses of the test split alone have it at 30 degrees."""
    frames = views(tilted)
    found = MiniDetector().detect([view_of(frame) for frame in frames])
    num_objects = num_found = num_claims = num_right = 0
    for frame, one in zip(frames, found, strict=True):
        one.check(frame.instances.shape)
        assert not (one.masks.sum(0) > 1).any()
        areas = np.bincount(frame.instances.ravel(), minlength=len(frame.labels) + 1)
        hits = set()
        for mask, label in zip(one.masks, one.labels, strict=True):
            inside = np.bincount(frame.instances[mask], minlength=len(frame.labels) + 1)
            either = areas + mask.sum() - inside
            right = [i for i, name in enumerate(frame.labels, 1) if name == label and 2 * inside[i] >= either[i]]
            hits.update(right)
            if mask.sum() >= MIN_AREA_PX:
                num_claims += 1
                num_right += bool(right)
        large = {i for i in range(1, len(areas)) if areas[i] >= MIN_AREA_PX}
        num_objects += len(large)
        num_found += len(large & hits)
    assert num_objects > 50
    assert num_found / num_objects > MIN_RECALL, f"{num_found} of {num_objects} found"
    assert num_right / num_claims > MIN_PRECISION, f"{num_right} of {num_claims} right"


def test_classes_are_types_of_procthor() -> None:
    assert len(MiniDetector().classes) > 80
    assert set(MiniDetector().classes) <= set(PROCTHOR_TYPES)


def test_a_view_gives_the_same_bits_alone_in_a_batch_and_in_many_threads(
    frames: list[mini_frames.LabelledFrame],
) -> None:
    network = mini._network(mini.WEIGHTS)
    detector = MiniDetector()
    views = [view_of(frame) for frame in frames[:6]]
    together = detector.detect(views)
    with ThreadPoolExecutor(4) as pool:
        alone = list(pool.map(lambda view: detector.detect([view])[0], views))
        logits = list(pool.map(lambda view: network.logits(*astuple(view)), views))
    for view, batched, one, many in zip(views, together, alone, logits, strict=True):
        assert batched.labels == one.labels
        assert batched.masks.tobytes() == one.masks.tobytes()
        assert batched.confidences.tobytes() == one.confidences.tobytes()
        assert network.logits(*astuple(view)).tobytes() == many.tobytes()


@pytest.mark.parametrize("size", [(150, 150), (64, 200), (480, 640)])
def test_views_of_any_size(frames: list[mini_frames.LabelledFrame], size: tuple[int, int]) -> None:
    rows, cols = (np.arange(side) * 300 // side for side in size)
    frame = max(frames, key=lambda frame: (frame.instances > 0).sum())
    (found,) = MiniDetector().detect(
        [DetectorView(frame.rgb[rows[:, None], cols], frame.depth_m[rows[:, None], cols], frame.horizon_rad)]
    )
    found.check(size)
    assert len(found) > 0


def test_bad_input_is_named(frames: list[mini_frames.LabelledFrame], tmp_path: Path) -> None:
    frame = frames[0]
    with pytest.raises(InvalidArgumentError, match="`rgb` is of shape"):
        MiniDetector().detect([replace(view_of(frame), rgb=frame.rgb[:10])])
    with pytest.raises(InvalidArgumentError, match="`depth_m` is NaN"):
        MiniDetector().detect([replace(view_of(frame), depth_m=np.full_like(frame.depth_m, np.nan))])
    with pytest.raises(InvalidArgumentError, match="`horizon_rad` is NaN"):
        MiniDetector().detect([replace(view_of(frame), horizon_rad=np.nan)])
    with pytest.raises(InvalidArgumentError, match="predicted:mini: min_confidence = 2"):
        MiniConfig(min_confidence=2)
    with pytest.raises(InvalidArgumentError, match=r"weights .*nowhere.* cannot be used"):
        MiniDetector(weights=tmp_path / "nowhere")
    data = mini.WEIGHTS.read_bytes()
    broken = tmp_path / "broken"
    for number, bad in enumerate((data[:-3], data + b"0", data[8:], data[:100], data.replace(b'"stem"', b'"stam"'))):
        broken.with_suffix(f".{number}").write_bytes(bad)
        with pytest.raises(InvalidArgumentError, match="cannot be used"):
            MiniDetector(weights=broken.with_suffix(f".{number}"))


def test_weights_that_are_not_numbers_are_refused() -> None:
    data = mini.WEIGHTS.read_bytes()
    with pytest.raises(InvalidArgumentError, match="finite"):
        _core.MiniNetwork(data[:-2] + b"\x00\x7e")


def test_a_whole_episode_with_it(tmp_path: Path) -> None:
    backend = Backend(perception=PerceptionSettings(make="predicted:mini").component())
    records = bundled_run(tmp_path, ["fu"], backend, max_rounds=4)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["perception"] == "predicted:mini"
    assert set(summary["perception_models"]["mini"]) == {"mini.weights"}
    labels = {entry.label for record in records for entry in record.entries}
    assert len(labels) > 3
    assert labels <= set(MiniDetector().classes)
