"""The script behind "How much hangs on perception", on a run made up by hand."""

import perception_results as script
from made_up_run import WriteRun

from evonav.perception.shorthand import parse_perception
from evonav.report.run import load_run


def test_differences_are_of_the_same_stages_and_stand_beside_the_papers(write_run: WriteRun) -> None:
    run = load_run(write_run())
    table = script.claim_table({"noisy:perfect": run, "noisy:poor": run})
    assert table.columns == ("SR, points", "paper, GT", "paper, Prediction", "perfect", "poor")
    rows = {row[0]: row[1:] for row in table.rows}
    # ftu succeeds in 11 of 12 stages, fu in 6; the paper's counts are 246 and 223, 179 and 154 of 365.
    assert rows["FTU minus FU"][:2] == ("+6.3", "+6.8")
    assert rows["FTU minus FU"][2] == "+41.7 [+16.7, +50.0]"
    assert rows["3D-Mem minus FU"] == ("-13.4", "+1.9", "–", "–")
    # 75 less 59 and 57 less 32 of 109.
    assert rows["FTU minus FU, moved"][:2] == ("+14.7", "+22.9")


def test_what_perception_costs_is_paired_between_runs(write_run: WriteRun) -> None:
    good, worse = load_run(write_run("good")), load_run(write_run("worse", num_tasks=3))
    table = script.cost_table({"noisy:perfect": good, "noisy:poor": worse})
    assert table.columns[2] == "poor minus perfect"
    assert {row[0]: row[2] for row in table.rows} == {"fu": "+0.0", "ftu": "+0.0"}


def test_every_default_perception_is_a_word_with_a_folder_and_a_name_of_its_own() -> None:
    assert len({script.folder_of(word) for word in script.PERCEPTIONS}) == len(script.PERCEPTIONS)
    assert [script.name_of(word) for word in script.PERCEPTIONS] == [
        "perfect",
        "perfect + features",
        "good",
        "yolo-world",
        "poor",
        "mini",
    ]
    for word in script.PERCEPTIONS:
        parse_perception(word)
