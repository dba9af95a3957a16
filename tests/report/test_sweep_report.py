"""The report of a sweep: a page that leads to a report a cell."""

import re
from pathlib import Path

from typer.testing import CliRunner

from evonav.cli import app

SWEEP = """
agents = ["random-walk"]
seeds = [1, 2]
[tasks]
small = { folder = "bundled", limit = 1 }
"""


def test_a_sweep_has_a_page_and_a_report_a_cell(tmp_path: Path) -> None:
    (tmp_path / "sweep.toml").write_text(SWEEP)
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["sweep", str(tmp_path / "sweep.toml"), "--out", str(out), "--workers", "1"])
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(app, ["report", str(out)])
    assert done.exit_code == 0, done.output
    text = (out / "report.html").read_text("utf-8")
    links = re.findall(r'<a href="([^"]+)">', text)
    assert len(links) == 2
    for link in links:
        assert "random-walk" in (out / link).read_text("utf-8")
    assert "script-src &#39;none&#39;" in text
    elsewhere = CliRunner().invoke(app, ["report", str(out), "--out", str(tmp_path / "there")])
    assert elsewhere.exit_code == 0, elsewhere.output
    assert all((tmp_path / "there" / link).is_file() for link in links)
