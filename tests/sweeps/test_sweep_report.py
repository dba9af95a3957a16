"""The report of a sweep: a page that leads to a report a cell."""

import re
from pathlib import Path

from command_line import command

from evonav.sweeps.report import sweep_plots
from evonav.sweeps.summary import SweepRow

SWEEP = """
name = "Two seeds"
agents = ["random-walk"]
seeds = [1, 2]
[tasks]
small = { folder = "bundled", limit = 1 }
"""


def test_a_sweep_has_a_page_and_a_report_a_cell(tmp_path: Path) -> None:
    (tmp_path / "sweep.toml").write_text(SWEEP)
    out = tmp_path / "out"
    command("sweep", tmp_path / "sweep.toml", "--out", out, "--workers", "1")
    command("report", out)
    text = (out / "report.html").read_text("utf-8")
    links = re.findall(r'<a href="([^"]+)">', text)
    assert len(links) == 2
    for link in links:
        assert "random-walk" in (out / link).read_text("utf-8")
    assert "script-src &#39;none&#39;" in text
    assert "<title>Two seeds: EvoNav-Bench sweep</title>" in text
    assert re.findall(r'">(seed \d)</a> <span class="quiet">([^<]+)<', text) == [
        ("seed 1", "gt__text__small__s1"),
        ("seed 2", "gt__text__small__s2"),
    ]
    command("report", out, "--out", tmp_path / "there")
    assert all((tmp_path / "there" / link).is_file() for link in links)


def row(cell: str, decision: str, seed: int | None, agent: str, sr: float) -> SweepRow:
    counts = {"success": 0, "failure": 0, "errored": 0, "not_run": 0}
    interval = (sr - 0.1, sr + 0.1)
    return SweepRow(cell, "embedded", "gt", decision, "a", seed, agent, 4, 4, sr, interval, sr / 2, None, counts)


def test_a_plot_pools_seeds_and_names_what_was_swept() -> None:
    rows = [row(f"{d}-{s}", d, s, a, 0.5) for d in ("right", "wrong") for s in (0, 1) for a in ("fu", "ftu")]
    rows += [row("", d, None, a, v) for d, v in (("right", 0.8), ("wrong", 0.4)) for a in ("fu", "ftu")]
    rows += [row("other-0", "other", 0, "fu", 0.2)]
    sr, spl = sweep_plots(rows)
    assert (sr.title, spl.title) == ("SR by decision", "SPL by decision")
    assert sr.groups == ("right", "wrong", "other")
    assert [one.name for one in sr.series] == ["fu", "ftu"]
    assert sr.series[0].values == (80.0, 40.0, 20.0)
    assert sr.series[1].values == (80.0, 40.0, None)
    assert spl.series[0].values[0] == 40.0
    assert sweep_plots([]) == []
