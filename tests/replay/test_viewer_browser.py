"""The viewer's pages in headless Chromium: they load without errors, and every control does what it says."""

import itertools
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from browser import XSS_CORPUS, needs_browser, probed
from command_line import command

from evonav.replay.pages import write_episode
from evonav.replay.replay import RunReplay
from evonav.replay.types import ReplayedStage
from evonav.report.maps.stage_map import page_name
from evonav.tasks.listing import BUNDLED_TASKS

PROBE = (Path(__file__).parent / "viewer_probe.js").read_text("utf-8")

pytestmark = needs_browser


@pytest.fixture(scope="module")
def pages(viewed_run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages by agent: one that is shown images, and one that tells nothing."""
    path = tmp_path_factory.mktemp("view")
    command("view", viewed_run, "--out", path)
    return {agent: next(path.glob(f"*_{agent}.html")) for agent in ("fu", "random-walk")}


@pytest.mark.slow
@pytest.mark.parametrize("size", ["1280,800", "420,900"])
def test_every_round_can_be_gone_to_and_fills_its_panels(pages: dict[str, Path], tmp_path: Path, size: str) -> None:
    found = probed(pages["fu"], PROBE, tmp_path, size)
    assert found["errors"] == []
    rounds = found["rounds"]
    text = pages["fu"].read_text("utf-8")
    stages = json.loads(re.findall(r'id="data">(.*?)</script>', text, re.DOTALL)[0])["stages"]
    assert len(rounds) == 3 * len(stages)
    for index, (stage, first, middle, last) in enumerate(
        zip(stages, rounds[::3], rounds[1::3], rounds[2::3], strict=True)
    ):
        num = len(stage["rounds"])
        for at, shown in ((0, first), ((num - 1) // 2, middle), (num - 1, last)):
            assert shown["where"] == f"round {at + 1} of {num} (budget 9)"
            assert shown["hash"] == f"#stage={index + 1}&round={at + 1}"
            assert shown["slider"] == at
            assert shown["stage"].startswith(f"Stage {index + 1}")
            held = stage["rounds"][at]
            assert shown["goal"] == stage["goal"]
            assert shown["choice"] == held["choice"]
            assert shown["truth"] == held.get("truth", "")
            assert shown["entries"] == shown["memory"] == held["n"][0]
            assert shown["frontiers"] == held["n"][1]
            assert shown["way"] == at
            assert shown["views"] == len(held["v"]) - 1
            assert shown["cones"] == len(held["v"])
            assert shown["agent"].startswith(f"translate({held['p'][0]} {held['p'][1]})")
            assert shown["chips"] == [question[1] for question in held.get("q", [])]
            assert bool(shown["prompts"]) == ("q" in held)
            assert shown["candidates"] <= len(held.get("cand", []))
            assert shown["questions"]
            assert shown["counters"]
            assert shown["cells"] > 200
            assert shown["images"]
            assert shown["overflow"] <= 0
            assert shown["bold"] == 0
            assert (shown["untold"], shown["toggles"]) == (False, 3)
            assert shown["terminal"] == (at == num - 1)
    assert any(shown["stale"] for shown in rounds)
    last_stage = len(stages[-1]["rounds"])
    assert (found["left"], found["home"], found["right"]) == (last_stage - 2, 0, 1)
    assert found["before"].startswith(f"Stage {len(stages) - 1}")
    assert found["played"] >= 1
    assert found["linked"].startswith("round 2 of ")
    assert (found["starsHidden"], found["stars"] > 0) == (0, True)
    assert all(found[name] for name in ("closeUp", "whole", "labels", "alts"))


@pytest.mark.slow
def test_an_agent_that_tells_nothing_has_a_page_too(pages: dict[str, Path], tmp_path: Path) -> None:
    found = probed(pages["random-walk"], PROBE, tmp_path)
    assert found["errors"] == []
    assert all(shown["images"] and shown["entries"] == 0 and shown["cells"] == 0 for shown in found["rounds"])
    assert all(shown["agent"] for shown in found["rounds"])
    assert all(shown["untold"] and shown["knows"] and shown["toggles"] == 0 for shown in found["rounds"])


@pytest.fixture(scope="module")
def traced(viewed_run: Path) -> list[ReplayedStage]:
    task_id = sorted(path.name for path in BUNDLED_TASKS.iterdir() if path.is_dir())[1]
    return list(RunReplay(viewed_run, lambda name: BUNDLED_TASKS / name).episode("fu", task_id))


@pytest.mark.slow
def test_no_answer_of_a_model_becomes_a_script(traced: list[ReplayedStage], tmp_path: Path) -> None:
    texts = itertools.cycle(XSS_CORPUS)
    stages = []
    for stage in traced:
        rounds = []
        for step in stage.rounds:
            asked = tuple(
                replace(
                    question,
                    answer=next(texts),
                    kind=next(texts),
                    parts=((next(texts), next(texts)), ("user", next(texts))),
                )
                for question in step.questions * 4
            )
            record = None
            if step.record is not None:
                changes = {"choice": next(texts), "details": {next(texts): next(texts)}}
                record = step.record.model_copy(update=changes)
            rounds.append(replace(step, questions=asked, record=record, note=next(texts)))
        goal = stage.record.goal.model_copy(update={"instruction": next(texts)})
        changes = {"goal": goal, "stop_reason": next(texts)}
        stages.append(replace(stage, rounds=tuple(rounds), record=stage.record.model_copy(update=changes)))
    (page,) = write_episode(stages, tmp_path / "view", budget=9, success_radius_m=2.0)
    assert page.href == page_name(page.task_id, "fu")
    found = probed(tmp_path / "view" / page.href, PROBE, tmp_path)
    assert found["errors"] == []
    assert len(found["rounds"]) == 3 * len(stages)
    assert any(shown["chips"] for shown in found["rounds"])
    assert found["handlers"] == []
