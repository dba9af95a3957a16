import json
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from statistics import fmean, median

import pytest
from generated_tasks import generated_tasks
from html_page import HtmlPage
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.generation.dataset import generate_dataset
from evonav.generation.statistics.compute import statistics_of, statistics_of_folders
from evonav.generation.statistics.metrics import METRICS, PAPER_EVOLUTIONS
from evonav.generation.statistics.task_summary import TaskSummary, expected_evolutions, read_summaries, summary_of
from evonav.house import bundled_houses
from evonav.report.plots.render import check_plot
from evonav.report.tasks.dataset_page import write_dataset_report, write_statistics_plot
from evonav.tasks import Task, load_tasks
from evonav.tasks.records import parse_record
from evonav.tasks.statistics import TaskStatistics


def summary_of_task(task: Task) -> TaskSummary:
    return summary_of(task.header, task.oracle_stages, task.public_stages, task.house_json(1))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tasks of 16 houses, and a house whose doors lead nowhere."""
    folder = tmp_path_factory.mktemp("tasks")
    houses = [house.to_json() for house in bundled_houses(16)]
    alone = json.loads(houses[0])
    alone["rooms"] = alone["rooms"][:1]
    source = folder / "houses.jsonl"
    source.write_text("\n".join([*houses, json.dumps(alone)]))
    generate_dataset(source, folder / "made")
    return folder / "made"


@pytest.fixture(scope="module")
def tasks(folder: Path) -> list[Task]:
    return list(load_tasks(folder))


@pytest.fixture(scope="module")
def found(tasks: list[Task]) -> TaskStatistics:
    return statistics_of(map(summary_of_task, tasks), mix="procthor-10k")


def value_of(found: TaskStatistics, key: str) -> float:
    raw = found.metric(key).raw
    assert raw is not None
    return raw.value


def test_metrics_are_what_a_plain_count_says(tasks: list[Task], found: TaskStatistics) -> None:
    later = [(task, stage) for task in tasks for stage in task.oracle_stages if stage.stage > 1]
    evolved = [(task, stage) for task, stage in later if stage.evolution.outcome == "evolved"]
    assert (found.num_tasks, found.num_houses) == (len(tasks), len(tasks))
    assert found.num_stages == len(later) + len(tasks)
    counts = Counter(sum(s.evolution.outcome == "evolved" for s in task.oracle_stages) for task in tasks)
    assert value_of(found, "evolved_once") == pytest.approx(1 - counts[0] / len(tasks))
    assert value_of(found, "evolved_twice") == pytest.approx(1 - (counts[0] + counts[1]) / len(tasks))
    assert value_of(found, "static") == pytest.approx(1 - len(evolved) / len(later))
    moved_before = [
        any(
            change.id == stage.target.id and change.is_relocated
            for earlier in task.oracle_stages[: stage.stage]
            for change in earlier.evolution.changes
        )
        for task, stage in later
    ]
    assert value_of(found, "goal_relocated") == pytest.approx(fmean(moved_before))
    assert found.metric("goal_relocated").n == len(later)
    moved_now = [
        any(change.id == stage.target.id and change.is_relocated for change in stage.evolution.changes)
        for _, stage in evolved
    ]
    assert value_of(found, "goal_moved") == pytest.approx(fmean(moved_now))
    in_room = [stage.target.room_id == stage.evolution.room_id for _, stage in evolved]
    assert value_of(found, "goal_in_changed_room") == pytest.approx(fmean(in_room))
    ratios = []
    for task in tasks:
        moved = {c.id for stage in task.oracle_stages for c in stage.evolution.changes if c.is_relocated}
        ratios.append(len(moved) / task.header.house.num_objects)
    assert value_of(found, "relocated_ratio") == pytest.approx(median(ratios))
    assert value_of(found, "ratio_zero") == pytest.approx(sum(ratio == 0 for ratio in ratios) / len(ratios))
    assert value_of(found, "num_stages") == pytest.approx(fmean(task.num_stages for task in tasks))
    assert value_of(found, "goals_refused") == pytest.approx(
        fmean(len(stage.rejections) for task in tasks for stage in task.oracle_stages)
    )
    pairs = [
        (before.evolution, after.evolution)
        for task in tasks
        for before, after in zip(task.oracle_stages, task.oracle_stages[1:], strict=False)
        if before.evolution.outcome == after.evolution.outcome == "evolved"
    ]
    assert found.metric("room_again").n == len(pairs) > 3
    assert value_of(found, "room_again") == pytest.approx(fmean(a.room_id == b.room_id for a, b in pairs))
    again = [stage.target.room_id == task.oracle_stages[stage.stage - 2].target.room_id for task, stage in later]
    assert value_of(found, "goal_room_again") == pytest.approx(fmean(again))


def test_distributions_and_quantities_are_what_a_plain_count_says(tasks: list[Task], found: TaskStatistics) -> None:
    stages = [stage for task in tasks for stage in task.oracle_stages]
    modes = found.distribution("modes")
    assert modes is not None
    told = Counter(stage.evolution.mode for stage in stages if stage.evolution.outcome == "evolved")
    assert dict(zip(modes.names, modes.counts, strict=True)) == {name: told[name] for name in modes.names}
    goals = found.distribution("goal_categories")
    assert goals is not None
    assert dict(zip(goals.names, goals.counts, strict=True)) == Counter(stage.target.category for stage in stages)
    assert list(goals.counts) == sorted(goals.counts, reverse=True)
    ratio = found.distribution("relocated_ratio")
    assert ratio is not None
    assert sum(ratio.counts) == len(tasks)
    assert ratio.counts[0] == sum(not stage.ever_relocated_ids for stage in (t.oracle_stages[-1] for t in tasks))
    path = found.quantity("path_m")
    assert path is not None
    assert (path.n, path.quantiles[3]) == (
        len(stages),
        pytest.approx(median(stage.reference_path_length_m for stage in stages)),
    )
    far = found.quantity("reference_distance_m")
    assert far is not None
    assert 1.0 - 1e-6 <= far.quantiles[0] <= far.quantiles[-1] <= 1.5 + 1e-6
    for measure in found.metrics:
        if measure.raw is not None and measure.raw.ci95 is not None:
            low, high = measure.raw.ci95
            assert low - 1e-9 <= measure.raw.value <= high + 1e-9, measure


def test_reweighted_figures_are_weighted_means_by_hand(tasks: list[Task], found: TaskStatistics) -> None:
    assert found.weighting is not None
    assert found.weighting.by == "number of rooms"
    rooms = Counter(task.header.house.num_rooms for task in tasks)
    mix = {2: 4, 3: 2, 4: 5, 5: 2, 6: 1, 7: 1, 8: 1, 10: 2}
    weights = [mix.get(t.header.house.num_rooms, 0) / rooms[t.header.house.num_rooms] for t in tasks]
    for key, above, below in (
        ("evolved_twice", lambda t: sum(s.evolution.outcome == "evolved" for s in t.oracle_stages) >= 2, lambda t: 1),
        (
            "goal_relocated",
            lambda t: sum(s.target.is_relocated_ever for s in t.oracle_stages[1:]),
            lambda t: t.num_stages - 1,
        ),
    ):
        by_hand = sum(w * above(t) for w, t in zip(weights, tasks, strict=True)) / sum(
            w * below(t) for w, t in zip(weights, tasks, strict=True)
        )
        reweighted = found.metric(key).reweighted
        assert reweighted is not None
        assert reweighted.value == pytest.approx(by_hand)
    assert found.weighting.effective_num_tasks == pytest.approx(sum(weights) ** 2 / sum(w * w for w in weights))
    assert found.weighting.covered_share == pytest.approx(sum(mix[n] for n in rooms if n in mix) / 18)
    evolutions = found.distribution("num_evolutions")
    assert evolutions is not None
    assert evolutions.reweighted_shares is not None
    assert sum(evolutions.reweighted_shares) == pytest.approx(1)


def test_tasks_of_one_house_count_as_one_unit() -> None:
    """Ten copies of each task tell no more than one: the interval stays, and Wilson's no longer holds."""
    summaries = [summary_of_task(task) for task in generated_tasks(bundled_houses(12), 1)]
    once, often = statistics_of(summaries), statistics_of(summaries * 10)
    assert (often.num_tasks, often.num_houses) == (10 * once.num_tasks, once.num_houses)
    assert once.metric("goal_relocated").raw == often.metric("goal_relocated").raw
    assert once.metric("evolved_twice").interval == "wilson"
    assert often.metric("evolved_twice").interval == "bootstrap"


def test_moved_now_is_told_from_moved_ever() -> None:
    """Many seeds of few houses: among the goals after a change are some that only an earlier change moved."""
    small = sorted(bundled_houses(16), key=lambda house: len(house.objects))[:4]
    made = [task for seed in range(8) for task in generated_tasks(small, seed)]
    found = statistics_of(map(summary_of_task, made))
    evolved = [s for task in made for s in task.oracle_stages if s.evolution.outcome == "evolved"]
    moved_now = [any(c.id == s.target.id and c.is_relocated for c in s.evolution.changes) for s in evolved]
    assert fmean(moved_now) < fmean(s.target.is_relocated_ever for s in evolved)
    assert value_of(found, "goal_moved") == pytest.approx(fmean(moved_now))
    assert (found.num_tasks, found.num_houses, found.seeds) == (len(made), 4, tuple(range(8)))


def test_the_expected_evolutions_are_the_papers() -> None:
    assert expected_evolutions((3, 4, 5), 0.5) == pytest.approx(PAPER_EVOLUTIONS, abs=1e-4)
    assert expected_evolutions((2,), 0.3) == pytest.approx((0.7, 0.3))


def test_folders_give_what_tasks_in_memory_give(tasks: list[Task], folder: Path, found: TaskStatistics) -> None:
    told: list[tuple[int, int]] = []
    read = statistics_of_folders([folder], mix="procthor-10k", on_task=lambda done, total: told.append((done, total)))
    assert read.metrics == found.metrics
    assert told[-1] == (len(tasks), len(tasks))
    houses = read.distribution("house_rejections")
    assert houses is not None
    assert (houses.names, houses.counts) == (("malformed_house",), (1,))
    roots = sorted(path.parent for path in folder.glob("*/task.json")) * 3
    assert list(read_summaries(roots, num_workers=2)) == list(read_summaries(roots))


def test_what_is_wrong_is_named(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="holds no task"):
        statistics_of_folders([tmp_path])
    with pytest.raises(TaskError, match="no task"):
        statistics_of([])
    with pytest.raises(InvalidArgumentError, match="reweight"):
        statistics_of_folders([folder], mix="mansions")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad/task.json").write_text('{"task_id": 3}')
    with pytest.raises(TaskError, match=r"bad/task\.json: task_id = 3"):
        statistics_of_folders([tmp_path])
    good = sorted(path.parent for path in folder.glob("*/task.json"))[:1] * 40
    with pytest.raises(TaskError, match=r"bad/task\.json: task_id = 3"):
        list(read_summaries([*good, tmp_path / "bad"], num_workers=2))
    with pytest.raises(InvalidArgumentError, match=r"\.png"):
        check_plot(Path("plot.bmp"))


@pytest.mark.slow
def test_the_page_nests_and_the_plots_are_xml(found: TaskStatistics, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="evonav[viz] is not installed")
    page = write_dataset_report(found, tmp_path)
    text = page.read_text(encoding="utf-8")
    HtmlPage(text)
    for measure in found.metrics:
        if measure.raw is not None:
            assert f"<td>{measure.label.replace(chr(39), '&#39;')}</td>" in text
    svg = ET.fromstring((tmp_path / "statistics.svg").read_text(encoding="utf-8"))
    marks = [node for node in svg.iter("{http://www.w3.org/2000/svg}title") if ", the paper: " in (node.text or "")]
    assert len(marks) == 5 + 2
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "")
    data = tmp_path / "statistics.json"
    assert parse_record(TaskStatistics, data.read_bytes(), data) == found
    first = page.read_bytes()
    assert write_dataset_report(found, tmp_path).read_bytes() == first


def test_matplotlib_draws_the_papers_figure(found: TaskStatistics, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="evonav[viz] is not installed")
    for suffix, start in ((".png", b"\x89PNG"), (".pdf", b"%PDF")):
        path = write_statistics_plot(found, tmp_path / f"deep/plot{suffix}")
        data = path.read_bytes()
        assert data.startswith(start)
        assert write_statistics_plot(found, path).read_bytes() == data


def test_without_matplotlib_the_extra_is_named(
    found: TaskStatistics, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(StoreError, match=r"pip install 'evonav\[viz\]'"):
        check_plot(Path("plot.png"))
    page = write_dataset_report(found, tmp_path)
    assert page.read_text("utf-8").count("Plots need: pip install &#39;evonav[viz]&#39;") == 2
    assert not (tmp_path / "statistics.svg").exists()


@pytest.mark.slow
def test_the_command_prints_eighty_columns_and_writes_the_page(folder: Path, tmp_path: Path) -> None:
    arguments = ["tasks", "stats", str(folder), "--reweight", "procthor-10k", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, [*arguments, "--workers", "1"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert max(len(line) for line in lines if not line.startswith("report: ")) <= 80
    shown = "\n".join(lines)
    for info in METRICS:
        if info.key in ("goal_relocated", "relocated_ratio", "evolved_once", "room_again"):
            assert info.label in shown
    assert "37.9" in shown
    assert (tmp_path / "out/statistics.html").is_file()
