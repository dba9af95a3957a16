"""Packed runs of every honest shape are accepted: a verifier that rejects too much would be no use."""

from pathlib import Path
from typing import Any

import pytest

from evonav.controlled.dataset import generate_controlled
from evonav.controlled.layout import ControlledOptions, tasks_of
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.house import bundled_houses
from evonav.submission.file import About, read_header
from evonav.submission.pack import pack
from evonav.submission.packed_setup import packed_setup
from evonav.submission.verify import verify
from evonav.tasks.listing import BUNDLED_TASKS, TaskFile, task_files
from evonav.tasks.parameters import GenerationParameters

MARK = "EVONAV_TEST_DIED"


@pytest.fixture(scope="module")
def tasks() -> list[TaskFile]:
    return task_files(BUNDLED_TASKS, 3)


def assert_accepted(run: Path, tasks: list[TaskFile], **options: Any) -> None:
    target = run.with_name(f"{run.name}.gz")
    pack(run, target)
    for scores_only in (True, False):
        verdict = verify(target, tasks, scores_only=scores_only, **options)
        assert verdict.is_accepted, verdict.checks
        assert [check.name for check in verdict.checks][-1] == ("scores" if scores_only else "actions")


@pytest.mark.slow
def test_several_agents_of_a_seed_of_its_own(tasks: list[TaskFile], tmp_path: Path) -> None:
    agents = ["stage-reset", "msgnav", "unigoal", "3d-mem"]
    evaluate(agents, tasks[:1], tmp_path / "run", config=RunConfig(seed=5), num_workers=0)
    assert_accepted(tmp_path / "run", tasks, limit=1)


def test_a_prefix_and_a_superset_of_what_is_required(tasks: list[TaskFile], tmp_path: Path) -> None:
    evaluate(["ftu"], tasks[:2], tmp_path / "run", num_workers=0)
    assert_accepted(tmp_path / "run", tasks, limit=2)
    assert_accepted(tmp_path / "run", tasks, limit=1)


@pytest.mark.slow
def test_a_resumed_run_of_several_workers(tasks: list[TaskFile], tmp_path: Path) -> None:
    evaluate(["fu"], tasks[:2], tmp_path / "run", num_workers=0)
    with RunStore(tmp_path / "run") as store:
        store.forget_episode("fu", tasks[1].task_id, 2)
    evaluate(["fu"], tasks[:2], tmp_path / "run", num_workers=2)
    assert_accepted(tmp_path / "run", tasks, limit=2, num_workers=2)
    assert packed_setup(read_header(tmp_path / "run.gz")).isolation == "none, process"


def test_a_retried_run_of_an_agent_that_takes_single_steps(
    tasks: list[TaskFile], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its process dies once, in the middle of an episode."""
    monkeypatch.setenv(MARK, str(tmp_path / "died"))
    agent = f"{Path(__file__).parent / 'dying_walker.py'}:DyingWalker"
    evaluate([agent], tasks[:1], tmp_path / "run", num_workers=1)
    with RunStore(tmp_path / "run") as store:
        assert [(one.kind, one.is_retried) for one in store.failures()] == [(ErrorKind.CRASH, True)]
        assert {record.sensing.motion for record in store.records() if record.sensing} == {"actions"}
    assert (tmp_path / "died").exists()
    assert_accepted(tmp_path / "run", tasks, limit=1)


def test_guided_stages(tmp_path: Path) -> None:
    options = ControlledOptions(parameters=GenerationParameters(reference_image_px=64, reference_min_visible_px=10))
    (tmp_path / "houses.jsonl").write_text("\n".join(house.to_json() for house in bundled_houses(3)) + "\n")
    generate_controlled(tmp_path / "houses.jsonl", tmp_path / "tasks", options=options)
    guided = task_files(tasks_of(tmp_path / "tasks", "evolved"), 1)
    evaluate(["ftu"], guided, tmp_path / "run", num_workers=0)
    with RunStore(tmp_path / "run") as store:
        assert [record.state is EndState.GUIDED for record in store.records()] == [True, True, False]
    assert_accepted(tmp_path / "run", guided)


def test_statements_in_any_script(tasks: list[TaskFile], tmp_path: Path) -> None:
    evaluate(["ftu"], tasks[:1], tmp_path / "run", num_workers=0)
    about = About(title="地図 \u202e <b>", authors="Å\nB", url="javascript:1", description="x" * 10**5)
    pack(tmp_path / "run", tmp_path / "run.gz", about=about)
    assert verify(tmp_path / "run.gz", tasks, limit=1, scores_only=True).is_accepted
    assert read_header(tmp_path / "run.gz").about == about
