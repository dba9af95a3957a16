"""`evonav leaderboard`: who shares a table, who is not ranked and why, and that a page shows texts as texts."""

import hashlib
import json
import re
import shutil
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from browser import Chromium, needs_browser
from typer.testing import CliRunner

from evonav.cli import app
from evonav.evaluation.metrics.navigation import summarise
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.run import evaluate
from evonav.submission.file import About
from evonav.submission.leaderboard import Leaderboard, TaskSet, Unranked, packed_files, rank
from evonav.submission.leaderboard_page import write_leaderboard
from evonav.submission.pack import pack
from evonav.tasks.bundled import FORMER_IMAGES, bundled_tasks
from evonav.tasks.listing import task_files

HERE = Path(__file__).parent
OLDER_PACK = HERE.parent / "golden" / "data" / "packed.evonav.zip"
"""The first bundled task by fu and ftu, as an early version packed it."""
CORPUS: list[str] = json.loads((HERE / "xss_corpus.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def tasks() -> Iterator[TaskSet]:
    with bundled_tasks() as folder:
        yield TaskSet("one", tuple(task_files(folder, 1)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, tasks: TaskSet) -> Path:
    """A folder with a pack of two agents, one of poor perception, and the runs beside them."""
    root = tmp_path_factory.mktemp("leaderboard")
    evaluate(["fu", "ftu"], list(tasks.tasks), root / "run", num_workers=0)
    pack(root / "run", root / "packs" / "ours.evonav.zip", about=About(title="Ours", url="https://example.org/ours"))
    options = ("--perception", "noisy:poor", "--limit", "1", "--workers", "0", "--out", str(root / "poor"))
    assert CliRunner().invoke(app, ["evaluate", "--agent", "fu", *options]).exit_code == 0
    pack(root / "poor", root / "packs" / "poor.evonav.zip")
    return root


@pytest.fixture(scope="module")
def board(folder: Path, tasks: TaskSet) -> Leaderboard:
    return rank(packed_files([folder / "packs"]), [tasks])


def changed(path: Path, to: Path, member: str, old: bytes, new: bytes) -> Path:
    """Copy a pack with a text replaced in a member."""
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(to, "w", zipfile.ZIP_DEFLATED) as target:
        for name in source.namelist():
            content = source.read(name)
            assert name != member or old in content
            target.writestr(name, content.replace(old, new, 1) if name == member else content)
    return to


def test_agents_share_a_table_only_under_the_same_conditions(board: Leaderboard, folder: Path, tasks: TaskSet) -> None:
    assert board.unranked == []
    by_perception = {conditions.perception: entries for conditions, entries in board.tables.items()}
    assert {name: sorted(entry.file for entry in entries) for name, entries in by_perception.items()} == {
        "gt": ["ours.evonav.zip", "ours.evonav.zip"],
        "noisy:poor": ["poor.evonav.zip"],
    }
    assert {conditions.task_set for conditions in board.tables} == {tasks.sha256}
    with RunStore(folder / "run") as store:
        own = {agent: summarise(agent, list(store.records(agent)), tasks.num_stages) for agent in ("fu", "ftu")}
    entries = by_perception["gt"]
    assert {entry.summary.agent: entry.summary for entry in entries} == own
    rates = [entry.summary.sr for entry in entries]
    assert rates == sorted(rates, reverse=True)


def test_an_entry_tells_the_day_on_which_its_run_began(board: Leaderboard, folder: Path) -> None:
    with RunStore(folder / "run") as store:
        began = store.meta("sessions")[0]["began"]
    dates = {entry.file: entry.date for entries in board.tables.values() for entry in entries}
    assert dates == {"ours.evonav.zip": began[:10], "poor.evonav.zip": began[:10]}


def test_a_pack_of_an_early_version_is_ranked_with_its_names_and_without_a_day(tasks: TaskSet) -> None:
    """It has a table of its own, since reference images were others then."""
    ((conditions, entries),) = rank([OLDER_PACK], [tasks], scores_only=True).tables.items()
    assert (conditions.task_set, conditions.reference_images) == (tasks.sha256, FORMER_IMAGES)
    assert (conditions.perception, conditions.decision, conditions.simulator) == ("gt", "text", "")
    assert [(entry.summary.agent, entry.date) for entry in entries] == [("ftu", None), ("fu", None)]


def test_a_file_that_is_altered_repeated_incomplete_or_none_is_not_ranked(
    folder: Path, tasks: TaskSet, tmp_path: Path
) -> None:
    ours = folder / "packs" / "ours.evonav.zip"
    shutil.copy(ours, tmp_path / "1.evonav.zip")
    shutil.copy(ours, tmp_path / "2.evonav.zip")
    changed(ours, tmp_path / "3.evonav.zip", "submission.json", b'"sr": ', b'"sr": 0')
    (tmp_path / "4.evonav.zip").write_text("no archive")
    changed(ours, tmp_path / "5.evonav.zip", "records/1.jsonl", b'"spl":', b'"spl":1')
    changed(ours, tmp_path / "6.evonav.zip", "submission.json", b'"max_views": 7', b'"max_views": 9')
    with bundled_tasks() as every:
        two = TaskSet("two", tuple(task_files(every, 2)))
    found = rank(packed_files([tmp_path]), [tasks], scores_only=True)
    assert [(one.file, one.status) for one in found.unranked] == [
        ("2.evonav.zip", "repeated"),
        ("2.evonav.zip", "repeated"),
        ("3.evonav.zip", "rejected"),
        ("4.evonav.zip", "rejected"),
        ("5.evonav.zip", "rejected"),
        ("6.evonav.zip", "rejected"),
    ]
    assert found.unranked[-1].detail == "protocol: max_views is 9, the benchmark's is 7"
    assert {entry.file for entries in found.tables.values() for entry in entries} == {"1.evonav.zip"}
    incomplete = Unranked("ours.evonav.zip", "incomplete", "1 of 2 tasks of two")
    assert rank([ours], [two], scores_only=True).unranked == [incomplete]
    assert rank([ours], [two, tasks], scores_only=True).unranked == [], "it has every task of one of the sets"
    (unknown,) = rank([ours], [TaskSet("other", two.tasks[1:])], scores_only=True).unranked
    assert "name their folder with --tasks" in unknown.detail


def test_false_actions_are_found_unless_only_scores_are_checked(folder: Path, tasks: TaskSet, tmp_path: Path) -> None:
    """The header's checksum is corrected, so that only the replay can tell."""
    ours = folder / "packs" / "ours.evonav.zip"
    with zipfile.ZipFile(ours) as source:
        before = source.read("records/1.jsonl")
        after = before.replace(b'"is_action_success":true', b'"is_action_success":false', 1)
        assert after != before
        header = source.read("submission.json")
    with zipfile.ZipFile(tmp_path / "x.evonav.zip", "w", zipfile.ZIP_DEFLATED) as target:
        sha256s = [hashlib.sha256(content).hexdigest().encode() for content in (before, after)]
        header = header.replace(*sha256s).replace(
            f'"num_bytes": {len(before)}'.encode(), f'"num_bytes": {len(after)}'.encode(), 1
        )
        target.writestr("submission.json", header)
        with zipfile.ZipFile(ours) as source:
            for name in source.namelist()[1:]:
                target.writestr(name, after if name == "records/1.jsonl" else source.read(name))
    assert rank([tmp_path / "x.evonav.zip"], [tasks], scores_only=True).unranked == []
    (one,) = rank([tmp_path / "x.evonav.zip"], [tasks]).unranked
    assert (one.status, one.detail.partition(":")[0]) == ("rejected", "actions")


def smuggling(board: Leaderboard) -> Leaderboard:
    """Return the leaderboard with markup in every text that a submitter writes."""
    texts = iter(CORPUS * 3)

    def about() -> About:
        return About(title=next(texts), authors=next(texts), url=f"javascript://x/%0aalert(1)//{len(next(texts))}")

    tables = {
        replace(conditions, perception=next(texts)): [
            replace(
                entry,
                file=next(texts),
                model=next(texts),
                summary=replace(entry.summary, agent=next(texts)),
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
    days = iter(("2026-11-03", "2026-02-14", "2026-05-01"))
    tables = {key: [replace(entry, date=next(days)) for entry in entries] for key, entries in board.tables.items()}
    page = write_leaderboard(replace(board, tables=tables), tmp_path / "page.html", "title")
    bad = write_leaderboard(smuggling(board), tmp_path / "bad.html", "title")
    column = '[...document.querySelector("tbody").rows].map(row => row.cells[0].textContent)'
    with Chromium(tmp_path / "profile", "400,800") as browser:
        browser.open(page)
        assert browser.said() == []
        agents = browser.run(column)
        assert sorted(agents) == ["ftu", "fu"]
        browser.run('document.querySelector("thead th").click()')
        assert browser.run(column) == ["fu", "ftu"]
        browser.run('document.querySelector("thead th").click()')
        assert browser.run(column) == ["ftu", "fu"]
        dates = column.replace("cells[0]", "cells[6]")
        browser.run('document.querySelectorAll("thead th")[6].click()')
        assert browser.run(dates) == ["2026-11-03", "2026-02-14"]
        browser.run('document.querySelectorAll("thead th")[6].click()')
        assert browser.run(dates) == ["2026-02-14", "2026-11-03"]
        assert browser.run("document.documentElement.scrollWidth <= innerWidth")
        assert browser.run('getComputedStyle(document.querySelector(".bar")).width') == "120px"
        browser.events.clear()
        browser.open(bad)
        assert browser.said() == []
        assert browser.run("document.documentElement.scrollWidth <= innerWidth")


def test_the_command_names_what_it_ranked_and_what_not(folder: Path, tmp_path: Path) -> None:
    words = ["leaderboard", str(folder / "packs"), "--scores-only", "--workers", "0", "--out", str(tmp_path / "p.html")]
    shown = CliRunner().invoke(app, [*words, "--limit", "1"], env={"COLUMNS": "200"})
    assert shown.exit_code == 0, shown.output
    assert re.search(r"leaderboard: .*p\.html \(\d agents in \d tables?; 0 not ranked\)", shown.stdout)
    assert "evonav-mini (first 1): 1 with 4 stages" in (tmp_path / "p.html").read_text("utf-8")
    shown = CliRunner().invoke(app, words)
    assert "incomplete: ours.evonav.zip: 1 of 24 tasks of evonav-mini" in shown.stdout
    shown = CliRunner().invoke(app, ["leaderboard", str(tmp_path)])
    assert "no packed run (*.evonav.zip)" in str(shown.exception)
