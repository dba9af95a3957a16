"""Describe a run beside its metrics: how to run it again, its settings, its failures."""

import json
import shlex
from collections import Counter
from collections.abc import Mapping
from statistics import fmean
from typing import Any

from evonav.evaluation.records.schema import EndState
from evonav.perception.shorthand import short_name_of
from evonav.report.run import RecordedRun

MAX_LISTED = 12
"""Stages named of each kind of failure."""
_DEFAULT_PARTS = {"decision": "text_match", "simulator": "embedded_simulator"}


def failure_groups(run: RecordedRun) -> list[dict[str, Any]]:
    """Group errored stages by error, the most frequent first.

    Each group has its `kind` and `message`, the `traceback` of its first stage that has one, its `agents` and
    `num_stages`, and agent, task and stage of the first `MAX_LISTED` `stages`.
    """
    found: dict[tuple[str, str], list[tuple[str, str, int]]] = {}
    tracebacks = {(failure.agent, failure.task_id, failure.stage): failure.traceback for failure in run.failures}
    for key, outcome in run.outcomes.items():
        error = outcome.error
        if error is not None and outcome.row.state == EndState.ERRORED:
            which = (error.kind.value.replace("_", " "), error.message)
            found.setdefault(which, []).append(key)
    return [
        {
            "kind": kind,
            "message": message,
            "traceback": next((text for key in stages if (text := tracebacks.get(key))), ""),
            "agents": tuple(dict.fromkeys(agent for agent, _, _ in stages)),
            "stages": stages[:MAX_LISTED],
            "num_stages": len(stages),
        }
        for (kind, message), stages in sorted(found.items(), key=lambda group: -len(group[1]))
    ]


def reproduction(run: RecordedRun) -> list[str]:
    """Return the commands that repeat the run: those that were given, or where none is stored, one from its config."""
    given = [session["command"] for session in _sessions(run) if session.get("command")]
    if given:
        return list(dict.fromkeys(given))
    backend = run.config.get("backend")
    parts = backend if isinstance(backend, dict) else {}
    if any(str(parts.get(name, "")).rpartition(":")[2] != part for name, part in _DEFAULT_PARTS.items()):
        return []
    perception = perception_of(run)
    command = ["evonav", "evaluate", "--agent", ",".join(run.agents), "--seed", str(run.config.get("seed", 0))]
    if isinstance(run.notes.get("tasks_dir"), str):
        command += ["--tasks", run.notes["tasks_dir"]]
    command += ["--perception", perception] if perception not in ("gt", "") else []
    return [shlex.join([*command, "--out", "out/again"])]


def perception_of(run: RecordedRun) -> str:
    """Return the perception of the run, as `--perception` names it; empty where the run does not record it."""
    backend = run.config.get("backend")
    parts = backend if isinstance(backend, dict) else {}
    make, options = parts.get("perception"), parts.get("perception_options", {})
    return short_name_of(make, options) if isinstance(make, str) and isinstance(options, dict) else ""


def run_facts(run: RecordedRun) -> list[tuple[str, str]]:
    """Name and value of what makes the run reproducible, and of what its figures hang on."""
    facts = [(key, _json(value)) for key, value in sorted(run.config.items())]
    facts += [("perception", perception)] if (perception := perception_of(run)) else []
    facts += [("tasks recorded", str(len(run.num_stages))), ("agents", ", ".join(run.agents))]
    facts += [(f"sha256 of the records, {agent}", digest) for agent, digest in run.rows_sha256.items()]
    wall_s = run.wall_s
    facts += [(f"mean wall time a stage, {agent}", f"{fmean(times):.2f} s") for agent, times in wall_s.items()]
    if wall_s:
        total_s = sum(map(sum, wall_s.values()))
        facts += [("wall time of all stages, one after another", _duration(total_s))]
    retries = Counter(failure.kind.value.replace("_", " ") for failure in run.failures if failure.is_retried)
    if retries:
        facts.append(("stages tried again", ", ".join(f"{count} after {kind}" for kind, count in retries.items())))
    for number, session in enumerate(_sessions(run), 1):
        shown = {key: value for key, value in session.items() if key != "command" and value not in (None, "")}
        facts.append((f"call {number}", "; ".join(f"{key.replace('_', ' ')}: {_json(shown[key])}" for key in shown)))
    return facts


def task_digests(run: RecordedRun) -> Mapping[str, str]:
    """SHA-256 of each task's files, where the run notes it."""
    digests = run.notes.get("task_digests")
    return digests if isinstance(digests, dict) else {}


def _sessions(run: RecordedRun) -> list[dict[str, Any]]:
    sessions = run.notes.get("sessions")
    return [session for session in sessions if isinstance(session, dict)] if isinstance(sessions, list) else []


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def _json(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)
