"""Pages of `evonav view`: what they hold is what was traced, small, self-contained, and safe."""

import base64
import json
import re
import shutil
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from command_line import command
from hypothesis import given
from hypothesis import strategies as st
from made_up_run import entry, stage_record
from PIL import Image
from typer.testing import CliRunner
from viewer_run import MARKUP

from evonav.cli import app
from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.svg import cm
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import RunStore
from evonav.replay.page_data import PageData, cells_text
from evonav.replay.pages import write_episode
from evonav.replay.replay import RunReplay
from evonav.replay.types import ReplayedEntry, ReplayedMap, ReplayedRound, ReplayedStage, Truth
from evonav.report.maps.stage_map import page_name
from evonav.report.pages.run_page import write_report
from evonav.tasks.listing import BUNDLED_TASKS


@pytest.fixture(scope="module")
def task_id(viewed_run: Path) -> str:
    with RunStore(viewed_run) as store:
        return str(*store.meta("num_stages"))


@pytest.fixture(scope="module")
def stages(viewed_run: Path, task_id: str) -> list[ReplayedStage]:
    return list(RunReplay(viewed_run, lambda name: BUNDLED_TASKS / name).episode("fu", task_id))


@pytest.fixture(scope="module")
def pages(viewed_run: Path) -> Path:
    result = command("view", viewed_run)
    assert str(viewed_run / "view" / "index.html") in result
    return viewed_run / "view"


def data_of(page: Path) -> dict:
    (text,) = re.findall(
        r'<script type="application/json" id="data">(.*?)</script>', page.read_text("utf-8"), re.DOTALL
    )
    return json.loads(text)


def decoded(text: str, before: np.ndarray) -> np.ndarray:
    """What the page's script does, once more."""
    cells, at = before.copy(), 0
    for length, letter in re.findall(r"([0-9a-z]+)([A-E])", text):
        end = at + int(length, 36)
        if letter != "E":
            cells[at:end] = "ABCD".index(letter)
        at = end
    return cells


@given(st.lists(st.lists(st.integers(0, 3), min_size=12, max_size=12), min_size=1, max_size=5))
def test_maps_come_back_from_their_runs(maps: list[list[int]]) -> None:
    before = now = np.zeros(12, np.uint8)
    for values in maps:
        cells = np.array(values, np.uint8)
        now = decoded(cells_text(cells, before), now)
        assert np.array_equal(now, cells)
        before = cells


def test_a_map_that_did_not_change_takes_no_room() -> None:
    cells = np.repeat(np.array([0, 2, 1], np.uint8), 40)
    assert cells_text(cells, cells) == ""
    assert cells_text(cells, np.zeros(120, np.uint8)) == "14E14C14B"


def test_entries_frontiers_and_maps_of_every_round_can_be_had_from_the_page(
    pages: Path, stages: list[ReplayedStage], task_id: str
) -> None:
    data = data_of(pages / page_name(task_id, "fu"))
    assert [stage["k"] for stage in data["stages"]] == [stage.record.stage for stage in stages]
    for shown, stage in zip(data["stages"], stages, strict=True):
        entries: dict[int, list] = {}
        frontiers: list = []
        counters: dict[str, int] = {}
        cells = np.zeros(0, np.uint8)
        for data_round, step in zip(shown["rounds"], stage.rounds, strict=True):
            assert data_round["p"][:2] == list(cm((step.pose.x_m, step.pose.z_m)))
            entries = {name: entry for name, entry in entries.items() if name not in data_round.get("x", ())}
            entries |= {entry[0]: entry for entry in data_round.get("e", ())}
            assert set(entries) == {entry.record.entry_id for entry in step.entries}
            for traced in step.entries:
                found = entries[traced.record.entry_id]
                assert found[2:4] == list(cm((traced.record.centre_m[0], traced.record.centre_m[2])))
                assert (found[6], bool(found[7])) == (traced.record.num_detections, traced.record.is_stale)
                if traced.record.is_stale and traced.truth is not None and traced.truth.now_m is not None:
                    assert found[9] == list(cm((traced.truth.now_m[0], traced.truth.now_m[2])))
                else:
                    assert found[9] in (None, "gone")
            frontiers = data_round.get("f", frontiers)
            assert [frontier[0] for frontier in frontiers] == [f.frontier_id for f in step.frontiers]
            counters |= data_round.get("counters", {})
            assert step.record is not None
            assert counters == step.record.counters
            assert data_round.get("cand", []) == list(step.candidate_ids)
            assert step.map is not None
            if "grid" in data_round:
                cells = np.zeros(data_round["grid"][0] * data_round["grid"][1], np.uint8)
            cells = decoded(data_round["cells"], cells)
            assert np.array_equal(cells, step.map.cells.ravel())


def made_up_round(number: int, truth: Truth | None, agent_map: ReplayedMap | None, **changes: object) -> ReplayedRound:
    chosen = entry("Plate", (2.3, 0.8, 2.0), is_stale=True)
    record = stage_record("a", "t", 2, EndState.FAILURE, chosen=chosen).trace[number].model_copy(update=changes)
    return ReplayedRound(record, record.pose, (), (ReplayedEntry(chosen, truth),), map=agent_map)


def made_up_page(rounds: list[ReplayedRound]) -> list[dict]:
    record = stage_record("a", "t", 2, EndState.FAILURE)
    page = PageData()
    page.add_stage(ReplayedStage(record, None, tuple(rounds), "", (), 1.0), {}, PlanFrame(0, 0, 900, 400), 50)
    return json.loads(page.text())["stages"][0]["rounds"]


def test_a_map_that_grows_begins_anew_and_one_that_stays_does_not() -> None:
    small = ReplayedMap(np.full((2, 3), 2, np.uint8), 0.1, (1.0, 2.0))
    large = ReplayedMap(np.array([[0, 1, 1, 1]] * 3, np.uint8), 0.1, (0.9, 1.9))
    rounds = made_up_page([made_up_round(i, None, agent_map) for i, agent_map in enumerate((small, small, large))])
    assert [step.get("grid") for step in rounds] == [[2, 3, 10.0, 100, -200], None, [3, 4, 10.0, 90, -190]]
    assert [step["cells"] for step in rounds] == ["6C", "", "1E3B1E3B1E3B"]


@pytest.mark.parametrize(
    ("truth", "now", "words"),
    [
        (None, None, "Stale: no plate ever stood here."),
        (
            Truth("plate", 1, (5.3, 0.8, 6.0)),
            [530, -600],
            "Stale: the plate that is asked for stood here in stage 1 and stands 5.0 m away now.",
        ),
        (Truth("other", 1, None), "gone", "Stale: the plate stood here in stage 1 and is no longer in the house."),
    ],
)
def test_what_became_of_a_stale_entry(truth: Truth | None, now: object, words: str) -> None:
    (step,) = made_up_page([made_up_round(0, truth, ReplayedMap(np.zeros((1, 1), np.uint8), 0.1, (0.0, 0.0)))])
    assert (step["truth"], step["e"][0][9]) == (words, now)
    assert (step["kind"], step["choice"]) == ("stale", "plate #7")


def test_a_lost_memory_is_told() -> None:
    record = stage_record("a", "t", 2, EndState.FAILURE).model_copy(update={"failed_before": (1,), "memory_lost_at": 2})
    page = PageData()
    page.add_stage(ReplayedStage(record, None, (), "", (), 1.0), {}, PlanFrame(0, 0, 900, 400), 50)
    (stage,) = json.loads(page.text())["stages"]
    told = "the agent failed in stage 1; its process was lost, and it began again, without memory, in stage 2"
    assert stage["lost"] == told


def test_what_json_cannot_say_is_still_shown() -> None:
    details = {"cost": float("inf"), "list": [float("nan"), 1], "text": "</script><b>"}
    (step,) = made_up_page([made_up_round(0, None, None, details=details)])
    assert step["details"] == {"cost": "inf", "list": ["nan", 1], "text": "</script><b>"}


def test_questions_have_their_prompt_images_and_outcome(pages: Path, stages: list[ReplayedStage], task_id: str) -> None:
    data = data_of(pages / page_name(task_id, "fu"))
    outcomes = []
    for shown, stage in zip(data["stages"], stages, strict=True):
        for data_round, step in zip(shown["rounds"], stage.rounds, strict=True):
            assert len(data_round.get("q", [])) == len(step.questions)
            for (kind, outcome, answer, prompt, offered, meaning), question in zip(
                data_round.get("q", []), step.questions, strict=True
            ):
                outcomes.append(outcome)
                assert (kind, answer) == (question.kind, question.answer)
                parts = data["prompts"][prompt]
                images = [content for _, content in question.parts if isinstance(content, bytes)]
                assert images
                shown_images = [base64.b64decode(data["images"][part]) for part in parts if isinstance(part, int)]
                assert shown_images == images
                assert [part for part in parts if isinstance(part, str)] == [
                    content for _, content in question.parts if isinstance(content, str)
                ]
                assert (offered != "") == bool(question.offered)
                assert bool(meaning) == (outcome == "answered" and bool(question.offered))
                assert not meaning or f"{answer.splitlines()[0]} is {meaning}" in offered
    assert {"answered", "refusal", "invalid"} <= set(outcomes)
    assert len(set(data["images"])) == len(data["images"])
    for image in data["images"]:
        assert Image.open(BytesIO(base64.b64decode(image))).format == "JPEG"


def test_the_evaluators_words_tell_what_became_of_the_chosen_entry(
    pages: Path, stages: list[ReplayedStage], task_id: str
) -> None:
    data = data_of(pages / page_name(task_id, "fu"))
    num_told = num_stale = 0
    for shown, stage in zip(data["stages"], stages, strict=True):
        for data_round, step in zip(shown["rounds"], stage.rounds, strict=True):
            assert step.record is not None
            chosen = step.record.chosen_entry
            assert "stale" not in data_round["choice"]
            if chosen is None:
                assert "truth" not in data_round
                continue
            num_told += 1
            num_stale += chosen.is_stale
            assert data_round["truth"].startswith("Stale: ") == chosen.is_stale
            truth = next(entry.truth for entry in step.entries if entry.record.entry_id == chosen.entry_id)
            if truth is not None and truth.object_id == stage.record.target.object_id and not chosen.is_stale:
                assert data_round["truth"].endswith("is the target.")
    assert num_told > num_stale > 0


def test_pages_are_self_contained_and_models_words_are_no_markup(pages: Path, task_id: str) -> None:
    for agent in ("fu", "random-walk"):
        text = (pages / page_name(task_id, agent)).read_text("utf-8")
        assert len(text.encode()) < 2_000_000
        # Nothing is fetched: no address but XML's name space, and the link to the index.
        assert set(re.findall(r"https?://[^\"'\s<>]+", text)) <= {"http://www.w3.org/2000/svg"}
        assert set(re.findall(r'(?:href|src)="([^"#][^"]*)"', text)) <= {"index.html"}
        assert text.count("</script>") == 2
    assert MARKUP not in (pages / page_name(task_id, "fu")).read_text("utf-8")
    index = (pages / "index.html").read_text("utf-8")
    for agent in ("fu", "random-walk"):
        assert f"{page_name(task_id, agent)}#stage=1&round=1" in index


def test_the_index_keeps_earlier_pages_and_the_report_links_to_them(
    viewed_run: Path, task_id: str, tmp_path: Path
) -> None:
    run = Path(shutil.copytree(viewed_run, tmp_path / "run", ignore=shutil.ignore_patterns("view")))
    assert ">round by round<" not in write_report(run).read_text("utf-8")
    for agent in ("random-walk", "fu"):
        command("view", run, "--agent", agent, "--task", task_id)
    index = (run / "view" / "index.html").read_text("utf-8")
    assert all(f'<a href="{page_name(task_id, agent)}">' in index for agent in ("fu", "random-walk"))
    (run / "view" / page_name(task_id, "random-walk")).unlink()

    def links(report: Path) -> list[str]:
        return re.findall(r'<a href="([^"]+)">round by round</a>', report.read_text("utf-8"))

    name = page_name(task_id, "fu")
    inside = [f"#replay={name}&amp;stage={k}&amp;round=1" for k in (1, 2, 3)]
    assert links(write_report(run)) == links(write_report(run, tmp_path / "elsewhere")) == inside
    report = write_report(run).read_text("utf-8")
    (content,) = re.findall(rf'id="replay={re.escape(name)}"[^>]*>(.*?)</script>', report)
    assert zlib.decompress(base64.b64decode(content)) == (run / "view" / name).read_bytes()
    beside = [f"view/{name}#stage={k}&amp;round=1" for k in (1, 2, 3)]
    assert links(write_report(run, max_replay_bytes=1000)) == beside
    assert links(write_report(run, tmp_path / "x", max_replay_bytes=1000))[0] == f"../run/{beside[0]}"


def test_an_agent_without_belief_has_views_and_way_alone(pages: Path, task_id: str) -> None:
    for stage in data_of(pages / page_name(task_id, "random-walk"))["stages"]:
        assert not stage["hasBelief"]
        assert not stage["tells"]
        assert all(step["v"] and "cells" not in step and "q" not in step for step in stage["rounds"])


def test_one_stage_and_pages_a_stage(
    viewed_run: Path, stages: list[ReplayedStage], task_id: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ["--task", task_id, "--agent", "fu", "--stage", "2", "--out", str(tmp_path / "a")]
    command("view", viewed_run, *asked)
    (path,) = (tmp_path / "a").glob("*_stage2.html")
    assert [stage["k"] for stage in data_of(path)["stages"]] == [2]
    monkeypatch.setattr("evonav.replay.pages.MAX_PAGE_BYTES", 1000)
    pages = write_episode(stages, tmp_path / "b", budget=9, success_radius_m=2.0)
    assert [page.href for page in pages] == [page_name(task_id, "fu", k + 1) for k in range(len(stages))]
    for number, page in enumerate(pages, start=1):
        links = re.findall(r'class="tab" href="([^"]+)"', (tmp_path / "b" / page.href).read_text("utf-8"))
        others = [k for k in range(1, len(stages) + 1) if k != number]
        assert links == [f"{page_name(task_id, 'fu', k)}#stage={k}&amp;round=1" for k in others]
    # What changed before a stage is drawn although the stage before has another page.
    changed = next(stage for stage in stages if stage.record.transition.relocations)
    text = (tmp_path / "b" / pages[changed.record.stage - 1].href).read_text("utf-8")
    assert 'class="items ghost"' in text


def test_a_replay_that_differs_is_told_on_the_page(viewed_run: Path, task_id: str, tmp_path: Path) -> None:
    with RunStore(viewed_run) as store:
        records = [
            record.model_copy(update={"stop_reason": "other"}) for record in store.records("random-walk", task_id)
        ]
        meta = {key: store.meta(key) for key in ("config", "agents", "num_stages")}
    with RunStore(tmp_path / "run", create=True) as store:
        for key, value in meta.items():
            store.set_meta(key, value)
        for record in records:
            store.add_stage(encode_stage(record, wall_s=0.0, cpu_s=0.0))
    result = command("view", tmp_path / "run", "--task", task_id, "--agent", "random-walk")
    assert "the replay differs from the records" in result
    data = data_of(tmp_path / "run" / "view" / page_name(task_id, "random-walk"))
    assert data["stages"][0]["differences"] == ['stop_reason: "other" stored, "" replayed']
    assert "replay differs from the records" in (tmp_path / "run" / "view" / "index.html").read_text("utf-8")


def test_wrong_usage_is_one_line(viewed_run: Path, tmp_path: Path) -> None:
    from evonav.errors import EvonavError

    for arguments, words in (
        (["--task", "none", "--agent", "fu"], "no record of task 'none'"),
        (["--agent", "fu", "--stage", "9"], "no record of stage 9"),
        (["--agent", "nobody"], "no task has records of nobody"),
        (["--tasks", str(tmp_path)], "name the folder of the run's tasks with --tasks"),
    ):
        result = CliRunner().invoke(app, ["view", str(viewed_run), *arguments])
        assert isinstance(result.exception, EvonavError)
        assert words in str(result.exception)
