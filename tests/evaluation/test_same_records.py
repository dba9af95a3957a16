"""One matrix: records are the same, byte for byte, for any number of workers, episodes at once and kind of isolation.

Each kind of decision and perception has a random stream or a cache of its own, so each is run here: once in this
process, once on one worker and once on two; and so are all built-in agents.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from toy_run import texts

import evonav
from evonav.agents.registry import BUILT_IN
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import FAULTS
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.store import RunStore
from vlm_stub import serving

KINDS: Mapping[str, dict[str, Any]] = {
    "text": {},
    "mistakes": {"decision": {"noise": {"wrong": 0.2, "confused": 0.4, "unparsable": 0.2, "refusal": 0.1}}},
    "pictures": {"decision": {"kind": "looks", "goal_input": "image"}},
    "model": {"decision": {"kind": "vlm", "model": "any", "max_retries": 0}},
    "perception": {"perception": "noisy:poor"},
    "agents": {"protocol": ProtocolConfig(max_rounds=4, max_actions=8)},
}
SETTINGS: tuple[dict[str, Any], ...] = (
    {"workers": 1, "isolation": "process", "episodes_at_once": 3},
    {"workers": 2, "episodes_at_once": 1},
)
"""Compared with a run in this process, without isolation. Where nothing is said, agents are in the sandbox."""
NAMES_OF_FAULTS = ("server_error", "malformed", "truncated", "refusal", "broken_json")


def faulty_reply(request: Mapping[str, Any]) -> dict[str, Any]:
    """Answers after a while; which requests meet a fault, about a tenth, is decided by what they ask alone."""
    number = int(hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest()[:8], 16)
    reply = {"text": mock_answer(request)} if number % 10 else FAULTS[NAMES_OF_FAULTS[number // 10 % 5]]
    return {**reply, "hang_s": 0.05}


def run(kind: str, folder: Path, **settings: Any) -> tuple[list[Any], float, int]:
    """Evaluate agents, whose order says nothing.

    Returns:
        The records with floor plans and summary, the CPU time of all stages, and how many requests a model had at once.
    """
    agents = list(BUILT_IN) if kind == "agents" else ["fu", "unigoal"]
    options = {"limit": 1, "out": folder, "protocol": ProtocolConfig(max_rounds=3), "seed": 3, **KINDS[kind]}
    with serving(faulty_reply) as stub:
        if kind == "model":
            server = {"base_url": stub.url, "exchanges": str(folder.with_suffix(".exchanges"))}
            options["decision"] = {**options["decision"], **server}
        evonav.evaluate(*agents[:: 1 if settings["workers"] == 1 else -1], **options, **settings)
    with RunStore(folder) as store:
        cpu_s = sum(one["cpu_s"] for one in store.costs().values())
    return [*texts(folder), (folder / "summary.json").read_bytes()], cpu_s, stub.most_at_once


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind == "text" else pytest.mark.slow) for kind in KINDS]
)
def test_records_do_not_depend_on_workers_episodes_at_once_or_isolation(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    here, here_s, _ = run(kind, tmp_path / "here", workers=0, isolation="none")
    assert len(here) > 9
    for index, settings in enumerate(SETTINGS):
        found, cpu_s, most_at_once = run(kind, tmp_path / str(index), **settings)
        assert found == here, settings
        if kind == "model" and settings["episodes_at_once"] > 1:
            assert most_at_once > 1
            assert 0.0 < cpu_s < 2.0 * here_s  # of each episode its own, not that of all on the worker
