"""Simulated errors happen at their stated rates, on views rendered in the bundled houses."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled_run import bundled_run

from evonav import _core
from evonav.evaluation.run.components import Backend, load_spec
from evonav.perception import Percept, StageScene
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.perception.noise import NoiseConfig, PoseDrift, noise_presets
from evonav.perception.shorthand import parse_perception
from evonav.perception.simulated import NoisyPerception, noisy_perception
from evonav.sensors.observation import Detections
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Frame

Views = list[tuple[StageScene, list[list[Frame]]]]


@cache
def views(num_tasks: int = 4, num_rounds: int = 5) -> Views:
    """Rounds of three views from places in some of the bundled houses."""
    simulator = EmbeddedSimulator()
    draws = np.random.default_rng(0)
    found = []
    for path in sorted(BUNDLED_TASKS.glob("*/task.json"))[:num_tasks]:
        case = load_spec(path.parent)
        simulator.reset(case.stages[0].house_json)
        scene = StageScene(case.task_id, case.stages[0].public, "fu", 7, tuple(simulator.objects))
        places = simulator.reachable_positions()
        rounds = []
        for _ in range(num_rounds):
            x_m, _, z_m = places[draws.integers(len(places))].tolist()
            poses = [replace(simulator.pose, x_m=x_m, z_m=z_m, yaw_rad=yaw) for yaw in draws.uniform(0, 6.2, 3)]
            rounds.append([simulator.render(pose, rgb=False, instances=True) for pose in poses])
        found.append((scene, rounds))
    return found


def seen(perception: Any, seed: int | None = None) -> list[tuple[StageScene, Frame, Percept]]:
    percepts = []
    for scene, rounds in views():
        scene = scene if seed is None else replace(scene, seed=seed)
        perception.begin_stage(scene)
        for frames in rounds:
            percepts += [(scene, *pair) for pair in zip(frames, perception.perceive(frames), strict=True)]
    return percepts


@cache
def truths() -> list[tuple[Detections, np.ndarray, np.ndarray]]:
    """Of each view: ground truth, outlines, and pixels of each object."""
    found = []
    for _, frame, percept in seen(GroundTruthPerception()):
        masks, num = percept.detections.masks, len(percept.detections.labels)
        outlines = _core.mask_outlines(masks, frame.depth_m, num_masks=num)
        found.append((percept.detections, outlines, _core.mask_extents(masks, num_masks=num)[:, 0]))
    return found


def is_found(truth: Detections, told: Detections) -> np.ndarray:
    """Of each object whether some detection covers a pixel of it; for errors that leave masks alone."""
    return np.array([(told.masks[truth.masks == number] >= 0).any() for number in range(len(truth.labels))], bool)


def rates(**parameters: Any) -> tuple[np.ndarray, list[tuple[Detections, Detections]]]:
    """Whether each object in each view was found, over three seeds; and what was, beside what there was."""
    found, pairs = [], []
    for seed in range(3):
        for (truth, _, _), (_, _, percept) in zip(
            truths(), seen(noisy_perception("perfect", **parameters), seed), strict=True
        ):
            found.append(is_found(truth, percept.detections))
            pairs.append((truth, percept.detections))
    return np.concatenate(found), pairs


def close(share: float, expected: float, num: int) -> bool:
    """Within four standard errors."""
    return abs(share - expected) <= 4.0 * math.sqrt(expected * (1.0 - expected) / num) + 1e-9


def test_perfect_is_the_ground_truth() -> None:
    for (_, frame, percept), (truth, _, _) in zip(seen(noisy_perception("perfect")), truths(), strict=True):
        told = percept.detections
        assert (told.masks == truth.masks).all()
        assert told.labels == truth.labels
        assert (told.confidences == 1.0).all()
        assert told.features is None
        assert percept.depth_m is frame.depth_m
        assert percept.pose is frame.pose


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_objects_are_missed_at_the_rate(share: float) -> None:
    found, _ = rates(miss_rate=share)
    assert close(found.mean(), 1.0 - share, len(found))


@pytest.mark.parametrize("what", ["area", "distance", "visible"])
def test_small_far_and_hidden_objects_are_missed_as_the_curves_say(what: str) -> None:
    outlines = np.concatenate([one for _, one, _ in truths()] * 3)
    areas = np.concatenate([areas / truth.masks.size for truth, _, areas in truths()] * 3)
    if what == "area":
        found, _ = rates(half_area_fraction=0.004, area_slope=1.5)
        ratio, slope = 0.004 / areas, 1.5
    elif what == "distance":
        found, _ = rates(half_distance_m=3.0, distance_slope=4.0)
        ratio, slope = outlines[:, 2] / 3.0, 4.0
    else:
        found, _ = rates(half_visible=0.6, visible_slope=2.0)
        ratio, slope = 0.6 / np.maximum(1.0 - outlines[:, 1] / outlines[:, 0], 1e-9), 2.0
    expected = 1.0 / (1.0 + ratio**slope)
    for part in np.array_split(np.argsort(expected), 4):
        deviation = math.sqrt(float((expected[part] * (1.0 - expected[part])).sum()))
        assert abs(found[part].sum() - expected[part].sum()) <= 4.0 * deviation
    assert expected.min() < 0.4
    assert expected.max() > 0.7


def test_labels_are_confused_at_the_rate_and_mostly_with_similar_ones() -> None:
    _, pairs = rates(confusion_rate=0.25, confusion_similar=0.9)
    labels = [both for truth, told in pairs for both in zip(truth.labels, told.labels, strict=True)]
    wrong = [both for both in labels if both[0] != both[1]]
    assert close(len(wrong) / len(labels), 0.25, len(labels))
    similar = noisy_perception()._confusion.similar
    grouped = [both for both in wrong if both[0] in similar]
    alike = [told in similar[truth][0] for truth, told in grouped]
    assert 0.85 < np.mean(alike) < 0.97


def test_doors_and_windows_are_missed_and_confused_and_nothing_is_taken_for_one() -> None:
    _, pairs = rates(confusion_rate=1.0, confusion_similar=1.0)
    told = {both for truth, told in pairs for both in zip(truth.labels, told.labels, strict=True)}
    assert {wrong for true, wrong in told if true == "Doorway"} == {"Doorframe"}
    assert {wrong for true, wrong in told if true == "Window"} == {"Painting"}
    _, pairs = rates(confusion_rate=0.5, confusion_similar=0.0, false_positives_per_view=2.0)
    for truth, seen_as in pairs:
        assert all(seen_as.labels.count(kind) <= truth.labels.count(kind) for kind in STRUCTURE_TYPES)
    is_found, _ = rates(miss_rate=0.5)
    is_structure = np.tile([label in STRUCTURE_TYPES for truth, _, _ in truths() for label in truth.labels], 3)
    assert 0.35 < is_found[is_structure].mean() < 0.65


def test_nothing_is_taken_for_something_at_the_rate_and_again_where_it_was() -> None:
    # All that is there is missed: what is left is not there.
    for persistence in (0.0, 0.8):
        _, pairs = rates(miss_rate=1.0, false_positives_per_view=2.0, persistence=persistence)
        num = np.mean([len(told.labels) for _, told in pairs])
        # Some are smaller than the smallest mask, or painted over by others.
        assert 1.2 < num < 2.3
    scene, rounds = views()[0]
    for persistence, least, most in ((1.0, 1.0, 1.0), (0.0, 0.0, 0.3)):
        perception = noisy_perception("perfect", miss_rate=1.0, false_positives_per_view=4.0, persistence=persistence)
        perception.begin_stage(scene)
        first, second = (perception.perceive(rounds[0]) for _ in range(2))
        labels = [(a.detections.labels, b.detections.labels) for a, b in zip(first, second, strict=True)]
        assert sum(len(a) for a, _ in labels) > 3
        same = sum(len(set(a) & set(b)) for a, b in labels) / sum(len(set(a)) for a, _ in labels)
        assert least <= same <= most


def test_an_objects_errors_last_over_views_as_persistence_says() -> None:
    def agreement(persistence: float, scope: str = "stage") -> float:
        same = []
        for scene, rounds in views():
            perception = noisy_perception("perfect", miss_rate=0.5, persistence=persistence, persistence_scope=scope)
            perception.begin_stage(scene)
            told = [perception.perceive(frames) for frames in (rounds[0], rounds[0])]
            perception.begin_stage(replace(scene, goal=replace(scene.goal, stage=2)))
            told.append(perception.perceive(rounds[0]))
            exact = GroundTruthPerception()
            exact.begin_stage(scene)
            for truth, *others in zip(exact.perceive(rounds[0]), *told, strict=True):
                a, b, c = (is_found(truth.detections, one.detections) for one in others)
                same += (a == (b if scope == "stage" else c)).tolist()
        return float(np.mean(same))

    assert agreement(1.0) == 1.0
    assert agreement(1.0, "episode") == 1.0
    # Two normals with correlation r agree in sign in 1/2 + asin(r) / pi of all cases.
    for persistence in (0.0, 0.7):
        assert abs(agreement(persistence) - (0.5 + math.asin(persistence) / math.pi)) < 0.15


def test_masks_shrink_grow_and_split() -> None:
    area = np.concatenate([areas for _, _, areas in truths()] * 3).sum()

    def covered(**parameters: float) -> float:
        return sum(float((told.masks >= 0).sum()) for _, told in rates(**parameters)[1])

    assert covered(mask_margin_px=-2.0) < 0.9 * area < area < covered(mask_margin_px=2.0)
    assert 0.85 * area < covered(box_jitter=0.1) < 0.99 * area
    num = sum(len(areas) for _, _, areas in truths()) * 3
    _, pairs = rates(split_rate=0.2)
    parts = sum(len(told.labels) for _, told in pairs)
    # Parts smaller than the smallest mask are dropped.
    assert 0.08 * num < parts - num < 0.25 * num


def test_masks_side_by_side_with_the_same_label_merge() -> None:
    _, pairs = rates(merge_rate=1.0)
    _, apart = rates(merge_rate=0.0)
    num_pairs = 0
    for (truth, told), (_, whole) in zip(pairs, apart, strict=True):
        assert ((told.masks >= 0) == (whole.masks >= 0)).all()
        num_pairs += len(whole.labels) - len(told.labels)
        assert set(told.labels) == set(truth.labels)
    assert num_pairs > 10


def test_confidence_tells_right_from_wrong_and_the_threshold_drops() -> None:
    parameters = {"confusion_rate": 0.4, "confidence": 0.8, "false_confidence": 0.4}
    _, pairs = rates(**parameters)
    right = [c for t, told in pairs for a, b, c in zip(t.labels, told.labels, told.confidences, strict=True) if a == b]
    wrong = [c for t, told in pairs for a, b, c in zip(t.labels, told.labels, told.confidences, strict=True) if a != b]
    assert abs(np.median(right) - 0.8) < 0.04
    assert abs(np.median(wrong) - 0.4) < 0.06
    found, pairs = rates(**parameters, confidence_threshold=0.5)
    assert all((told.confidences >= 0.5).all() for _, told in pairs)
    # Log-odds of 4 and 2/3 with deviation 1, above 0.
    normal = lambda x: 0.5 * math.erfc(-x / math.sqrt(2))  # noqa: E731
    expected = 0.6 * normal(math.log(4.0)) + 0.4 * normal(math.log(2.0 / 3.0))
    assert close(found.mean(), expected, len(found))


def test_presets_find_less_and_less() -> None:
    recalls = []
    for preset in noise_presets():
        right = num = 0
        for (truth, _, _), (_, _, percept) in zip(truths(), seen(noisy_perception(preset)), strict=True):
            told = percept.detections
            for number, label in enumerate(truth.labels):
                own = truth.masks == number
                parts = [told.masks == n for n, other in enumerate(told.labels) if other == label]
                right += any((part & own).sum() > 0.5 * (part | own).sum() for part in parts)
                num += 1
        recalls.append(right / num)
    assert recalls[0] == 1.0
    assert all(better > worse + 0.05 for better, worse in pairwise(recalls)), recalls
    assert list(noise_presets()) == ["perfect", "good", "yolo-world-like", "poor"]


def test_a_view_does_not_depend_on_the_other_views() -> None:
    scene, rounds = views()[0]

    def told(frames: Sequence[Frame]) -> Percept:
        perception = noisy_perception("poor")
        perception.begin_stage(scene)
        return perception.perceive(frames)[0]

    a, b = told(rounds[0]), told([rounds[0][0], rounds[1][1], rounds[0][2]])
    assert a.detections.labels == b.detections.labels
    assert (a.detections.masks == b.detections.masks).all()
    assert (a.depth_m == b.depth_m).all()


def test_seeds_differ() -> None:
    labels = [[p.detections.labels for _, _, p in seen(noisy_perception("poor"), seed)] for seed in (1, 1, 2)]
    assert labels[0] == labels[1]
    assert labels[0] != labels[2]


def test_detections_do_not_depend_on_how_instances_are_numbered() -> None:
    scene, rounds = views()[0]
    order = np.random.default_rng(4).permutation(len(scene.objects))
    number_of = np.zeros(len(order) + 1, np.int32)
    number_of[order + 1] = np.arange(len(order)) + 1
    renumbered = [[replace(f, instances=number_of[f.instances]) for f in frames] for frames in rounds]
    told = []
    for objects, of in ((scene.objects, rounds), ([scene.objects[i] for i in order], renumbered)):
        perception = noisy_perception("poor")
        perception.begin_stage(replace(scene, objects=objects))
        told.append([one.detections for frames in of for one in perception.perceive(frames)])
    for a, b in zip(*told, strict=True):
        assert (a.masks == b.masks).all()
        assert a.labels == b.labels
        assert np.array_equal(a.features, b.features)  # type: ignore[arg-type]
        firsts = [int(np.flatnonzero(a.masks == number)[0]) for number in range(len(a.labels))]
        assert firsts == sorted(firsts), "numbered by first pixel"


def test_a_percept_names_no_object() -> None:
    ids = {body.id for scene, _ in views() for body in scene.objects}
    told = " ".join(repr(percept) for _, _, percept in seen(noisy_perception("poor")))
    assert not any(f"'{one}'" in told for one in ids)


def test_drift_grows_with_the_root_of_the_way_until_it_is_pulled_back() -> None:
    draws = np.random.default_rng(2)

    def errors(**parameters: float) -> np.ndarray:
        ends = []
        for _ in range(400):
            drift = PoseDrift(NoiseConfig(**parameters))  # type: ignore[arg-type]
            for step in range(41):
                pose = Pose(0.5 * step, 0.9, 0.0, 0.1 * step)
                drift.move(pose, draws.standard_normal(3))
            believed = drift.believed(pose)
            ends.append((believed.x_m - pose.x_m, believed.z_m - pose.z_m, believed.yaw_rad - pose.yaw_rad))
        return np.std(ends, axis=0)

    free = errors(drift_m_per_sqrt_m=0.05, drift_rad_per_sqrt_m=0.01, drift_rad_per_sqrt_rad=0.02)
    expected = [0.05 * math.sqrt(20), 0.05 * math.sqrt(20), math.sqrt(0.01**2 * 20 + 0.02**2 * 4)]
    assert np.allclose(free, expected, rtol=0.15)
    pulled = errors(drift_m_per_sqrt_m=0.05, drift_pull_m=2.0)
    assert np.allclose(pulled[:2], 0.05, rtol=0.2)  # sigma times the root of half the pull
    assert pulled[2] == 0.0


def test_drift_is_one_for_all_views_of_a_round_and_goes_on_over_stages() -> None:
    scene, rounds = views()[0]
    perception = noisy_perception("perfect", drift_m_per_sqrt_m=0.1)
    offsets = []
    for stage in (1, 2):
        perception.begin_stage(replace(scene, goal=replace(scene.goal, stage=stage)))
        for frames in rounds:
            told = perception.perceive(frames)
            moved = {
                (round(p.pose.x_m - f.pose.x_m, 9), round(p.pose.z_m - f.pose.z_m, 9))
                for f, p in zip(frames, told, strict=True)
            }
            assert len(moved) == 1
            offsets.append(moved.pop())
    assert offsets[0] == (0.0, 0.0)
    assert len(set(offsets)) == len(offsets)


def test_depth_errs_with_range() -> None:
    errors: dict[bool, list[float]] = {True: [], False: []}
    for _, frame, percept in seen(NoisyPerception(NoiseConfig(depth_sigma_per_m=0.002, depth_range_m=5.0))):
        assert not np.isnan(percept.depth_m).any()
        assert np.isinf(percept.depth_m[frame.depth_m > 5.0]).all()
        for is_far in (True, False):
            chosen = np.isfinite(percept.depth_m) & ((frame.depth_m > 3.0) == is_far)
            scale = frame.depth_m[chosen] ** 2 * 0.002
            error_m = percept.depth_m[chosen] - frame.depth_m[chosen]
            errors[is_far] += (error_m / scale)[::50].tolist()
    for drawn in errors.values():
        assert abs(np.std(drawn) - 1.0) < 0.05


def test_records_of_perfect_perception_are_the_truths(tmp_path: Path) -> None:
    exact, perfect, poor = (
        bundled_run(tmp_path / word, ["fu"], Backend(perception=parse_perception(word)), max_rounds=6)
        for word in ("gt", "noisy:perfect", "noisy:poor")
    )
    assert perfect == exact != poor
    assert len(poor) >= 3
