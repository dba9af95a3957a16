"""One matrix: records are the same, byte for byte, for any number of workers, episodes at once and kind of isolation.

Each kind of decision and perception has a random stream or a cache of its own, so each is run here: once in this
process, once on one worker and once on two.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

import evonav
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from vlm_stub import serving

KINDS: Mapping[str, dict[str, Any]] = {
    "text": {},
    "mistakes": {"decision": {"noise": {"wrong": 0.2, "confused": 0.4, "unparsable": 0.2, "refusal": 0.1}}},
    "pictures": {"decision": {"kind": "looks", "goal_input": "image"}},
    "model": {"decision": {"kind": "vlm", "model": "any", "max_retries": 0}},
    "perception": {"perception": "noisy:poor"},
}
SETTINGS: tuple[dict[str, Any], ...] = (
    {"workers": 1, "isolation": "process", "episodes_at_once": 3},
    {"workers": 2, "episodes_at_once": 1},
)
"""Compared with a run in this process, without isolation. Where nothing is said, agents are in the sandbox."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., list[Any]]:
    def records(kind: str, **settings: Any) -> list[Any]:
        folder = tmp_path_factory.mktemp("run") / "run"
        run_here(folder, dict(KINDS[kind]), settings)
        with RunStore(folder) as store:
            plans = [plan.model_dump_json() for plan in store.floor_plans()]
            return [*store.record_texts(), *plans, (folder / "summary.json").read_bytes()]

    return records


def run_here(folder: Path, parts: dict[str, Any], settings: dict[str, Any]) -> None:
    options = {"limit": 1, "out": folder, "protocol": ProtocolConfig(max_rounds=3), "seed": 3, **settings}
    agents = ("fu", "unigoal")
    if parts.get("decision", {}).get("kind") != "vlm":
        evonav.evaluate(*agents, **parts, **options)
        return
    with serving(lambda request: {"text": mock_answer(request)}) as stub:
        parts["decision"] |= {"base_url": stub.url, "exchanges": str(folder.parent / "exchanges")}
        evonav.evaluate(*agents, **parts, **options)


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind == "text" else pytest.mark.slow) for kind in KINDS]
)
def test_records_do_not_depend_on_workers_episodes_at_once_or_isolation(
    kind: str, run: Callable[..., list[Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    here = run(kind, workers=0, isolation="none")
    assert len(here) > 9
    for settings in SETTINGS:
        assert run(kind, **settings) == here, settings
