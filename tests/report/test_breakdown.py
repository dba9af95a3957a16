import csv
import io
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from command_line import command
from made_up_run import lettered_run, record_run, stage_record

from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.metrics.navigation import rates
from evonav.evaluation.records.schema import EndState
from evonav.report.compare.breakdown import STANDARD, breakdown, breakdown_csv, breakdown_plot, breakdown_table
from evonav.report.compare.selection import read_compared_agents
from evonav.report.plots.specs import CurvePlot
from evonav.report.run import load_run
from evonav.report.tables.run_tables import run_breakdowns, run_plots, run_tables


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return lettered_run(tmp_path / "run", {"fu": "sf" * 8 + "ss", "ftu": "ss" * 6 + "sfse-s"})


def test_every_scored_stage_is_in_one_group_and_rates_are_those_of_the_metrics(run: Path) -> None:
    sides = read_compared_agents([str(run)])
    rows = load_run(run).rows_by_agent()
    for by in STANDARD[:-1]:
        found = breakdown(sides, by)
        for agent, num_scored in (("fu", 18), ("ftu", 16)):
            expected = num_scored // 2 if by == "mode" else num_scored  # the first stage comes after nothing
            assert sum(cell.n for (_, name), cell in found.cells.items() if name == agent) == expected, by
    found = breakdown(sides, "stratum")
    assert found.groups == ("first", "moved")
    told = rates([row for row in rows["ftu"] if row.stage == 2])
    cell = found.cells["moved", "ftu"]
    assert (cell.n, cell.num_clusters, cell.value) == (told.n, 8, told.sr)
    assert cell.ci95 == told.sr_ci95 is not None
    assert found.cells["first", "ftu"].ci95 is None  # all houses agree
    assert breakdown(sides, "room-count").groups == ("2-3",)
    assert breakdown(sides, "path-length").groups == ("2-4 m",)
    assert breakdown(sides, "earlier-stages", "spl").cells["1", "fu"].value == pytest.approx(0.8 / 9)


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        ("json_remove(floor_plan, '$.rooms')", "rooms = None: expected an array"),
        ("json_set(floor_plan, '$.rooms', 5)", "rooms = integer: expected an array"),
        ("substr(floor_plan, 2)", "malformed JSON"),
    ],
)
def test_rooms_are_not_counted_in_a_damaged_floor_plan(run: Path, damage: str, told: str) -> None:
    sides = read_compared_agents([str(run)])
    with closing(sqlite3.connect(run / "records.sqlite")) as database:
        database.execute(f"UPDATE floor_plans SET floor_plan = {damage}")
        database.commit()
    with pytest.raises(StoreError, match=told):
        breakdown(sides, "room-count")


def test_any_field_groups_and_any_number_is_measured(run: Path) -> None:
    sides = read_compared_agents([str(run), "fu"])
    assert breakdown(sides, "has-stopped").groups == ("yes",)
    assert breakdown(sides, "cause").groups == ("no_object",)
    assert breakdown(sides, "num_rounds").groups == ("4",)
    assert breakdown(sides, "terminal_distance_m", "num_rounds").cells
    with pytest.raises(InvalidArgumentError, match="argument `by` is 'weather', expected one of stratum"):
        breakdown(sides, "weather")
    with pytest.raises(InvalidArgumentError, match="metric 'house' is none of"):
        breakdown(sides, "mode", "house")


def test_a_length_on_a_border_is_in_the_upper_bin(tmp_path: Path) -> None:
    lengths_m = {"a": 0.0, "b": 2.0, "c": 3.99, "d": 16.0, "e": 400.0}
    records = [
        stage_record("fu", task, 1, EndState.SUCCESS, num_stages=1).model_copy(update={"reference_length_m": length_m})
        for task, length_m in lengths_m.items()
    ]
    run = record_run(tmp_path / "run", records, dict.fromkeys(lengths_m, 1), ["fu"])
    found = breakdown(read_compared_agents([str(run)]), "path-length")
    sizes = {group: found.cells[group, "fu"].n for group in found.groups}
    assert sizes == {"0-2 m": 1, "2-4 m": 2, "16 m and more": 2}


def test_success_at_another_radius(run: Path) -> None:
    """Successes of this run end 1 m from the target, failures 3.5 m."""
    found = breakdown(read_compared_agents([str(run)]), "radius")
    assert [found.cells[group, "fu"].value for group in ("0.5 m", "1 m", "1.5 m", "3 m")] == [0, 0, 10 / 18, 10 / 18]
    plot = breakdown_plot(found)
    assert isinstance(plot, CurvePlot)
    assert [x for x, _ in plot.lines[0].points] == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]


def test_tables_and_csv_hold_n_and_interval(run: Path) -> None:
    found = breakdown(read_compared_agents([str(run)]), "stratum")
    table = breakdown_table(found)
    assert table.columns == ("stratum", "n", "fu", "ftu")
    assert table.rows[0] == ("first", "8-9", "100.0 [–]", "100.0 [–]")
    assert table.rows[1][2].startswith("11.1 [0.0, ")
    assert breakdown_table(found, is_brief=True).rows[1][2].startswith("11.1 ±")
    rows = list(csv.DictReader(io.StringIO(breakdown_csv([found]))))
    assert [(row["group"], row["agent"], row["n"]) for row in rows] == [
        ("first", "fu", "9"),
        ("first", "ftu", "8"),
        ("moved", "fu", "9"),
        ("moved", "ftu", "8"),
    ]


def test_the_command_prints_all_and_writes_what_is_asked(run: Path, tmp_path: Path) -> None:
    md, tex, table = tmp_path / "b.md", tmp_path / "b.tex", tmp_path / "b.csv"
    asked = ["breakdown", str(run), "--out", str(md), "--out", str(tex), "--out", str(table)]
    result = command(*asked)
    assert "SR by success radius" in result
    assert md.read_text().count("\n## ") + 1 == tex.read_text().count(r"\toprule") == 7
    assert len({row["by"] for row in csv.DictReader(table.read_text().splitlines())}) == 7


def test_a_page_gets_the_plots_and_tables_of_its_run(run: Path) -> None:
    loaded = load_run(run)
    plots = run_plots(loaded, run_breakdowns(loaded))
    assert [plot.title for plot, _ in plots] == [
        "SR differences, points",
        "SPL differences, points",
        "SR by stratum",
        "SPL by stratum",
        "SR by evolution",
        "SR by path length",
        "SR by earlier stages",
        "SR by success radius",
    ]
    assert all(caption.endswith(("house.", "says.")) for _, caption in plots)
    titles = [table.title for table in run_tables(loaded, run_breakdowns(loaded))]
    assert [
        title for title in ("SR by path length", "SR by rooms", "SR by success radius") if title not in titles
    ] == []


def test_a_run_without_a_stage_has_no_plot(tmp_path: Path) -> None:
    empty = load_run(record_run(tmp_path / "empty", [], {"task": 2}, ["fu"]))
    assert run_plots(empty, run_breakdowns(empty)) == []
