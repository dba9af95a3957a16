"""Write the `summary.json` of a run: every agent's metrics, from the records."""

import json
from collections.abc import Sequence
from pathlib import Path

from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.metrics.navigation import AgentPair, AgentSummary, agent_pairs, summarise, summary_json
from evonav.evaluation.records.store import RunStore
from evonav.parallel.folders import write_atomically
from evonav.perception.shorthand import word_of

SUMMARY_NAME = "summary.json"
MODELS_KEY = "perception_models"
"""Key in a run's header and summary for hashes of weights and versions of libraries, by stack."""


def write_summary(run_dir: Path, only: Sequence[str] | None = None) -> list[AgentSummary]:
    """Compute every agent's metrics from the records, and write `summary.json`.

    Args:
        only: Agents to return, in this order; default all.

    Raises:
        StoreError: There is no run, or it cannot be read or written.
    """
    with RunStore(run_dir) as store:
        agents: list[str] = store.meta("agents") or []
        num_stages = sum(store.meta("num_stages").values())
        records = {agent: list(store.records(agent, is_brief=True)) for agent in agents_in_order(agents)}
    summaries = {agent: summarise(agent, mine, num_stages) for agent, mine in records.items()}
    save_summary(run_dir, list(summaries.values()), agent_pairs(records))
    return [summaries[agent] for agent in only or agents]


def save_summary(run_dir: Path, summaries: Sequence[AgentSummary], pairs: Sequence[AgentPair]) -> None:
    """Write `summary.json`.

    Args:
        pairs: Those of every two agents.

    Raises:
        StoreError: There is no run, or it cannot be read or written.
    """
    with RunStore(run_dir) as store:
        backend = (store.meta("config") or {}).get("backend", {})
        models = store.meta(MODELS_KEY)
    content = summary_json(summaries, pairs)
    if make := backend.get("perception"):
        content["perception"] = word_of(make, backend.get("perception_options", {}))
    if models:
        content[MODELS_KEY] = models
    text = json.dumps(content, indent=2, sort_keys=True) + "\n"
    path = run_dir / SUMMARY_NAME
    if not path.is_file() or path.read_bytes() != text.encode():  # a run may lie where nothing can be written
        write_atomically(path, text)
