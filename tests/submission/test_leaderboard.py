"""`evonav leaderboard`: who shares a table, who is not ranked and why, and that a page shows texts as texts."""

import gzip
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from browser import XSS_CORPUS, Chromium, needs_browser
from command_line import command
from typer.testing import CliRunner

from evonav.cli import app
from evonav.evaluation.run.evaluate import evaluate
from evonav.submission.file import About
from evonav.submission.leaderboard import Leaderboard, RankedTasks, Unranked, packed_files, rank
from evonav.submission.leaderboard_page import write_leaderboard
from evonav.submission.pack import pack
from evonav.tasks.listing import BUNDLED_TASKS, task_files


@pytest.fixture(scope="module")
def tasks() -> Iterator[RankedTasks]:
    return RankedTasks("one", tuple(task_files(BUNDLED_TASKS, 1)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, tasks: RankedTasks) -> Path:
    """A folder with a pack of two agents, one of poor perception, and the runs beside them."""
    root = tmp_path_factory.mktemp("leaderboard")
    evaluate(["fu", "ftu"], list(tasks.tasks), root / "run", num_workers=0)
    pack(
        root / "run", root / "packs" / "ours.evonav.jsonl.gz", about=About(title="Ours", url="https://example.org/ours")
    )
    options = ("--perception", "noisy:poor", "--limit", "1", "--workers", "0", "--out", str(root / "poor"))
    command("evaluate", "--agent", "fu", *options)
    pack(root / "poor", root / "packs" / "poor.evonav.jsonl.gz")
    return root


@pytest.fixture(scope="module")
def board(folder: Path, tasks: RankedTasks) -> Leaderboard:
    return rank(packed_files([folder / "packs"]), [tasks])


def changed(path: Path, to: Path, old: bytes, new: bytes) -> Path:
    """Copy a pack with a text replaced."""
    content = gzip.decompress(path.read_bytes())
    assert old in content
    to.write_bytes(gzip.compress(content.replace(old, new, 1)))
    return to


def test_agents_share_a_table_only_under_the_same_conditions(
    board: Leaderboard, folder: Path, tasks: RankedTasks
) -> None:
    assert board.unranked == []
    by_perception = {conditions.perception: entries for conditions, entries in board.tables.items()}
    assert {name: sorted(entry.file for entry in entries) for name, entries in by_perception.items()} == {
        "gt": ["ours.evonav.jsonl.gz", "ours.evonav.jsonl.gz"],
        "noisy:poor": ["poor.evonav.jsonl.gz"],
    }
    assert {conditions.task_set for conditions in board.tables} == {tasks.sha256}
    entries = by_perception["gt"]
    assert {entry.agent: entry.rates for entry in entries} == json.loads(
        (folder / "run" / "summary.json").read_text("utf-8")
    )["agents"]
    rates = [entry.rates["sr"] for entry in entries]
    assert rates == sorted(rates, reverse=True)


def test_a_file_that_is_altered_repeated_incomplete_or_none_is_not_ranked(
    folder: Path, tasks: RankedTasks, tmp_path: Path
) -> None:
    ours = folder / "packs" / "ours.evonav.jsonl.gz"
    shutil.copy(ours, tmp_path / "1.evonav.jsonl.gz")
    shutil.copy(ours, tmp_path / "2.evonav.jsonl.gz")
    changed(ours, tmp_path / "3.evonav.jsonl.gz", b'"sr":0.', b'"sr":0.0')
    (tmp_path / "4.evonav.jsonl.gz").write_text("no archive")
    changed(ours, tmp_path / "5.evonav.jsonl.gz", b'"is_geodesic', b'"is_Geodesic')
    changed(ours, tmp_path / "6.evonav.jsonl.gz", b'"max_views":7', b'"max_views":9')
    two = RankedTasks("two", tuple(task_files(BUNDLED_TASKS, 2)))
    found = rank(packed_files([tmp_path]), [tasks], scores_only=True)
    assert [(one.file, one.status) for one in found.unranked] == [
        ("2.evonav.jsonl.gz", "repeated"),
        ("2.evonav.jsonl.gz", "repeated"),
        ("3.evonav.jsonl.gz", "rejected"),
        ("4.evonav.jsonl.gz", "rejected"),
        ("5.evonav.jsonl.gz", "rejected"),
        ("6.evonav.jsonl.gz", "rejected"),
    ]
    assert found.unranked[-1].detail == "protocol: max_views is 9, the benchmark's is 7"
    assert {entry.file for entries in found.tables.values() for entry in entries} == {"1.evonav.jsonl.gz"}
    incomplete = Unranked("ours.evonav.jsonl.gz", "incomplete", "1 of 2 tasks of two")
    assert rank([ours], [two], scores_only=True).unranked == [incomplete]
    assert rank([ours], [two, tasks], scores_only=True).unranked == [], "it has every task of one of the sets"
    (unknown,) = rank([ours], [RankedTasks("other", two.tasks[1:])], scores_only=True).unranked
    assert "name their folder with --tasks" in unknown.detail


def test_false_actions_are_found_unless_only_scores_are_checked(
    folder: Path, tasks: RankedTasks, tmp_path: Path
) -> None:
    """No score depends on it, so that only the replay can tell."""
    ours = folder / "packs" / "ours.evonav.jsonl.gz"
    changed(ours, tmp_path / "x.evonav.jsonl.gz", b'"is_action_success":true', b'"is_action_success":false')
    assert rank([tmp_path / "x.evonav.jsonl.gz"], [tasks], scores_only=True).unranked == []
    (one,) = rank([tmp_path / "x.evonav.jsonl.gz"], [tasks]).unranked
    assert (one.status, one.detail.partition(":")[0]) == ("rejected", "actions")


def smuggling(board: Leaderboard) -> Leaderboard:
    """Return the leaderboard with markup in every text that a submitter writes."""
    texts = iter(XSS_CORPUS * 4)

    def about() -> About:
        return About(title=next(texts), authors=next(texts), url=f"javascript://x/%0aalert(1)//{len(next(texts))}")

    tables = {
        replace(conditions, perception=next(texts)): [
            replace(
                entry,
                file=next(texts),
                agent=next(texts),
                setup=replace(entry.setup, model=next(texts), isolation=next(texts)),
                header=entry.header.model_copy(update={"about": about(), "evonav": next(texts)}),
            )
            for entry in entries
        ]
        for conditions, entries in board.tables.items()
    }
    return replace(board, tables=tables, unranked=[Unranked(text, "rejected", text) for text in texts])


def test_the_page_shows_what_submitters_wrote_as_text(board: Leaderboard, tmp_path: Path) -> None:
    text = write_leaderboard(smuggling(board), tmp_path / "page.html", "<b>title</b>").read_text("utf-8")
    assert re.findall(r"<script|<img|<iframe|<b>title|<a href", text) == ["<script"]
    assert text.count("&lt;script&gt;alert(1)&lt;/script&gt;") >= 2
    honest = write_leaderboard(board, tmp_path / "page.html", "title").read_text("utf-8")
    assert re.findall(r'<a href="([^"]*)"', honest) == ["https://example.org/ours"] * 2


@needs_browser
def test_the_page_is_sorted_by_a_click_and_fits_a_phone(board: Leaderboard, tmp_path: Path) -> None:
    page = write_leaderboard(board, tmp_path / "page.html", "title")
    bad = write_leaderboard(smuggling(board), tmp_path / "bad.html", "title")
    column = '[...document.querySelector("tbody").rows].map(row => row.cells[0].textContent)'
    with Chromium(tmp_path / "profile", "400,800") as browser:
        browser.open(page)
        assert browser.said() == []
        assert browser.run(column) == ["1", "2"]
        browser.run('document.querySelector("thead th").click()')
        assert browser.run(column) == ["2", "1"]
        browser.run('document.querySelectorAll("thead th")[1].click()')
        agents = browser.run(column.replace("cells[0]", "cells[1]"))
        assert [agent[:3] for agent in agents] == ["fu ", "ftu"]
        assert browser.run("document.documentElement.scrollWidth <= innerWidth")
        assert browser.run('getComputedStyle(document.querySelector(".bar")).width') == "120px"
        browser.events.clear()
        browser.open(bad)
        assert browser.said() == []
        assert browser.run("document.documentElement.scrollWidth <= innerWidth")


def test_the_command_names_what_it_ranked_and_what_not(folder: Path, tmp_path: Path) -> None:
    words = ["leaderboard", str(folder / "packs"), "--scores-only", "--workers", "0", "--out", str(tmp_path / "p.html")]
    shown = command(*words, "--limit", "1")
    assert re.search(r"leaderboard: .*p\.html \(\d agents in \d tables?; 0 not ranked\)", shown)
    assert "evonav-mini (first 1): 1 with 4 stages" in (tmp_path / "p.html").read_text("utf-8")
    shown = CliRunner().invoke(app, words)
    assert "incomplete: ours.evonav.jsonl.gz: 1 of 24 tasks of evonav-mini" in shown.stdout
    shown = CliRunner().invoke(app, ["leaderboard", str(tmp_path)])
    assert "no packed run (*.evonav.jsonl.gz)" in str(shown.exception)
