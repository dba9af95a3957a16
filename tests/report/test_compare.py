import csv
import io
import json
import re
from pathlib import Path

import pytest
from command_line import command
from made_up_run import lettered_run, stage_record
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import RunStore
from evonav.report.compare import wording as words
from evonav.report.compare.compare import Comparison, compare, comparison_json
from evonav.report.compare.selection import read_compared_agents
from evonav.report.export import csv_cell
from evonav.report.maps.stage_map import VIEW_DIR, page_name
from evonav.report.run import load_run
from evonav.report.tables.verdicts import sentence

SUCCESS = EndState.SUCCESS


def one(*words_: object, **options) -> Comparison:
    (found,) = compare(read_compared_agents([str(word) for word in words_]), **options)
    return found


def test_stages_are_paired_and_taken_apart(tmp_path: Path) -> None:
    run = lettered_run(tmp_path / "run", {"fu": "sf" * 8 + "ss", "ftu": "ss" * 6 + "sf" * 3})
    found = one(run, "ftu", "fu")
    parts = {part.key: part for part in found.parts}
    assert list(parts) == ["all", "stage_1", "relocated", "retain_group"]
    assert [parts[key].n for key in parts] == [18, 9, 9, 9]
    assert (parts["all"].num_only_a, parts["all"].num_only_b) == (1, 6)
    assert parts["all"].effects["success"].difference == pytest.approx(5 / 18)
    assert parts["relocated"].effects["success"].difference == pytest.approx(5 / 9)
    assert parts["stage_1"].effects["success"].verdict == "equal"
    assert parts["all"].effects["success"].num_clusters == 9
    assert parts["all"].effects["spl"].difference == pytest.approx(0.8 * 5 / 18)
    # Seven houses differ by one stage each: all their sign patterns are counted.
    assert parts["all"].effects["success"].p == parts["all"].mcnemar_p == pytest.approx(0.125)
    flips = [(flip.task_id, flip.stage, flip.winner) for flip in found.flips]
    assert flips == [(f"task-{i:02}", 2, "ftu") for i in range(6)] + [("task-08", 2, "fu")]
    assert {flip.cause for flip in found.flips} == {"stopped without an object"}


def test_what_is_not_compared_is_told(tmp_path: Path) -> None:
    run = lettered_run(tmp_path / "run", {"fu": "ssssssssss-e", "ftu": "sfsfsfsfesss"})
    found = one(run, "fu", "ftu")
    assert found.all.n == 9
    assert dict(found.dropped) == {"errored in ftu": 1, "not run yet in fu": 1, "errored in fu": 1}
    (line,) = words.warnings([found])
    assert "3 stages are not compared" in line


def test_runs_that_were_not_run_alike_are_refused(tmp_path: Path) -> None:
    a = lettered_run(tmp_path / "a", {"fu": "ss" * 6})
    b = lettered_run(tmp_path / "b", {"fu": "sf" * 6}, protocol=1.0, seed=4)
    with pytest.raises(InvalidArgumentError, match=r"a:fu and b:fu .*_radius_m 1.5 and 1.0.*--allow-differences"):
        one(a, b)
    found = one(a, b, allow_differences=True)
    assert (found.b, found.a) == ("a:fu", "b:fu")
    assert found.settings == {"protocol.success_radius_m": ("1.0", "1.5"), "seed": ("4", "3")}
    same = lettered_run(tmp_path / "c", {"fu": "sf" * 6}, seed=4)
    assert one(a, same).settings == {"seed": ("4", "3")}  # another seed, or model, may be compared


def test_another_stage_of_the_same_name_is_no_pair(tmp_path: Path) -> None:
    a, b = lettered_run(tmp_path / "a", {"fu": "ss" * 6}), lettered_run(tmp_path / "b", {"fu": "ss" * 5})
    moved = [stage_record("fu", "task-05", stage, SUCCESS).model_copy(update={"house": "house-99"}) for stage in (1, 2)]
    with RunStore(b) as store:
        store.set_meta("num_stages", {f"task-{i:02}": 2 for i in range(6)})
        for record in moved:
            store.add_stage(encode_stage(record, wall_s=1.0, cpu_s=1.0))
    assert dict(one(a, b).dropped) == {"another stage under the same name": 2}


def test_sides_are_named_as_runs_agents_or_both(tmp_path: Path) -> None:
    outcomes = {"fu": "ss" * 6, "ftu": "sf" * 6, "my_module:Agent": "fs" * 6}
    a, b = lettered_run(tmp_path / "a", outcomes), lettered_run(tmp_path / "b", outcomes)

    def pairs(*asked: object, **options) -> list[tuple[str, str]]:
        return [(found.b, found.a) for found in compare(read_compared_agents([str(word) for word in asked]), **options)]

    assert pairs(a) == [("ftu", "fu"), ("Agent", "fu"), ("Agent", "ftu")]
    recorded = load_run(a)
    assert pairs(a) == [(recorded.names[pair.b], recorded.names[pair.a]) for pair in recorded.pairs]  # as in the report
    assert pairs(a, "fu", "ftu") == [("fu", "ftu")]
    assert pairs(a, "my_module:Agent", "fu") == pairs(f"{a}:my_module:Agent", f"{a}:fu")
    assert pairs(a, "my_module:Agent", "fu") == [("Agent", "fu")]
    assert pairs(a, b) == [(f"a:{name}", f"b:{name}") for name in ("fu", "ftu", "Agent")]
    assert pairs(f"{a}:fu", f"{b}:ftu") == [("a:fu", "b:ftu")]
    assert pairs(a, baseline="ftu") == [("fu", "ftu"), ("Agent", "ftu")]
    for cell in ("one", "two"):
        lettered_run(tmp_path / "sweep" / "runs" / cell, outcomes)
    assert pairs(tmp_path / "sweep", "ftu", "fu") == [("two:ftu", "one:ftu"), ("two:fu", "one:fu")]
    assert pairs(f"{tmp_path / 'sweep'}:fu") == [("two:fu", "one:fu")]
    for asked, match in (
        ((a, "fu"), "two agents are needed"),
        ((a, "nobody"), "has no agent 'nobody'; it has fu, ftu"),
        (("fu", a), "'fu' is no folder of a run"),
        ((f"{a}:fu", "ftu"), "write RUN:AGENT"),
    ):
        with pytest.raises(InvalidArgumentError, match=match):
            pairs(*asked)
    with pytest.raises(InvalidArgumentError, match="baseline 'x' is none of fu"):
        pairs(a, baseline="x")
    with pytest.raises(InvalidArgumentError, match=r"metric 'house' is none of .*spl"):
        pairs(a, metrics=["house"])


def test_several_pairs_are_adjusted_and_a_tie_says_what_could_be_found(tmp_path: Path) -> None:
    run = lettered_run(tmp_path / "run", {"a": "sf" * 12, "b": "ss" * 8 + "sf" * 4, "c": "sf" * 11 + "ss"})
    found = compare(read_compared_agents([str(run)]))
    raw = [item.all.effects["success"].p for item in found]
    assert [item.all.effects["success"].adjusted_p for item in found] == [
        pytest.approx(min(1.0, p)) for p in (3 * raw[0], raw[1], 2 * raw[2])
    ]
    assert words.says(found[0]) == "b is ahead"
    undecided = sentence("a", "c", found[1].all.effects["success"], num_pairs=3)
    assert undecided.startswith(
        "SR: undecided between c and a: +4.2 [+0.0, +16.7] points (54.2 vs 50.0%, p = 1.00 by Holm"
    )
    assert undecided.endswith("12 houses reliably detect only differences of about 11.1 points or more.")
    behind = sentence("b", "a", compare(read_compared_agents([str(run), "a", "b"]))[0].all.effects["success"])
    assert behind.startswith("b is ahead by "), "the difference of the agent that is ahead, whichever is named first"
    assert "[-" not in behind
    by_rounds = compare(read_compared_agents([str(run)]), metrics=["num_rounds", "recall"])
    assert "recall" not in by_rounds[0].all.effects  # no stage has it
    assert by_rounds[0].all.effects["num_rounds"].verdict == "equal"


def test_the_files_hold_what_was_computed(tmp_path: Path) -> None:
    run = lettered_run(tmp_path / "run", {"fu": "sf" * 8, "ftu": "ss" * 6 + "sf" * 2})
    (run / VIEW_DIR).mkdir()
    (run / VIEW_DIR / page_name("task-00", "fu")).write_text("page")
    files = {name: tmp_path / "out" / f"c.{name}" for name in ("md", "tex", "csv", "html", "svg")}
    options = [f"--out={path}" for path in files.values()]
    result = command("compare", run, "ftu", "fu", *options, columns=80)
    assert (
        "ftu is ahead by 37.5 points of SR [18.8, 50.0] (87.5 vs 50.0%, p = 0.031; 16 stages in 8 houses)."
        in " ".join(result.split())
    )
    assert re.search(r"^ % +ftu +fu +difference", result, re.MULTILINE), "in the order named"
    assert max(len(line) for line in result.splitlines() if not line.startswith(("written", "note"))) <= 80
    found = one(run, "ftu", "fu")
    rows = {(row["part"], row["metric"]): row for row in csv.DictReader(io.StringIO(files["csv"].read_text()))}
    effect = found.all.effects["success"]
    assert effect.ci95 is not None
    assert float(rows["all", "success"]["low"]) == effect.ci95[0]
    assert float(rows["relocated", "success"]["difference"]) == 0.75
    again = CliRunner().invoke(app, ["compare", str(run), "ftu", "fu", "--json", "--out", str(files["csv"])])
    told = json.loads(again.stdout)  # nothing else is on standard output
    assert told == json.loads(json.dumps(comparison_json([found])))
    assert told["comparisons"][0]["parts"][0]["effects"]["success"]["verdict"] == "b"
    replays = f"evonav view {run} --task task-01 --agent ftu,fu --stage 2"
    assert replays in files["md"].read_text()
    page = files["html"].read_text()
    assert replays in page
    # Where a page is, it is linked to; from the folder of the comparison.
    assert f'href="../run/view/{page_name("task-00", "fu")}#stage=2&amp;round=1"' in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "")
    assert files["tex"].read_text().count(r"\toprule") == 2
    assert files["svg"].read_text().count("<use ") == len(found.parts)


def test_text_of_a_run_is_only_text_in_every_file(tmp_path: Path) -> None:
    evil = '=cmd|"/c calc"!A1<script>alert(1)</script>'
    run = lettered_run(tmp_path / "run", {evil: "sf" * 6, "fu": "ss" * 6})
    found = compare(read_compared_agents([str(run)]))
    from evonav.report.compare.page import comparison_page

    assert "<script" not in comparison_page(found)
    for row in csv.reader(io.StringIO(words.comparison_csv(found))):
        assert not [cell for cell in row if cell.startswith(("=", "+", "@", "\t"))]
    assert [csv_cell(value) for value in (-1.5, "-1", "@x", None, True, "a")] == ["-1.5", "'-1", "'@x", "", "true", "a"]
