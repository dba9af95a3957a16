"""One small run and every command that prints a rate or a difference: they print the same."""

import csv
import html
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import command

import evonav
from evonav.statistics import ClusterBootstrap

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

HOUSES = Path(evonav.__file__).parent / "data" / "houses.jsonl.gz"
NUM_HOUSES, NUM_HOUSES_WITH_TWO_TASKS = 8, 4
AGENTS = ("fu", "stage-reset", "random-walk")
GROUPS = {"first": "stage_1", "moved": "relocated", "not moved": "not_relocated"}
"""Strata as `evonav breakdown` and as the summary name them."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve tasks of eight houses: an interval over tasks is another than one over houses."""
    folder = tmp_path_factory.mktemp("same")
    (folder / "tasks").mkdir()
    for seed, limit in ((0, NUM_HOUSES), (1, NUM_HOUSES_WITH_TWO_TASKS)):
        options = ("--houses", HOUSES, "--limit", limit, "--seed", seed, "--workers", 0)
        command("tasks", "generate", *options, "--out", folder / f"seed-{seed}")
        for task in (folder / f"seed-{seed}").glob("houses-*"):
            shutil.move(task, folder / "tasks" / task.name)
    command(
        *("evaluate", "--tasks", folder / "tasks", "--agent", ",".join(AGENTS), "--workers", 2),
        *("--out", folder / "run"),
    )
    command("report", folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def summary(run: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((run / "summary.json").read_text())
    return found


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def table_rows(markdown: str) -> Iterator[list[str]]:
    for line in markdown.splitlines():
        if line.startswith("| "):
            yield [cell.strip().replace("*", "").replace("\\", "") for cell in line.strip("|").split("|")]


def numbers(*cells: str) -> list[float | None]:
    return [float(cell) if cell else None for cell in cells]


def shown(value: float, ends: list[float] | None) -> str:
    """As tables round it."""
    return f"{100 * value:.1f}" + ("" if ends is None else f" [{100 * ends[0]:.1f}, {100 * ends[1]:.1f}]")


def test_the_run_tells_houses_from_tasks(summary: dict[str, Any]) -> None:
    """Or the tests below could not."""
    pairs = summary["paired_differences"]
    assert {(pair["num_tasks"], pair["num_houses"]) for pair in pairs} == {(12, 8)}
    assert {pair["sr_verdict"] for pair in pairs} == {"a", "tie"}
    assert all(summary["agents"][agent]["sr_ci95"] is not None for agent in AGENTS)


def test_unrounded_rates_are_those_of_the_summary(run: Path, summary: dict[str, Any], tmp_path: Path) -> None:
    table = {(row["agent"], row["split"]): row for row in rows_of(run / "table.csv")}
    by = [part for field in ("is_baseline", "stratum", "radius") for part in ("--by", field)]
    found = {}
    for measure in ("success", "spl"):
        command("breakdown", run, *by, "--measure", measure, "--out", tmp_path / "b.csv")
        for row in rows_of(tmp_path / "b.csv"):
            name = "all" if row["by"] == "is_baseline" or row["group"] == "2 m" else GROUPS.get(row["group"])
            measured = numbers(row["value"], row["low"], row["high"])
            if name is not None:
                assert found.setdefault((row["agent"], name, row["metric"]), measured) == measured
    for agent in AGENTS:
        alone = summary["agents"][agent]
        for name in ("all", *GROUPS.values()):
            rates = alone if name == "all" else alone["splits"][name]
            for key, field in (("sr", "success"), ("spl", "spl")):
                told = [rates[key], *(rates[f"{key}_ci95"] or (None, None))]
                row = table[agent, name]
                assert numbers(row[key], row[f"{key}_low"], row[f"{key}_high"]) == told
                assert found[agent, name, field] == [x if x is None else pytest.approx(x, abs=1e-12) for x in told]


def test_rounded_rates_are_those_of_the_summary(run: Path, summary: dict[str, Any], tmp_path: Path) -> None:
    command("report", run, "--text", "--out", tmp_path / "measures.md")
    command("paper", run, "--out", tmp_path / "paper.md", "--out", tmp_path / "paper.tex")
    measures = {row[0]: row[1:] for row in table_rows((tmp_path / "measures.md").read_text())}
    heads = next(row for row in table_rows((tmp_path / "measures.md").read_text()) if row[0] == "Measure")[1:]
    tables = (run / "table.md").read_text()
    headline = {row[0]: row for row in table_rows(tables.split("## ")[1])}
    papers = {row[0]: row for row in table_rows((tmp_path / "paper.md").read_text().split("## ")[1])}
    page = html.unescape((run / "report.html").read_text())
    latex = (tmp_path / "paper.tex").read_text()
    for agent in AGENTS:
        alone = summary["agents"][agent]
        sr, spl = shown(alone["sr"], alone["sr_ci95"]), shown(alone["spl"], alone["spl_ci95"])
        assert headline[agent][1:3] == [sr, spl]
        assert [papers[agent][2], papers[agent][4]] == [sr, spl]
        column = heads.index(agent)
        assert (measures["success (paper), %"][column], measures["success at 2 m, %"][column]) == (sr, sr)
        assert measures["SPL, %"][column] == spl
        assert sr in page
        assert spl in page
        assert agent not in ("fu", "stage-reset") or sr.partition(" ")[2] in latex


def test_rows_for_other_programs_give_the_same_intervals(run: Path, summary: dict[str, Any], tmp_path: Path) -> None:
    command("export", run, "--out", tmp_path / "stages.csv")
    rows = rows_of(tmp_path / "stages.csv")
    for agent in AGENTS:
        mine = [row for row in rows if row["agent"] == agent]
        values = np.array([[row["success"] == "true", float(row["spl"])] for row in mine], np.float64)
        sr, spl = ClusterBootstrap([row["house"] for row in mine]).column_means(values)
        alone = summary["agents"][agent]
        assert (sr.n, sr.num_clusters, sr.value) == (alone["n"], NUM_HOUSES, alone["sr"])
        assert list(sr.ci95 or ()) == alone["sr_ci95"]
        assert list(spl.ci95 or ()) == pytest.approx(alone["spl_ci95"], abs=1e-12)


def shown_words(pair: dict[str, Any]) -> list[str]:
    """A pair as tables show it: its name, then difference and verdict of SR and of SPL."""
    a, b = pair["a"], pair["b"]
    shown = [f"{b} minus {a}"]
    for key in ("sr", "spl"):
        words = {"a": f"{a} is ahead", "b": f"{b} is ahead", "tie": "undecided"}[pair[f"{key}_verdict"]]
        numbers_of = (100 * x for x in (pair[key], *pair[f"{key}_ci95"]))
        shown += ["{:+.1f} [{:+.1f}, {:+.1f}]".format(*numbers_of), words]
    return shown


def test_pairs_are_the_same_everywhere(run: Path, summary: dict[str, Any], tmp_path: Path) -> None:
    files = {kind: tmp_path / f"c.{kind}" for kind in ("csv", "md", "html")}
    command("compare", run, *(part for kind, path in files.items() for part in ("--out", path)))
    command("paper", run, "--out", tmp_path / "paper.md")
    compared = {(one["a"], one["b"]): one for one in json.loads(command("compare", run, "--json"))["comparisons"]}
    lines = {(row["a"], row["b"], row["metric"]): row for row in rows_of(files["csv"]) if row["part"] == "all"}
    paired = {row[0]: row for row in table_rows((run / "table.md").read_text().split("## ")[2])}
    overview = {row[0]: row for row in table_rows(files["md"].read_text().split("## ")[1])}
    papers = next(part for part in (tmp_path / "paper.md").read_text().split("## ") if part.startswith("Differences"))
    pages = [html.unescape(path.read_text()) for path in (run / "report.html", files["html"])]
    for pair in summary["paired_differences"]:
        a, b = pair["a"], pair["b"]
        for key, field in (("sr", "success"), ("spl", "spl")):
            effect, row = compared[a, b]["parts"][0]["effects"][field], lines[a, b, field]
            told = (pair["n"], pair["num_houses"], pair[f"{key}_p"], pair[f"{key}_holm_p"], pair[f"{key}_verdict"])
            names = ("n", "num_clusters", "p", "adjusted_p", "verdict")
            assert tuple(effect[name] for name in names) == told
            assert effect["ci95"] == pytest.approx(pair[f"{key}_ci95"], abs=1e-12)
            assert compared[a, b]["holm_p"][field] == pair[f"{key}_holm_p"]
            assert (row["verdict"], float(row["p_holm"])) == (pair[f"{key}_verdict"], pair[f"{key}_holm_p"])
            told_numbers = pytest.approx([pair[key], *pair[f"{key}_ci95"]], abs=1e-12)
            assert numbers(row["difference"], row["low"], row["high"]) == told_numbers
        shown_pair = shown_words(pair)
        row, compared_row = paired[shown_pair[0]], overview[shown_pair[0]]
        assert [row[k] for k in (0, 1, 3, 4, 6)] == shown_pair
        assert compared_row == row
        if "random-walk" not in (a, b):
            _, sr, words, spl, _ = shown_pair
            assert f"| {sr} | {row[2]} | {spl} | {pair['n']} | {words} |" in papers
        name, *told_cells = shown_pair
        for page in pages:
            cells = [cell.strip() for cell in re.findall(r"<t[dh][^>]*>([^<]*)</t[dh]>", page)]
            start = cells.index(name)
            assert set(told_cells) <= set(cells[start : start + 10])
