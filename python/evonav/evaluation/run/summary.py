"""Write what a run says of itself beside its records: `summary.json`, and the sessions that worked on it."""

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from datetime import datetime, timezone
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from evonav import __version__
from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.metrics.navigation import AgentPair, AgentSummary, agent_pairs, summarise, summary_json
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.store import RunStore
from evonav.parallel.folders import write_atomically
from evonav.perception.shorthand import short_name_of

SUMMARY_NAME = "summary.json"
MODELS_KEY = "perception_models"
"""Key in a run's header and summary for hashes of weights and versions of libraries, by stack."""
SESSIONS_KEY = "sessions"
_ISOLATIONS_KEY = "isolations"
_ADDRESS = "--base-url"
MAX_SESSIONS = 50
"""Largest number of noted sessions: the first one and the latest."""


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
        rows = read_stage_metrics(store)
    by_agent = {agent: [row for row in rows if row.agent == agent] for agent in agents_in_order(agents)}
    summaries = {agent: summarise(agent, mine, num_stages) for agent, mine in by_agent.items()}
    save_summary(run_dir, list(summaries.values()), agent_pairs(by_agent))
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
        content["perception"] = short_name_of(make, backend.get("perception_options", {}))
    if models:
        content[MODELS_KEY] = models
    text = json.dumps(content, indent=2, sort_keys=True) + "\n"
    path = run_dir / SUMMARY_NAME
    if not path.is_file() or path.read_bytes() != text.encode():  # a run may lie where nothing can be written
        write_atomically(path, text)


def note_session(store: RunStore, num_workers: int, isolation: str) -> None:
    """Note the command that is about to evaluate, its machine and versions.

    Args:
        num_workers: Number of processes that evaluate.
        isolation: The isolation of agents, see `isolation_facts`.
    """
    before = store.meta(SESSIONS_KEY) or []
    sessions = [*before[:1], *before[1:][-(MAX_SESSIONS - 2) :]]
    kind = isolation.partition(" ")[0]
    store.set_header(
        {
            SESSIONS_KEY: [*sessions, {**session_facts(), "workers": num_workers, "isolation": isolation}],
            _ISOLATIONS_KEY: sorted({*isolations_of(store), kind}),
        }
    )


def isolations_of(store: RunStore) -> list[str]:
    """Return every `--isolation` with which agents of a run were evaluated; empty in runs that note none."""
    return store.meta(_ISOLATIONS_KEY) or []


def session_facts() -> dict[str, Any]:
    """Return the command of this process, its machine and versions, without names of users or machines."""
    return {
        "command": typed_command(),
        "began": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "evonav": __version__,
        "git": _revision(Path(__file__).parent),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpus": os.cpu_count(),
    }


def typed_command() -> str:
    """Return the command as typed if it is evonav's, else an empty string.

    Addresses of models' servers, which may hold a password, are `***`.
    """
    name = Path(sys.argv[0]).name if sys.argv else ""
    if name not in ("evonav", "__main__.py"):
        return ""
    arguments = [
        "***" if before == _ADDRESS else f"{_ADDRESS}=***" if word.startswith(f"{_ADDRESS}=") else word
        for before, word in pairwise(sys.argv)
    ]
    return shlex.join(["evonav", *arguments])


@cache
def _revision(directory: Path) -> str:
    """Return the git revision of the package's checkout; empty if it is installed or git is missing."""
    try:
        command = ["git", "-C", str(directory), "describe", "--always", "--dirty", "--abbrev=12"]
        in_git = ["git", "-C", str(directory), "ls-files", "--error-unmatch", Path(__file__).name]
        if subprocess.run(in_git, capture_output=True, timeout=5).returncode != 0:  # noqa: S603
            return ""  # some other project's checkout, with this package in an environment inside
        return subprocess.run(command, capture_output=True, text=True, timeout=5).stdout.strip()  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return ""
