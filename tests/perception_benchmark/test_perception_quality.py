"""A report of perceptions tells of known errors what they are, and of ground truth that there are none."""

import csv
import json
import math
import shutil
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.component import Component
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.run.components import Backend
from evonav.perception.shorthand import GROUND_TRUTH
from evonav.perception_benchmark.benchmark import PerceptionSpec, TourConfig, measure
from evonav.perception_benchmark.page import write_perception_report
from evonav.perception_benchmark.records import read_records, record_path
from evonav.perception_benchmark.scores import differences, scores
from evonav.perception_benchmark.tables import perception_tables
from evonav.perception_benchmark.tour import tour
from evonav.tasks.listing import BUNDLED_TASKS, task_files

SPECS = [
    PerceptionSpec("gt", Component(GROUND_TRUTH)),
    *(
        PerceptionSpec(name, Component(f"erring_perceptions:{name}"))
        for name in ("missing_a_third", "confusing", "deep")
    ),
]
CONFIG = TourConfig(views_per_room=6, num_houses=2)


@pytest.fixture(scope="module")
def tasks():
    every = task_files(BUNDLED_TASKS)
    sizes = {task.task_id: (task.path / "houses" / "stage_1.json.gz").stat().st_size for task in every}
    return sorted(every, key=lambda task: sizes[task.task_id])[:3]


@pytest.fixture(scope="module")
def folder(tasks, tmp_path_factory):
    out = tmp_path_factory.mktemp("perceptions")
    news = []
    done, failures = measure(
        SPECS, tasks, out, config=CONFIG, num_workers=0, on_progress=lambda *said: news.append(said)
    )
    assert failures == []
    assert len(done) == 3
    assert [said[:2] for said in news] == [(i, 12) for i in range(13)]
    return out


@pytest.fixture(scope="module")
def found(folder):
    return {one.perception: one for one in scores(read_records(folder))}


def values(measures, *names):
    return [measures[name].value for name in names]


def test_ground_truth_is_perfect(found):
    gt = found["gt"]
    names = ("ap50", "ap", "ap50_located", "precision", "recall", "f1", "located", "labelled", "iou")
    assert values(gt.overall, *names) == [1.0] * 9
    assert gt.overall["recall"].ci95 is None  # houses agree
    assert values(gt.overall, "ece", "depth_relative", "depth_rmse_m", "depth_lost", "pose_offset_m") == [0.0] * 5
    assert values(gt.memory, "memory_precision", "wrong_label", "phantoms") == [1.0, 0.0, 0.0]
    assert gt.memory["position_error_m"].value < 0.3
    assert gt.confusions == []
    assert gt.unexplained == []
    assert list(gt.precision_curve) == [1.0] * 101
    for groups in gt.groups.values():
        assert {group["recall"].value for group in groups.values()} <= {1.0, None}
        assert sum(group["recall"].n for group in groups.values()) == gt.overall["recall"].n


def test_a_known_miss_rate_is_told(found):
    gt, erring = found["gt"], found["missing_a_third"]
    recall = erring.overall["recall"]
    assert recall.n == gt.overall["recall"].n > 100
    assert abs(recall.value - 2 / 3) < 3 * math.sqrt(2 / 9 / recall.n)
    assert recall.ci95[0] <= 2 / 3 <= recall.ci95[1]
    assert values(erring.overall, "precision", "labelled", "iou") == [1.0, 1.0, 1.0]
    assert erring.overall["located"].value == recall.value
    # All confidences are the same, and so the curve is flat up to the recall of each category.
    assert erring.overall["ap50"].value == pytest.approx(
        np.mean([math.floor(100 * g["recall"].value + 1e-9) + 1 if g["recall"].value else 0
                 for g in erring.groups["category"].values()]) / 101
    )  # fmt: skip
    assert erring.overall["ece"].value == pytest.approx(0.25)
    assert erring.memory["memory_recall"].value < gt.memory["memory_recall"].value


def test_a_known_confusion_is_told(found):
    gt, erring = found["gt"], found["confusing"]
    tables = gt.groups["category"]["DiningTable"]["recall"].n
    assert [(each.category, each.label, each.num) for each in erring.confusions] == [("DiningTable", "Desk", tables)]
    assert erring.confusions[0].share.value == 1.0
    assert values(erring.groups["category"]["DiningTable"], "recall", "located", "labelled", "ap50") == [
        0.0,
        1.0,
        0.0,
        0.0,
    ]
    num = erring.overall["recall"].n
    assert erring.overall["recall"].value == pytest.approx(1 - tables / num)
    assert erring.overall["precision"].value == pytest.approx(1 - tables / num)
    assert erring.overall["ap50_located"].value == 1.0
    assert erring.memory["wrong_label"].value > 0
    assert erring.memory["memory_precision"].value < 1.0


def test_errors_of_depth_and_pose_are_told(found):
    erring = found["deep"]
    assert erring.overall["depth_relative"].value == pytest.approx(0.1, abs=1e-4)
    assert erring.overall["pose_offset_m"].value == pytest.approx(0.25, abs=1e-4)
    assert erring.overall["pose_turn_deg"].value == pytest.approx(0.0, abs=1e-3), "a full turn is none"
    assert erring.overall["recall"].value == 1.0
    near, far = (erring.depth[name]["depth_rmse_m"].value for name in ("0-1 m", "3.5-6 m"))
    assert near < 0.1
    assert 0.35 < far < 0.6
    assert erring.memory["position_error_m"].value > found["gt"].memory["position_error_m"].value + 0.15
    assert erring.memory["memory_precision"].value < 1.0


def test_features_are_compared_by_what_they_are_of(found):
    assert found["gt"].cosines == {}
    erring = found["deep"]
    assert values(erring.overall, "cosine_same_object", "cosine_text_own") == pytest.approx([1.0, 1.0])
    assert erring.overall["cosine_other"].value < 0.5
    assert erring.overall["cosine_text_other"].value < 0.5


def test_differences_are_of_the_same_houses_in_every_resample(folder, found):
    records = read_records(folder)
    twice = scores({"once": records["missing_a_third"], "again": records["missing_a_third"]})
    same = differences(twice)["again", "once"]
    assert {each.value for each in same.values()} == {0.0}
    assert {each.ci95 for each in same.values()} == {None}  # of one alone they are not
    assert twice[0].overall["recall"].ci95[0] < twice[0].overall["recall"].ci95[1]
    pairs = differences(list(found.values()))
    assert len(pairs) == 6
    less_truth = pairs["missing_a_third", "gt"]["recall"]
    assert less_truth.value == pytest.approx(found["missing_a_third"].overall["recall"].value - 1)
    assert less_truth.ci95 == pytest.approx([e - 1 for e in found["missing_a_third"].overall["recall"].ci95])


def test_what_has_moved_makes_entries_stale(folder, found):
    records = read_records(folder)
    assert any(len(one.stages) == 2 for one in records["gt"])
    # What was never right is not stale: tables told as desks.
    for one in (*records["gt"], *records["confusing"]):
        begun = next((s for s in one.memory if s.stage != one.stages[0] and s.num_views == 0), None)
        last = [s for s in one.memory if s.stage == one.stages[0]][-1]
        assert last.num_stale == 0
        assert last.share == 1.0
        if begun is not None:
            assert begun.num_entries == last.num_entries
            assert begun.num_stale == last.num_right - begun.num_right
    assert found["gt"].memory["stale_at_start"].n > 0


def test_rows_add_up(folder):
    for records in read_records(folder).values():
        for record in records:
            truths, detections = record.truths, record.detections
            for mine, theirs in ((truths.found, detections.found), (truths.located, detections.located)):
                pairs = {(t, d) for t, d in enumerate(mine) if d >= 0}
                assert pairs == {(t, d) for d, t in enumerate(theirs) if t >= 0}
                for t, d in pairs:
                    assert (truths.view[t], truths.stage[t]) == (detections.view[d], detections.stage[d])
            for t, d in enumerate(truths.found):
                assert d < 0 or detections.label[d] == truths.category[t]


@pytest.mark.slow
def test_workers_change_nothing_and_what_is_there_is_not_done_again(folder, tasks, tmp_path):
    measure(SPECS[1:3], tasks[:2], tmp_path, config=CONFIG, num_workers=2)
    again = []
    measure(SPECS[1:3], tasks[:2], tmp_path, config=CONFIG, on_progress=lambda *said: again.append(said))
    assert again == [(4, 4, "")]
    for spec in SPECS[1:3]:
        for task in tasks[:2]:
            mine, theirs = (record_path(place, spec.name, task.task_id).read_bytes() for place in (tmp_path, folder))
            assert mine == theirs


def test_tours_are_walks_through_every_room_and_the_same_each_time(tasks):
    backend = Backend()
    case, simulator = backend.tasks.create(tasks[0].path), backend.simulator.create()

    def places(seed):
        simulator.reset(case.stages[0].house_json, case.start)
        return tour(case, 1, simulator, views_per_room=12, seed=seed)

    found = places(0)
    assert found == places(0) != places(1)
    assert len({(p.x_m, p.z_m) for views in found for p in views}) == len(found) >= 4
    assert all(simulator.is_free(views[0].position_m) for views in found)
    turns = [math.remainder(b.yaw_rad - a.yaw_rad, math.tau) for views in found for a, b in pairwise(views)]
    assert np.allclose(turns, math.radians(60))


def test_a_perception_that_fails_leaves_the_others_whole(tasks, tmp_path):
    specs = [SPECS[0], PerceptionSpec("breaking", Component("erring_perceptions:breaking"))]
    done, failures = measure(specs, tasks[:1], tmp_path, config=CONFIG, num_workers=0)
    assert done == []
    assert failures == [("breaking", tasks[0].task_id, "RuntimeError: out of memory")]
    assert record_path(tmp_path, "gt", tasks[0].task_id).exists()
    with pytest.raises(StoreError, match="no task has a record of every perception"):
        scores(read_records(tmp_path))


def test_mistakes_are_named(folder, tasks, tmp_path):
    with pytest.raises(InvalidArgumentError, match="no perception"):
        measure([], tasks, tmp_path)
    with pytest.raises(InvalidArgumentError, match="named twice: gt, gt"):
        measure([SPECS[0], SPECS[0]], tasks, tmp_path)
    with pytest.raises(InvalidArgumentError, match="cannot be imported"):
        measure([PerceptionSpec("mine", Component("no_such:thing"))], tasks, tmp_path)
    with pytest.raises(InvalidArgumentError, match="views_per_room = 0"):
        TourConfig(views_per_room=0)
    with pytest.raises(StoreError, match=r"tour[.]seed: there 0, asked 1"):
        measure(SPECS[:1], tasks, folder, config=TourConfig(6, 2, 1))
    other = PerceptionSpec("deep", Component("erring_perceptions:confusing"))
    with pytest.raises(StoreError, match=r"deep[.]make"):
        measure([other], tasks, folder, config=CONFIG)
    with pytest.raises(StoreError, match=r"holds no perception[.]json"):
        read_records(tmp_path / "nothing")
    shutil.copytree(folder, tmp_path / "copy")
    damaged = record_path(tmp_path / "copy", "gt", tasks[0].task_id)
    damaged.write_bytes(damaged.read_bytes()[:-9])
    with pytest.raises(StoreError, match=r"[.]json[.]gz: cannot be read"):
        read_records(tmp_path / "copy")


def test_files_tell_the_same_as_the_scores(folder, found, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    page, shown = write_perception_report(tmp_path / "copy")
    assert [one.perception for one in shown] == [spec.name for spec in SPECS]
    told = json.loads((tmp_path / "copy" / "summary.json").read_text())["perceptions"]
    assert [one["overall"]["recall"]["value"] for one in told] == [one.overall["recall"].value for one in shown]
    rows = list(csv.DictReader((tmp_path / "copy" / "summary.csv").read_text().splitlines()))
    recalls = [row for row in rows if row["measure"] == "recall" and row["by"] == ""]
    assert [float(row["value"]) for row in recalls] == [one.overall["recall"].value for one in shown]
    assert Counter(row["by"] for row in rows)["distance"] == 4 * 5 * 6
    gaps = json.loads((tmp_path / "copy" / "summary.json").read_text())["differences"]
    assert [(gap["perception"], gap["less"]) for gap in gaps[:2]] == [("missing_a_third", "gt"), ("confusing", "gt")]
    lesser = [row for row in rows if row["by"] == "less" and row["measure"] == "recall"]
    assert [float(row["value"]) for row in lesser] == [gap["recall"]["value"] for gap in gaps]
    text = page.read_text()
    assert "confusing minus missing_a_third" in text
    assert text.count("data:image/jpeg;base64,") == 4 * 3
    brief, full = (perception_tables(shown, is_brief=brief) for brief in (True, False))
    assert [table.title for table in brief] == [table.title for table in full]
    assert all(len(row) == len(table.columns) for table in full for row in table.rows)


def test_the_command(tasks, tmp_path):
    for task in tasks[:1]:
        shutil.copytree(task.path, tmp_path / "tasks" / task.task_id)
    words = ["perception", "--tasks", str(tmp_path / "tasks"), "--out", str(tmp_path / "out"), "--workers", "0"]
    words += ["--views-per-room", "6", "--houses-per-task", "1"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "What perceptions find" in result.output
    assert "report.html" in result.output
    broken = CliRunner().invoke(app, [*words, "--perception", "erring_perceptions:breaking"])
    assert broken.exit_code == 3
    assert "out of memory" in broken.output
    useless = CliRunner().invoke(app, [*words, "--set", "perception.device=cpu"])
    assert useless.exit_code == 2
    assert "--perception predicted" in useless.output
    unknown = CliRunner().invoke(app, [*words, "--perception", "nosy"])
    assert isinstance(unknown.exception, InvalidArgumentError)
    assert "did you mean noisy?" in str(unknown.exception)


def test_weights_are_the_same_for_all_records(tasks, tmp_path, monkeypatch):
    spec = PerceptionSpec("weighted", Component("erring_perceptions:weighted"))
    measure([spec], tasks[:1], tmp_path, config=CONFIG, num_workers=0)
    assert json.loads((tmp_path / "perception.json").read_text())["models"] == {"weighted": {"weights": "one"}}
    monkeypatch.setattr("erring_perceptions.Weighted.version", "two")
    measure([spec], tasks[:1], tmp_path, config=CONFIG, num_workers=0)  # nothing to look at
    with pytest.raises(StoreError, match="there 'one', asked 'two'"):
        measure([spec], tasks[:2], tmp_path, config=CONFIG, num_workers=0)
