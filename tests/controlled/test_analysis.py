"""Reports of controlled analyses, on made-up runs whose figures can be told by hand."""

import math

import numpy as np
import pytest
from html_page import HtmlPage
from made_up_analysis import ARMS, PAIRS, F, S, write_analysis
from typer.testing import CliRunner

from evonav.cli import app
from evonav.controlled.analysis import METRICS, claims, load_analysis, pair_tables, split_of
from evonav.controlled.layout import Arm, run_of
from evonav.controlled.page import controlled_plots, write_controlled_report
from evonav.controlled.paired_maps import highlighted_pairs, load_pair, pair_svg
from evonav.controlled.rates import Crossover, _crossing, by_rate, crossover
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.records.schema import TransitionRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.compare.compare import compare
from evonav.report.compare.selection import read_compared_agents
from evonav.report.run import load_run
from evonav.statistics import mcnemar


@pytest.fixture
def pairs(tmp_path):
    return write_analysis(tmp_path / "pairs", "pairs", ARMS, PAIRS)


def test_rates_and_changes_are_those_of_the_pairs(pairs):
    analysis = load_analysis(pairs)
    assert analysis.agents == ("fu", "stage-reset")
    assert len(analysis.keys("fu")) == len(analysis.keys("fu", "stage-reset")) == 6
    drop = analysis.effect(("fixed", "fu"), ("evolved", "fu"), METRICS["SR"])
    assert (drop.n, drop.mean_a, drop.mean_b) == (6, 5 / 6, 2 / 6)
    assert drop.difference == pytest.approx(-0.5)
    assert drop.p == pytest.approx(mcnemar(3, 0)) == pytest.approx(0.25)
    assert drop.ci95[0] < -0.5 < drop.ci95[1]
    spl = analysis.effect(("fixed", "fu"), ("evolved", "fu"), METRICS["SPL"])
    assert spl.mean_a == pytest.approx(0.8 * 5 / 6)
    more = analysis.effect_on_change("stage-reset", "fu", METRICS["SR"])
    assert more.difference == pytest.approx(-0.5 + 1 / 6)


def test_an_arm_has_the_rates_and_differences_of_its_run(pairs):
    analysis = load_analysis(pairs)
    for name, plot in zip(("sr", "spl"), controlled_plots(analysis), strict=True):
        for arm, series in zip(analysis.arms, plot.series, strict=True):
            for i, summary in enumerate(load_run(run_of(pairs, arm)).summaries):
                assert series.values[i] == pytest.approx(100 * getattr(summary, name))
                ends = getattr(summary, f"{name}_ci95")
                assert (series.intervals[i] is None) == (ends is None)
                assert ends is None or series.intervals[i] == pytest.approx([100 * end for end in ends])
    for arm in analysis.arms:
        (one,) = compare(read_compared_agents([str(run_of(pairs, arm))]))
        for name, field in (("SR", "success"), ("SPL", "spl")):
            assert analysis.effect((arm, one.a), (arm, one.b), METRICS[name]) == one.all.effects[field]


def test_pairs_that_one_arm_lacks_are_left_out(tmp_path):
    outcomes = {"fu": ([S] * 6, [F] * 6)}
    folder = write_analysis(tmp_path / "a", "pairs", ARMS, outcomes)
    with RunStore(run_of(folder, "evolved")) as store:
        store.forget_episode("fu", "task-5", 1)
    analysis = load_analysis(folder)
    assert len(analysis.keys("fu")) == 5
    assert "5" in pair_tables(analysis)[0].rows[0][1]


def test_splits_go_by_the_target_its_room_and_other_rooms(pairs):
    analysis = load_analysis(pairs)
    found = [split_of(analysis.outcomes["evolved", "fu"][task, 2]) for task in (f"task-{i}" for i in range(6))]
    assert found == ["target", "room", "target", "room", "target", "room"]
    one = analysis.outcomes["evolved", "fu"]["task-1", 2]
    with RunStore(run_of(pairs, "evolved")) as store:
        record = store.record("fu", "task-1", 2)
    elsewhere = record.model_copy(update={"transition": TransitionRecord(mode="FULL_SHUFFLE", room_id="room|2")})
    assert split_of(type(one).of(one.row, elsewhere)) == "other"
    rows = {row[0]: row[1:4] for row in pair_tables(analysis)[1].rows}
    assert rows["the target moved: fu"] == ("3", "100.0", "33.3")
    assert rows["another room changed: fu"][0] == "0"


def test_claims_say_what_holds_and_what_is_not_told_apart(tmp_path):
    many = 12
    outcomes = {"fu": ([S] * (many - 1) + [F], [F] * many), "stage-reset": ([F] * many, [F] * (many - 1) + [S])}
    folder = write_analysis(tmp_path / "many", "pairs", ARMS, outcomes, num_tasks=many)
    found = {claim.what: claim for claim in claims(load_analysis(folder))}
    assert found["fu minus stage-reset, Fixed"].verdict == "holds"
    assert found["stage-reset minus fu, Not Fixed"].verdict == "same direction, not significant"
    assert found["fu, Fixed minus Not Fixed"].effect.difference == 11 / 12
    assert {claim.effect.n for claim in found.values()} == {12, 6}


def test_of_few_houses_no_claim_is_judged(tmp_path):
    outcomes = {"fu": ([S, S, S, F], [F, F, F, F]), "stage-reset": ([F, F, F, F], [F, F, F, S])}
    folder = write_analysis(tmp_path / "few", "pairs", ARMS, outcomes, num_tasks=4)
    told = {claim.verdict for claim in claims(load_analysis(folder)) if claim.effect.difference}
    assert told == {"too few houses to tell (4)"}


def test_the_page_holds_tables_pictures_and_every_pair(pairs):
    path = write_controlled_report(pairs)
    page = HtmlPage(path)
    text = " ".join(page.texts)
    for words in ("Fixed / Not Fixed", "By what changed", "The paper's statements", "Highlighted pairs", "All pairs"):
        assert words in text
    local = [link for link in page.values("href", "src") if not link.startswith(("data:", "#"))]
    assert len([link for link in local if link.startswith("pairs/")]) >= 6
    assert all((path.parent / link).is_file() for link in local)
    for name in ("tables.md", "tables.tex", "fixed-not-fixed.svg"):
        assert (path.parent / name).stat().st_size > 100
    one = (path.parent / "pairs" / "task-0.html").read_text(encoding="utf-8")
    assert one.count('class="cell') == 4
    assert "evonav view runs/evolved --task task-0" in one
    again = {file.name: file.read_bytes() for file in path.parent.rglob("*.html")}
    write_controlled_report(pairs)
    assert again == {file.name: file.read_bytes() for file in path.parent.rglob("*.html")}


def test_telling_pairs_are_of_moved_targets_that_memory_had_found(pairs):
    analysis = load_analysis(pairs)
    assert highlighted_pairs(analysis, "fu", per_reason=9) == [
        ("misled", ("task-0", 2)),
        ("misled", ("task-2", 2)),
        ("unharmed", ("task-4", 2)),
    ]
    drawn = pair_svg(load_pair(analysis, "fu", ("task-0", 2)))
    fixed, _, evolved = drawn.partition("Not Fixed")
    assert "Fixed" in fixed
    assert evolved
    assert drawn.count("target-move") == 1 + drawn.count(".target-move")
    assert "visited" in drawn
    with pytest.raises(InvalidArgumentError, match="no task 'task-9'"):
        load_pair(analysis, "fu", ("task-9", 2))


def test_pictures_are_asked_for_by_id(pairs, tmp_path):
    runner = CliRunner()
    out = tmp_path / "p.svg"
    done = runner.invoke(
        app, ["controlled", "picture", str(pairs), "--task", "task-3", "--out", str(out)], catch_exceptions=False
    )
    assert done.exit_code == 0
    assert "task-3" in out.read_text(encoding="utf-8")
    with pytest.raises(InvalidArgumentError, match="there are fu, stage-reset"):
        runner.invoke(
            app, ["controlled", "picture", str(pairs), "--agent", "x", "--out", str(out)], catch_exceptions=False
        )


def test_a_run_that_is_missing_is_told(tmp_path):
    folder = write_analysis(tmp_path / "a", "pairs", ARMS, {})
    with pytest.raises(StoreError, match="no agent was run"):
        load_analysis(folder)


RATES = np.array([0.0, 0.5, 1.0])


@pytest.mark.parametrize(
    ("leads", "expected"),
    [
        ([0.3, 0.0, -0.3], 0.5),
        ([0.4, 0.2, 0.0], 1.0),
        ([0.2, 0.1, 0.0], 1.0),
        ([0.4, 0.3, 0.2], 2.0),
        ([0.1, 0.2, 0.3], math.inf),
        ([-0.3, -0.2, -0.1], -math.inf),
        ([-0.1, -0.2, -0.3], -0.5),
    ],
)
def test_the_crossover_is_where_the_line_falls_through_zero(leads, expected):
    assert _crossing(RATES, np.array(leads)) == pytest.approx(expected)


def test_crossovers_in_words():
    assert Crossover(0.5, (0.25, math.inf)).text() == "0.50 [0.25, >1]"
    assert Crossover(2.0, (1.5, math.inf)).text() == "none found: not overtaken at any rate [>1, >1]"
    assert Crossover(-1.0, (-math.inf, -0.2)).text().startswith("none found: stage-reset is ahead")
    assert Crossover(-math.inf, (-math.inf, 0.2)).text() == "none found [<0, 0.20]"
    assert Crossover(0.1, (-1.0, math.inf)).text() == "0.10, undetermined [<0, >1]"


def test_a_sweep_tells_rates_leads_and_crossover(tmp_path):
    arms = tuple(Arm(name=f"p{rate:.2f}", evolve_probability=rate) for rate in RATES)
    outcomes = {
        "fu": ([S] * 6, [S, S, S, F, F, F], [F] * 6),
        "stage-reset": ([S, S, S, F, F, F],) * 3,
    }
    analysis = load_analysis(write_analysis(tmp_path / "rates", "rates", arms, outcomes))
    assert [mean.value for _, mean in by_rate(analysis, "fu", METRICS["SR"])] == [1.0, 0.5, 0.0]
    found = crossover(analysis, "fu", METRICS["SR"])
    assert found.rate == pytest.approx(0.5)
    # All six houses of one kind: 1 in 64 resamples, which plain percentiles leave out and those widened for six do not.
    assert found.ci95 == pytest.approx((1 / 6, 5 / 6))
    assert crossover(analysis, "stage-reset", METRICS["SR"]) is None
    path = write_controlled_report(tmp_path / "rates")
    assert (path.parent / "rates.svg").is_file()
    assert "overtaken by stage-reset at p" in path.read_text(encoding="utf-8")
