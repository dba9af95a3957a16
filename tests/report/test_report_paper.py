import importlib.util
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import looks_results
import numpy as np
import perception_results
import pytest
from behaviour_tables import cause_share_table, end_table, ends_of, success_by_group
from command_line import command
from made_up_run import WriteRun, entry, floor_plan, record_run, stage_record
from scipy import stats

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.navigation import AgentPair
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.paper import tables as paper
from evonav.report.paper.reweighted import reweighted_table
from evonav.report.run import load_run
from evonav.report.tables.table import markdown_tables
from evonav.statistics import paired_effect

# Tables 1 and 2 of the paper as printed: SR, SPL, SR of relocated and of not relocated targets.
PRINTED = {
    "gt": {
        "unigoal": (20.0, 14.9, 12.8, 18.7),
        "3d-mem": (47.7, 42.5, 40.4, 56.0),
        "msgnav": (59.2, 41.3, 51.4, 64.5),
        "fu": (61.1, 48.8, 54.1, 65.1),
        "stage-reset": (61.9, 45.1, 60.6, 61.4),
        "ftu": (67.4, 53.3, 68.8, 66.3),
    },
    "prediction": {
        "unigoal": (12.9, 7.9, 9.2, 10.8),
        "3d-mem": (44.1, 37.7, 40.4, 48.1),
        "msgnav": (54.8, 38.2, 50.7, 57.8),
        "fu": (42.2, 32.5, 29.4, 50.0),
        "stage-reset": (46.8, 29.6, 44.0, 49.4),
        "ftu": (49.0, 35.8, 52.3, 47.9),
    },
}
# No whole number of stages gives what is printed; the nearest one is taken.
OFF_GRID = {("prediction", "msgnav", 2), ("prediction", "3d-mem", 3), ("prediction", "ftu", 3)}


@pytest.mark.parametrize("perception", ["gt", "prediction"])
def test_decoded_counts_give_what_the_paper_prints(perception) -> None:
    assert list(paper.PAPER[perception]) == list(PRINTED[perception])
    for agent, printed in PRINTED[perception].items():
        known = paper.PAPER[perception][agent]
        decoded = (
            100 * known.num_all / 365,
            100 * known.spl,
            100 * known.num_relocated / 109,
            100 * known.num_not_relocated / 166,
        )
        for i, (ours, theirs) in enumerate(zip(decoded, printed, strict=True)):
            tolerance = 0.35 if (perception, agent, i) in OFF_GRID else 0.051
            assert ours == pytest.approx(theirs, abs=tolerance), (agent, i)
    assert 109 + 166 + 90 == 365


def test_stage_one_is_what_is_left_of_the_counts() -> None:
    first = {agent: known.num_successes("stage_1") for agent, known in paper.PAPER["gt"].items()}
    assert first == {"unigoal": 28, "3d-mem": 37, "msgnav": 53, "fu": 56, "stage-reset": 58, "ftu": 61}


def cells(table) -> dict[str, dict[str, str]]:
    return {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}


def test_ours_stand_beside_the_papers(write_run: WriteRun) -> None:
    run = load_run(write_run())
    main, relocation, _, first, order, differences = paper.paper_tables(run)
    ftu = next(s for s in run.summaries if s.agent == "ftu")
    assert ftu.sr_ci95 is not None
    low, high = (100 * end for end in ftu.sr_ci95)
    assert cells(main)["ftu"]["SR % ours"] == f"91.7 [{low:.1f}, {high:.1f}]"
    assert cells(main)["ftu"]["SR % paper"].startswith("67.4 [62.4, 72.")
    assert (cells(main)["fu"]["SPL % paper"], cells(main)["fu"]["n ours"]) == ("48.8", "12")
    # fu fails in every second stage, where the target has moved; ftu in none.
    assert cells(relocation)["fu"]["moved, ours"] == "0.0 [–], n = 6"
    assert cells(relocation)["fu"]["moved, paper"].startswith("54.1 [")
    assert cells(relocation)["ftu"]["gap, paper"] == "+2.5"
    assert cells(relocation)["ftu"]["not moved, ours"] == "–"
    assert cells(first)["fu"]["ours"] == "100.0 [–], n = 6"
    assert cells(first)["ftu"]["paper, decoded"].startswith("67.8 [")
    assert cells(order)["SR"] == {"Measure": "SR", "paper": "ftu > fu", "ours": "ftu > fu"}
    assert cells(order)["SR, stage 1"]["ours"] == "fu > ftu"
    (pair,) = differences.rows
    assert pair[:2] == ("ftu minus fu", "+6.3 [-0.6, +13.2]")
    assert pair[2].startswith("+41.7 [")
    assert pair[6:] == ("undecided", "no", "no")


def test_a_difference_may_be_in_the_papers_interval_while_the_papers_is_not_in_ours(tmp_path: Path) -> None:
    tasks = [f"task-{number}" for number in range(60)]
    records = [
        stage_record(agent, task, 1, EndState.FAILURE if (agent, task) == ("fu", "task-7") else EndState.SUCCESS)
        for agent in ("fu", "ftu")
        for task in tasks
    ]
    run = load_run(record_run(tmp_path / "run", records, dict.fromkeys(tasks, 1), ["fu", "ftu"]))
    (pair,) = paper.paper_tables(run)[-1].rows
    assert pair[2].startswith("+1.7 [+0.0, +")
    assert pair[6:] == ("undecided", "no", "yes")


def test_moved_targets_are_split_by_how_far_they_moved(tmp_path: Path) -> None:
    def moved(task_id: str, by_m: float, state: EndState) -> StageRecord:
        record = stage_record("fu", task_id, 2, state)
        x_m, y_m, z_m = record.target.position_m
        # Up and down does not count.
        first_m = (x_m - 0.6 * by_m, y_m + 3.0, z_m + 0.8 * by_m)
        target = record.target.model_copy(update={"is_relocated": True, "first_position_m": first_m})
        return record.model_copy(update={"target": target})

    records = [
        stage_record("fu", "a", 1, EndState.FAILURE),  # stage 1 is in no group
        moved("a", 2.1, EndState.SUCCESS),
        moved("b", 1.9, EndState.FAILURE),
        moved("c", 2.5, EndState.FAILURE),
        moved("d", 0.2, EndState.SUCCESS),
        moved("e", 4.0, EndState.ERRORED),  # not scored
        moved("f", 1.0, EndState.SUCCESS),
    ]
    run = load_run(record_run(tmp_path / "run", records, dict.fromkeys("abcdef", 2), ["fu"]))
    far = paper.paper_tables(run)[2]
    assert far.columns == ("Agent", "moved more than 2 m", "moved less")
    ((agent, more, less),) = far.rows
    assert agent == "fu"
    assert (more[:4], more[-6:]) == ("50.0", " n = 2")
    assert (less[:4], less[-6:]) == ("66.7", " n = 3")


def test_reweighted_rates_are_means_of_groups_by_their_share_of_the_mix(tmp_path: Path) -> None:
    """Two, three and four rooms have weights 4, 2 and 5 in the mix; 2 succeeds in 1 of 2, 3 in 0 of 1, 4 in 3 of 4."""
    num_rooms = {"a": 2, "b": 2, "c": 3, "d": 4, "e": 4, "f": 1}
    failed = EndState.FAILURE
    states = {"a": [EndState.SUCCESS], "b": [failed], "c": [failed], "d": [EndState.SUCCESS] * 2}
    states |= {"e": [EndState.SUCCESS, failed], "f": [failed]}  # one room is in no house of the mix
    records = [
        stage_record("fu", task, stage, state)
        for task, ends in states.items()
        for stage, state in enumerate(ends, start=1)
    ]
    with RunStore(tmp_path / "run", create=True) as store:
        for task, count in num_rooms.items():
            plan = floor_plan(task, 1)
            plan = plan.model_copy(update={"rooms": tuple(plan.rooms[:1]) * count})
            store.add_floor_plan(task, 1, plan.model_dump_json())
    run_dir = record_run(tmp_path / "run", records, dict.fromkeys("abcdef", 2), ["fu"])
    table = reweighted_table([load_run(run_dir)], "procthor-10k")
    (row,) = cells(table).values()
    # A house's weight is that of its group by the number of houses; a house counts with all its stages.
    mean = (4 / 2 * 1 + 2 / 1 * 0 + 5 / 2 * 3) / (4 / 2 * 2 + 2 / 1 * 1 + 5 / 2 * 4)
    assert row["SR %"].startswith(f"{100 * mean:.1f}")
    assert row["SR % paper"] == "61.1"
    later = (5 / 2 * 1) / (5 / 2 * 2)
    assert row["SR % moved"].startswith(f"{100 * later:.1f}")
    assert row["SR % not moved"] == "–"
    with pytest.raises(InvalidArgumentError, match="procthor-10k"):
        reweighted_table([load_run(run_dir)], "procthor")


def test_agents_that_the_paper_lacks_stand_without_its_figures(tmp_path: Path) -> None:
    records = [stage_record(agent, "task", 1, EndState.SUCCESS) for agent in ("mine", "fu")]
    run = load_run(record_run(tmp_path / "run", records, {"task": 1}, ["mine", "fu"]))
    main, *_, differences = paper.paper_tables(run, "prediction")
    assert cells(main)["mine"]["SR % paper"] == "–"
    assert cells(main)["fu"]["SR % paper"].startswith("42.2 [")
    assert not differences.rows


def test_order_tells_ties_and_leaves_out_what_has_no_rate() -> None:
    values = {"fu": 0.5, "ftu": 0.7, "stage-reset": 0.5, "3d-mem": None}
    assert paper.order(values) == "ftu > fu = stage-reset"
    assert paper.order({"fu": None}) == "–"


def test_the_command_prints_and_writes_the_tables(write_run: WriteRun, tmp_path: Path) -> None:
    run_dir, out = write_run(), tmp_path / "paper.md"
    arguments = ["paper", str(run_dir), "--out", str(out), "--reweight", "procthor-10k"]
    result = command(*arguments)
    assert "Table 2: moved and not moved targets" in result
    text = out.read_text(encoding="utf-8")
    assert text.startswith(markdown_tables(paper.paper_tables(load_run(run_dir))))
    assert text.count("\n| ftu |") == 5
    assert "## Reweighted to the rooms of procthor-10k" in text
    assert text.count("\n| ftu minus fu |") == 2


def test_power_is_of_the_papers_houses(write_run: WriteRun) -> None:
    effect = replace(paired_effect(np.zeros(1), np.zeros(1), ["a"]), num_clusters=110, ci95=(-0.03, 0.03))
    pair = AgentPair("fu", "ftu", num_tasks=440, num_only_a=1, num_only_b=1, sr=effect, spl=effect)
    (row,) = paper.power_table([pair]).rows
    error = 0.03 / 1.96 * (110 / 90) ** 0.5
    assert row[:2] == ("ftu minus fu", "+6.3")
    assert float(row[3]) == pytest.approx(280.16 * error, abs=0.06)
    # 6.3 points are 3.7 standard errors.
    assert float(row[4].rstrip("%")) == pytest.approx(100 * stats.norm.cdf(23 / 365 / error - 1.96), abs=0.6)
    assert int(row[5]) == pytest.approx(90 * (2.8016 * error * 365 / 23) ** 2, abs=1)
    assert paper.power_table([replace(pair, a="mine")]).rows == ()


def latex_of(write_run: WriteRun, tmp_path: Path) -> str:
    records = [
        stage_record(agent, f"task-{i}", stage, EndState.SUCCESS if (i + stage) % k else EndState.FAILURE)
        for k, agent in ((2, "fu"), (3, "ftu"), (4, "my_agent & co"))
        for i in range(6)
        for stage in (1, 2)
    ]
    run = record_run(tmp_path / "r_1", records, {f"task-{i}": 2 for i in range(6)}, ["fu", "ftu", "my_agent & co"])
    out = tmp_path / "tables.tex"
    asked = ["paper", str(run), "--out", str(out), "--prediction", str(write_run())]
    command(*asked)
    return out.read_text(encoding="utf-8")


def test_latex_has_the_papers_layout_with_its_figures_in_grey(write_run: WriteRun, tmp_path: Path) -> None:
    text = latex_of(write_run, tmp_path)
    lines = [line for line in text.splitlines() if not line.startswith("%")]
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == text.count(r"\begin{tabular}") == 2
    assert [text.count(rule) for rule in (r"\toprule", r"\midrule", r"\bottomrule")] == [2, 4, 2]
    body = "\n".join(lines)
    assert body.count("{") == body.count("}")
    # Two heads, six agents with a grey column each, one agent that the paper lacks.
    assert r"\begin{tabular}{@{}ll" + 6 * r"c>{\color{gray}}c" + "c@{}}" in text
    rows = [line for line in lines if line.endswith(r"\\") and "multicolumn" not in line]
    assert len(rows) == 8
    assert all(line.replace(r"\&", "").count("&") == 14 for line in rows)
    assert r"my\_agent \& co" in text
    gt, spl, *_ = rows
    # Half of fu's stages succeed, two thirds of ftu's, and five sixths of the third's, which is the best.
    assert gt.endswith(r"50.0 & 61.1 & -- & 61.9 & 66.7 & \textbf{67.4} & \textbf{83.3} \\")
    assert spl.startswith(r" & SPL $\uparrow$ & -- & 14.9")
    assert "% GT, SR, ftu: 66.7" in text
    assert ", n = 12; paper n = 365" in text
    assert len([line for line in rows if "Relocated" in line]) == 4
    assert "54.1" in next(line for line in rows if r"\textbf{GT}" in line and "Relocated" in line)


def test_latex_compiles_where_there_is_a_tex(write_run: WriteRun, tmp_path: Path) -> None:
    program = next((name for name in ("tectonic", "pdflatex", "xelatex") if shutil.which(name)), None)
    if program is None:
        pytest.skip("no TeX on this machine: the tables' structure is checked above")
    page = r"\documentclass{article}\usepackage{array,booktabs,multirow,xcolor}\begin{document}"
    (tmp_path / "page.tex").write_text(f"{page}\n{latex_of(write_run, tmp_path)}\n" + r"\end{document}")
    subprocess.run([program, "page.tex"], cwd=tmp_path, check=True, capture_output=True, stdin=subprocess.DEVNULL)
    assert (tmp_path / "page.pdf").stat().st_size > 1000


def test_ends_and_causes_are_counted_over_tasks(tmp_path: Path) -> None:
    success, failure = EndState.SUCCESS, EndState.FAILURE
    stale = entry("Plate", (2.3, 0.8, 2.0), is_stale=True)
    arrived = [
        stage_record("fu", "a", 1, success),
        stage_record("fu", "a", 2, failure, chosen=stale),
        stage_record("fu", "b", 1, success),
    ]
    records = [record.model_copy(update={"stop_reason": "arrived"}) for record in arrived]
    records.append(stage_record("fu", "b", 2, failure, has_stopped=False))
    run = load_run(record_run(tmp_path / "run", records, {"a": 2, "b": 2}, ["fu"]))
    assert end_table(ends_of(run)).rows == (("arrived", "3"), ("budget", "1"))
    shares = {row[0]: row[1] for row in cause_share_table(run, "relocated").rows}
    assert shares == {"n": "2", "success": "0.0", "stopped at a stale entry": "50.0", "target never in view": "50.0"}
    assert success_by_group(run, {"a": "x", "b": "x"}) == {"x": {"fu": (2, 4)}}


@pytest.fixture(scope="module")
def script():
    path = Path(__file__).parents[2] / "scripts" / "studies" / "results.py"
    spec = importlib.util.spec_from_file_location("results_script", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_script_replaces_marked_parts_alone(script) -> None:
    page = "a\n<!-- results: x -->\nold\n<!-- end of results -->\nb\n<!-- results: y -->\n<!-- end of results -->\n"
    renewed = script.with_part(page, "x", r"| \1 new |" + "\n")
    assert renewed == page.replace("old", r"| \1 new |")
    assert script.with_part(renewed, "x", "old\n") == page
    with pytest.raises(SystemExit, match="no part `z`"):
        script.with_part(page, "z", "")


def test_departures_are_with_minus_without(script, tmp_path: Path) -> None:
    def run_of(name: str, agent: str, successes: str) -> None:
        states = {task: EndState.SUCCESS if task in successes else EndState.FAILURE for task in "abcdef"}
        records = [stage_record(agent, task, 1, state, num_stages=1) for task, state in states.items()]
        record_run(tmp_path / name, records, dict.fromkeys("abcdef", 1), [agent])

    run_of("main", "3d-mem", "ab")
    run_of("plus", "3d-mem+", "abcde")
    table = script.departure_table(tmp_path, ["3d-mem"])
    ((words, agent, without, with_it, success, _, num),) = table.rows
    assert (words, agent, without, with_it, num) == ("our fallback for frontiers", "3d-mem", "33.3", "83.3", "6")
    assert success.startswith("+50.0 [")


def test_the_pages_have_every_part_that_the_scripts_write(script, write_run: WriteRun, monkeypatch) -> None:
    run_dir = write_run("main")
    monkeypatch.setattr(script, "PLOT", run_dir.parent / "plot.svg")
    page = "".join(page.read_text(encoding="utf-8") for page in script.PAGES)
    parts = script.parts(run_dir.parent, ["fu", "ftu"])
    marked = re.findall(r"<!-- results: (\S+) -->", page)
    monkeypatch.setattr(perception_results, "IMAGES", run_dir.parent)
    of_perception = perception_results.parts({"noisy:perfect": load_run(run_dir), "noisy:poor": load_run(run_dir)})
    monkeypatch.setattr(looks_results, "PLOT", run_dir.parent / "looks.svg")
    of_looks = looks_results.parts(load_run(run_dir), load_run(run_dir))
    assert sorted(marked) == sorted(parts | script.small_parts(load_run(run_dir)) | of_perception | of_looks)
    assert "+0.0" in of_looks["looks"]
    assert "| ftu" in parts["table-1"]
    dataset, house = "attr-onav-0001k-val-0100", "attr-onav-0001k-val-0100-0003-f47224"
    assert script._parts_of(f"{house}-s2") == (dataset, house, "2")
