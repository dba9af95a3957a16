import csv
import io
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from made_up_run import WriteRun
from numpy.typing import NDArray
from rich.console import Console

from evonav.evaluation.metrics.navigation import agent_pairs, summarise
from evonav.report.run import load_run
from evonav.report.tables import table as tables
from evonav.report.tables.numbers import percent, rate
from evonav.report.tables.run_tables import run_tables
from evonav.report.tables.verdicts import verdict_words
from evonav.statistics import paired_effect

F64 = NDArray[np.float64]


def test_rates_are_those_of_the_metrics(write_run: WriteRun) -> None:
    run = load_run(write_run())
    rows = run.rows_by_agent()
    expected = summarise("ftu", rows["ftu"], 12)
    assert expected.sr_ci95 is not None
    assert expected.sr_ci95[0] < expected.sr_ci95[1]
    row = dict(zip(tables.headline(run.summaries).columns, tables.headline(run.summaries).rows[1], strict=True))
    low, high = (100 * end for end in expected.sr_ci95)
    assert row["SR % [95% CI]"] == f"91.7 [{low:.1f}, {high:.1f}]"
    assert (row["n"], row["success"], row["failure"]) == ("12", "11", "1")
    assert row["stages"] == "all 12"
    pairs = agent_pairs(rows)
    assert run.pairs == tuple(pairs)


def test_csv_holds_unrounded_measures(write_run: WriteRun) -> None:
    run = load_run(write_run())
    rows = {(row["agent"], row["split"]): row for row in csv.DictReader(io.StringIO(tables.summary_csv(run.summaries)))}
    summary = run.summaries[1]
    row = rows["ftu", "all"]
    assert float(row["sr"]) == summary.sr
    assert summary.spl_ci95 is not None
    assert (float(row["spl_low"]), float(row["spl_high"])) == summary.spl_ci95
    assert summary.sr_wilson95 is not None
    assert (float(row["sr_wilson_low"]), float(row["sr_wilson_high"])) == summary.sr_wilson95
    assert rows["fu", "relocated"]["sr"] == "0.0"
    assert rows["fu", "stage_1"]["n"] == "6"


def test_incomplete_runs_say_so_in_words(write_run: WriteRun) -> None:
    table = tables.headline(load_run(write_run(is_complete=False)).summaries)
    assert table.rows[1][-1] == "10 of 12, incomplete"
    assert not table.best  # rates over different stages
    assert table.rows[1][6:8] == ("1", "1")  # errored, not run: the stage that has no record
    assert "Incomplete: ftu." in table.notes[1]
    for text in (table.markdown(), table.latex()):
        assert "ncomplete" in text
    assert "Incomplete" not in "".join(tables.headline(load_run(write_run("whole")).summaries).notes)


def test_a_verdict_is_that_of_the_effect() -> None:
    houses = [f"house {i}" for i in range(12)]
    none, some = np.zeros(12), np.array([1.0, 0.0] * 6)

    def told(a: F64, b: F64, of: list[str] = houses) -> str:
        return verdict_words("fu", "ftu", paired_effect(a, b, of))

    assert told(none, some) == "ftu is ahead"
    assert told(some, none) == "fu is ahead"
    assert told(some, 1 - some) == "undecided"
    assert told(some, some) == "equal on every stage"
    assert told(none, some, ["one house"] * 12) == "too few houses (1)"


def test_causes_add_up_to_the_stages_without_success(write_run: WriteRun) -> None:
    table = tables.cause_table(load_run(write_run()).cause_counts())
    assert table.columns == ("Cause", "fu", "ftu")
    assert table.rows == (("stopped at a stale entry", "6", "0"), ("stopped without an object", "0", "1"))


def test_markup_of_every_format_is_escaped() -> None:
    table = tables.Table("t", ("Agent", "x"), (("a|b_c*&%$#{}\\~^<", "1"),), best=frozenset({(0, 1)}))
    assert r"| a\|b\_c\*&%$#{}\\~^\< | **1** |" in table.markdown()
    assert r"a|b\_c*\&\%\$\#\{\}\textbackslash{}\textasciitilde{}\textasciicircum{}<" in table.latex()
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(tables.Table("t", ("[red]Agent", "x"), (("[bold]a", "1"),)).rich())
    assert "[red]Agent" in console.export_text()


def test_latex_is_a_booktabs_tabular(write_run: WriteRun) -> None:
    lines = tables.headline(load_run(write_run()).summaries).latex().splitlines()
    assert lines[1].startswith(r"\noindent\resizebox")
    assert lines[2] == r"\begin{tabular}{lrrrrrrrr}"
    assert [lines[3], lines[5], lines[8], lines[9]] == [r"\toprule", r"\midrule", r"\bottomrule", r"\end{tabular}}"]
    assert lines[7].startswith(r"ftu & \textbf{91.7 [")
    assert r"\textbf" not in lines[6]
    assert all(line.count("&") == 8 for line in (lines[4], lines[6], lines[7]))


def test_latex_compiles_and_shrinks_to_the_line(tmp_path: Path) -> None:
    if (pdflatex := shutil.which("pdflatex")) is None:
        pytest.skip("no pdflatex")
    wide = tables.Table("t", tuple(f"column {i}" for i in range(14)), (("100_0 % & more",) * 14,), notes=("said",))
    text = "\n".join(
        (
            r"\documentclass{article}\usepackage{booktabs,graphicx}\usepackage[utf8]{inputenc}\usepackage[T1]{fontenc}",
            r"\begin{document}",
            wide.latex(),
            r"\end{document}",
        )
    )
    (tmp_path / "t.tex").write_text(text, encoding="utf-8")
    command = [pdflatex, "-interaction=nonstopmode", "-halt-on-error", "t.tex"]
    told = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert told.returncode == 0, told.stdout[-2000:]
    assert "Overfull" not in told.stdout


def test_rates_without_spread_claim_no_interval() -> None:
    assert rate(1.0, None) == "100.0 [–]"
    assert rate(0.5, (0.25, 0.75)) == "50.0 [25.0, 75.0]"
    assert rate(None, None) == "–"
    assert percent(0.5) == "50.0"


def test_paired_differences_name_who_succeeded_alone(write_run: WriteRun) -> None:
    table = run_tables(load_run(write_run()), {})[1]
    (row,) = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    # ftu alone succeeds in six second stages, fu alone in one first stage.
    assert (row["Agents"], row["only first / second"]) == ("ftu minus fu", "6 / 1")
    assert row["SR difference [95% CI]"].startswith("+41.7 [")
    # The interval leaves 0 out, p does not suffice: six houses against half a house.
    assert (row["p"], row["SR verdict"], row["SPL verdict"]) == ("0.062", "undecided", "undecided")


def test_no_name_of_an_agent_is_a_formula_in_a_spreadsheet() -> None:
    summary = summarise("=cmd()", [], 2)
    assert tables.summary_csv([summary]).splitlines()[1].startswith("'=cmd(),all,0,")
