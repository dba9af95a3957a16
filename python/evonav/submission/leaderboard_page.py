"""Write a leaderboard as one self-contained page. What submitters wrote is shown as text, never as markup."""

from pathlib import Path
from urllib.parse import urlsplit

from evonav.parallel.folders import write_atomically
from evonav.report.pages.rate_bar import rate_bar
from evonav.report.pages.template import page_text, text_of
from evonav.report.tables.numbers import NONE, rate
from evonav.report.tables.table import INTERVALS
from evonav.submission.leaderboard import Conditions, Entry, Leaderboard

MAX_SHOWN = 200
"""Largest number of characters of a submitter's text that the page shows."""
_PERCEPTIONS = {
    "gt": "ground-truth perception",
    "noisy": "ground truth with errors",
    "predicted": "predicted perception",
}
_DECISIONS = {
    "text": "decisions by rules",
    "appearance": "decisions by rules that look",
    "vlm": "decisions by a model",
    "own": "decisions by a model of its own",
}
_COLUMNS = ("Agent", "SR % [95% CI]", "SPL % [95% CI]", "Entry", "Model", "Seed", "Date", "evonav", "Isolation", "File")


def write_leaderboard(board: Leaderboard, path: Path, title: str) -> Path:
    """Write the page, and return its path.

    Args:
        board: Verified runs.

    Raises:
        StoreError: It cannot be written.
    """
    tables = sorted(board.tables.items(), key=lambda table: (-len(table[1]), str(table[0])))
    text = page_text(
        "leaderboard.html.j2",
        text_of("report.css") + text_of("leaderboard.css"),
        text_of("sortable.js"),
        title=title,
        columns=_COLUMNS,
        tables=[_table(board, conditions, entries) for conditions, entries in tables],
        unranked=[(short(one.file), one.status, short(one.detail, 2 * MAX_SHOWN)) for one in board.unranked],
        is_rescored=board.is_rescored,
        intervals=INTERVALS,
    )
    return write_atomically(path, text)


def _table(board: Leaderboard, conditions: Conditions, entries: list[Entry]) -> dict[str, object]:
    tasks = board.task_sets[conditions.task_set]
    perception = _PERCEPTIONS.get(conditions.perception.partition(":")[0].partition(",")[0], "a perception of its own")
    decision = _DECISIONS.get(conditions.decision.partition(",")[0], conditions.decision)
    return {
        "title": f"{perception.capitalize()}, {decision}",
        "facts": [
            ("tasks", f"{tasks.name}: {len(tasks.tasks)} with {tasks.num_stages} stages"),
            ("sha256", tasks.sha256),
            ("perception", short(conditions.perception)),
            ("decision", short(conditions.decision)),
            *([("simulator", short(conditions.simulator))] if conditions.simulator else []),
        ],
        "rows": [_row(entry) for entry in entries],
    }


def _row(entry: Entry) -> dict[str, object]:
    about, summary = entry.header.about, entry.summary
    return {
        "agent": short(summary.agent),
        "sr": rate(summary.sr, summary.sr_ci95),
        "sr_bar": rate_bar(summary.sr, summary.sr_ci95),
        "spl": rate(summary.spl, summary.spl_ci95),
        "spl_bar": rate_bar(summary.spl, summary.spl_ci95),
        "title": short(about.title) or NONE,
        "authors": short(about.authors),
        "url": about.url if _is_web(about.url) else None,
        "cells": [
            short(entry.model) or NONE,
            short(str(entry.header.config.get("seed", NONE))),
            entry.date or NONE,
            short(entry.header.evonav),
            short(entry.isolation) or NONE,
            short(entry.file),
        ],
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
