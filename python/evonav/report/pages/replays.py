"""Choose the episodes of a run to replay, and list the pages of those that were.

`evonav view` writes the pages and their list beside a run; a report links to them or holds them.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.drawing.style import map_css
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.schema import EndState
from evonav.report.pages.template import text_of
from evonav.report.run import RecordedRun, RecordedStage
from evonav.report.tables.causes import FailureCause

LIST_NAME = "pages.json"


@dataclass(frozen=True, slots=True)
class ListedPage:
    """A replayed episode's page, as the list names it."""

    agent: str
    task_id: str
    href: str
    stages: list[list[Any]]
    """Number, state and outcome in words."""
    differs: bool
    records_sha256: str
    """Digest of the records that the page shows."""
    code: str
    """Digest of the page's own style and script."""

    @property
    def is_current(self) -> bool:
        """Whether this version of evonav would write the same page."""
        return self.code == page_code()


def listed_pages(view_dir: Path) -> list[ListedPage]:
    """Return the listed pages that are there; none if the list cannot be read or is of another version."""
    try:
        rows = json.loads((view_dir / LIST_NAME).read_text(encoding="utf-8"))
        pages = [ListedPage(**row) for row in rows]
        # Names from a file: only those of this folder.
        return [page for page in pages if page.stages and page.href in {path.name for path in view_dir.iterdir()}]
    except (OSError, ValueError, TypeError):
        return []


def viewer_css() -> Markup:
    """Return the style of an episode's page."""
    return text_of("report.css") + map_css() + text_of("viewer.css")


def page_code() -> str:
    """Return a digest of the style, the script and the templates of an episode's page."""
    others = "".join(map(text_of, ("viewer.js", "page.html.j2", "viewer.html.j2")))
    return hashlib.sha256((viewer_css() + others).encode()).hexdigest()


def highlights_first(run: RecordedRun, agents: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return agent and task of every recorded episode of some agents, by default of all, the highlights first.

    A pair shows most: in one stage, an agent that a stale entry misled, and one that succeeded. Of several such agents
    of a task those with the fewest rounds are taken, which are the quickest to run again; a task's other episodes come
    after all pairs.
    """
    num_rounds: Counter[tuple[str, str]] = Counter()
    for (agent, task_id, _), outcome in run.outcomes.items():
        num_rounds[agent, task_id] += outcome.row.num_rounds
    pairs: list[tuple[float, list[tuple[str, str]]]] = []
    rest: list[tuple[str, str]] = []
    for task_id, num_stages in run.num_stages.items():
        stages = range(1, num_stages + 1)
        there = [agent for agent in agents or run.agents if (agent, task_id) in num_rounds]
        quickest = sorted(there, key=lambda agent: num_rounds[agent, task_id])
        best: tuple[float, list[str]] = (-1.0, [])
        for stage in stages:
            found = {
                agent: run.outcomes[agent, task_id, stage]
                for agent in quickest
                if (agent, task_id, stage) in run.outcomes
            }
            best = max(best, _pair(found), key=lambda pair: pair[0])
        pairs.append((best[0], [(agent, task_id) for agent in best[1]]))
        rest += [(agent, task_id) for agent in quickest if agent not in best[1]]
    pairs.sort(key=lambda pair: -pair[0])
    return [episode for _, pair in pairs for episode in pair] + rest


def highlight_task(run: RecordedRun, agents: Sequence[str]) -> str:
    """Return the task of the first highlight of these agents that all of them have recorded.

    Raises:
        InvalidArgumentError: None of the run's tasks has a record of every one of the agents.
    """
    recorded = {(agent, task_id) for agent, task_id, _ in run.outcomes}
    for _, task_id in highlights_first(run, agents):
        if all((agent, task_id) in recorded for agent in agents):
            return task_id
    there = sorted({agent for agent, _ in recorded})
    hint = f"it has some of {', '.join(there)}" if there else "nothing was run yet: `evonav evaluate` goes on"
    raise InvalidArgumentError(f"{run.run_dir}: no task has records of {', '.join(agents)}; {hint}")


def _pair(found: dict[str, RecordedStage]) -> tuple[float, list[str]]:
    """Rate how well a stage shows the benchmark, and name the agents that show it."""
    good = [agent for agent, outcome in found.items() if outcome.row.state == EndState.SUCCESS]
    misled = [agent for agent, outcome in found.items() if outcome.cause is FailureCause.STALE_ENTRY]
    bad = misled or [agent for agent, outcome in found.items() if outcome.row.state == EndState.FAILURE]
    pair = bad[:1] + good[:1]
    if not pair:
        return -1.0, []
    row = found[pair[0]].row
    score = 6.0 * bool(misled) + 3.0 * (len(pair) == 2) + 2.0 * row.is_relocated_now
    return score + (row.mode not in ("first", "static")), pair
