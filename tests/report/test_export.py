import csv
import json
from dataclasses import fields
from pathlib import Path

import pytest
from command_line import command
from made_up_run import WriteRun, lettered_run
from typer.testing import CliRunner

import evonav
from evonav.cli import app
from evonav.errors import StoreError
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.report.export import ROUND_COLUMNS, round_table, stage_columns, stage_table, write_table


def test_a_row_a_stage_with_every_measure(tmp_path: Path) -> None:
    run = lettered_run(tmp_path / "run", {"fu": "sfse", "=ftu": "sf"})
    files = {suffix: tmp_path / "out" / f"s.{suffix}" for suffix in ("csv", "jsonl", "parquet")}
    pytest.importorskip("pyarrow")
    command("export", run, *(f"--out={path}" for path in files.values()))
    names = [field.name for field in fields(StageMetrics)]
    rows = stage_table(run)
    assert [list(row) for row in rows] == [names] * 6
    read = list(csv.DictReader(files["csv"].read_text().splitlines()))
    assert list(read[0]) == names
    # A name that a spreadsheet would run as a formula is kept from it.
    assert [row["agent"] for row in read] == ["'=ftu"] * 2 + ["fu"] * 4
    assert [row["success"] for row in read if row["agent"] == "fu"] == ["true", "false", "true", ""]
    assert [float(row["spl"]) for row in read if row["spl"]] == [row["spl"] for row in rows if row["spl"] is not None]
    assert [json.loads(line) for line in files["jsonl"].read_text().splitlines()] == rows


def test_parquet_has_types_and_says_what_columns_hold(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    run = lettered_run(tmp_path / "run", {"fu": "sfse"})
    table = parquet.read_table(write_table(stage_table(run), stage_columns(), tmp_path / "s.parquet"))
    assert table.to_pylist() == stage_table(run)
    kinds = {name: str(table.schema.field(name).type) for name in ("agent", "stage", "success", "spl", "input_tokens")}
    assert kinds == {"agent": "string", "stage": "int64", "success": "bool", "spl": "double", "input_tokens": "int64"}
    told = table.schema.field("num_stale_at_start").metadata[b"description"].decode()
    assert told == "Entries that are stale as the stage begins."


def test_a_row_a_round(write_run: WriteRun, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    run = write_run()
    rows = list(round_table(run, ["fu"]))
    assert len(rows) == 12 * 4
    assert list(rows[0]) == list(ROUND_COLUMNS)
    assert (rows[0]["round"], rows[0]["action"], rows[0]["target_x_m"], rows[0]["is_chosen_stale"]) == (
        0,
        "navigate_to",
        2.0,
        None,
    )
    assert rows[4]["chosen_label"] == "Plate"
    assert rows[4]["is_chosen_stale"] is True
    table = parquet.read_table(write_table(rows, ROUND_COLUMNS, tmp_path / "r.parquet"))
    assert table.to_pylist() == rows


def test_a_notebook_gets_columns_in_one_line(tmp_path: Path) -> None:
    run = evonav.load_run(lettered_run(tmp_path / "run", {"fu": "sfse", "ftu": "sf"}))
    assert run.agents == ("fu", "ftu")
    assert run.config["seed"] == 3
    assert list(run.stages) == list(stage_columns())
    assert run.stages["success"] == [True, False, True, False, True, None]
    assert len(run.rounds["round"]) == 6 * 4
    assert "Run(" in repr(run)
    try:
        import pandas  # noqa: F401
    except ImportError:
        with pytest.raises(StoreError, match="pip install pandas"):
            run.to_pandas()
    else:
        assert list(run.to_pandas().columns) == list(stage_columns())
    with pytest.raises(StoreError, match="no run here"):
        evonav.load_run(tmp_path)


def test_what_cannot_be_written_is_said_and_leaves_nothing(tmp_path: Path) -> None:
    run = lettered_run(tmp_path / "run", {"fu": "sf"})
    with pytest.raises(StoreError, match=r"expected a file \.csv, \.jsonl, \.parquet"):
        write_table([], stage_columns(), tmp_path / "s.xlsx")
    broken = [*stage_table(run), {"agent": "no other column"}]
    with pytest.raises(KeyError):
        write_table(broken, stage_columns(), tmp_path / "s.csv")
    assert not list(tmp_path.glob("s.*"))
    assert CliRunner().invoke(app, ["export", str(run)]).exit_code == 2
    assert CliRunner().invoke(app, ["export", str(run), "--out", str(tmp_path / "a.txt")]).exit_code == 2
