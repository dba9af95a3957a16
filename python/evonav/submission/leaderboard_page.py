"""Write a leaderboard as one self-contained page. What submitters wrote is shown as text, never as markup."""

from collections.abc import Mapping
from pathlib import Path
from urllib.parse import urlsplit

from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, rate_bar, text_of
from evonav.report.tables.numbers import percent, rate
from evonav.report.tables.table import INTERVALS, SPLIT_TITLES, short_names
from evonav.submission.leaderboard import Conditions, Leaderboard, RankedAgent

MAX_SHOWN = 200
"""Largest number of characters of a submitter's text that the page shows."""
NUM_DIGITS = 12
"""Number of the first digits of a SHA-256 that the page shows; a tooltip shows all."""
_PERCEPTIONS = {
    "gt": "ground-truth perception",
    "noisy": "ground truth with errors",
    "predicted": "predicted perception",
}
_DECISIONS = {
    "text": "decisions by rules",
    "looks": "decisions by rules that look",
    "vlm": "decisions by a model",
    "custom": "decisions by a model of its own",
}
_SPLITS = ("relocated", "not_relocated")


def write_leaderboard(board: Leaderboard, path: Path, title: str) -> Path:
    """Write the page, and return its path."""
    tables = sorted(board.tables.items(), key=lambda table: (-len(table[1]), str(table[0])))
    text = page_text(
        "leaderboard.html.j2",
        text_of("report.css") + text_of("leaderboard.css"),
        text_of("sortable.js"),
        title=title,
        splits=[SPLIT_TITLES[name] for name in _SPLITS],
        num_digits=NUM_DIGITS,
        tables=[_table(board, conditions, entries) for conditions, entries in tables],
        unranked=[(short(one.file), one.status, short(one.detail, 2 * MAX_SHOWN)) for one in board.unranked],
        is_rescored=board.is_rescored,
        intervals=INTERVALS,
    )
    return write_atomically(path, text)


def _table(board: Leaderboard, conditions: Conditions, entries: list[RankedAgent]) -> dict[str, object]:
    tasks = board.task_sets[conditions.task_set]
    perception = _PERCEPTIONS.get(conditions.perception.partition(":")[0].partition(",")[0], "a perception of its own")
    decision = _DECISIONS.get(conditions.decision.partition(",")[0], conditions.decision)
    return {
        "title": f"{perception.capitalize()}, {decision}",
        "sha256": tasks.sha256,
        "facts": [
            ("tasks", f"{tasks.name}: {len(tasks.tasks)} with {tasks.num_stages} stages"),
            ("perception", short(conditions.perception)),
            ("decision", short(conditions.decision)),
            *([("simulator", short(conditions.simulator))] if conditions.simulator else []),
        ],
        "rows": [_row(entry, short_names(other.agent for other in entries)) for entry in entries],
    }


def _row(entry: RankedAgent, names: Mapping[str, str]) -> dict[str, object]:
    about, setup, rates = entry.header.about, entry.setup, entry.rates
    url = about.url if _is_web(about.url) else None
    facts = (
        about.authors,
        f"model {setup.model}" if setup.model else "",
        f"seed {entry.header.config.get('seed')}",
        f"isolation {setup.isolation or 'not noted'}",
        f"evonav {entry.header.evonav}",
        entry.file,
    )
    return {
        "agent": short(names.get(entry.agent, entry.agent)),
        "title": short(about.title or (url or "")),
        "url": url,
        "facts": [short(fact) for fact in facts if fact],
        "rates": [(rate(*ends), rate_bar(*ends)) for ends in ((rates[n], rates[f"{n}_ci95"]) for n in ("sr", "spl"))],
        "splits": [percent(rates["splits"].get(name, {}).get("sr")) for name in _SPLITS],
        "sha256": entry.sha256,
    }


def short(text: str, length: int = MAX_SHOWN) -> str:
    """Return a submitter's text on one line, cut if it is long."""
    line = " ".join(text.split())
    return line if len(line) <= length else f"{line[: length - 1]}…"


def _is_web(url: str) -> bool:
    try:
        parts = urlsplit(url)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(parts.netloc) and len(url) <= MAX_SHOWN
