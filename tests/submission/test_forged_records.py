"""Packed runs whose records somebody has tampered with: `verify` rejects each of them, for the right reason.

The forger corrects all scores that follow from what was altered, where they are checked first.
"""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from forged_pack import ForgedPack, assert_rejected, rescored

from evonav.submission.verify import verify
from evonav.tasks.listing import TaskFile

Rows = list[dict[str, Any]]


def failed_row(rows: Rows) -> dict[str, Any]:
    return next(row for row in rows if row["state"] == "failure")


def success_of_a_failure(rows: Rows) -> None:
    failed_row(rows)["state"] = "success"


def nearer_target(rows: Rows) -> None:
    row = failed_row(rows)
    end = row["terminal"]
    row["target"]["position_m"] = [end["x_m"], row["target"]["position_m"][1], end["z_m"]]
    rescored(row)


def guided_failure(rows: Rows) -> None:
    """A stage that counts nowhere."""
    failed_row(rows)["state"] = "guided"


def end_at_target(rows: Rows) -> None:
    row = failed_row(rows)
    row["terminal"]["x_m"], _, row["terminal"]["z_m"] = row["target"]["position_m"]
    rescored(row)


def teleport_to_target(rows: Rows) -> None:
    row = failed_row(rows)
    end_at_target(rows)
    walk = next(entry for entry in reversed(row["trace"]) if entry["action"]["kind"] == "navigate_to")
    row["trace"] = row["trace"][: walk["round"] + 1]
    walk["path_m"].append([row["terminal"]["x_m"], row["terminal"]["z_m"]])
    walk["action"] = {"reason": "there", "kind": "stop"}
    rescored(row)


def walked_twice_as_far(rows: Rows) -> None:
    """A round that is longer than a round allows, in small steps."""
    row = next(row for row in rows if sum(len(entry["path_m"]) > 4 for entry in row["trace"]) > 1)
    at = next(i for i, entry in enumerate(row["trace"]) if len(entry["path_m"]) > 4)
    trace = row["trace"]
    trace[at]["path_m"] += trace[at]["path_m"][-2::-1] + trace[at]["path_m"][1:]
    rescored(row)


def start_elsewhere(rows: Rows) -> None:
    """Stage 2 begins beside the end of stage 1."""
    rows[1]["requested_start"]["x_m"] += 0.1
    rows[1]["is_snapped"] = True


def first_start_elsewhere(rows: Rows) -> None:
    rows[0]["requested_start"]["x_m"] += 0.1
    rows[0]["is_snapped"] = True


def rounds_beyond_the_budget(rows: Rows) -> None:
    row = rows[0]
    last = row["trace"][-1]
    here = last["path_m"][-1]
    rest = {**last, "path_m": [here], "pose": {**last["pose"], "x_m": here[0], "z_m": here[1]}}
    rest["action"] = {"action": "TURN_LEFT", "kind": "move"}
    row["trace"] = [*row["trace"][:-1], {**last, "action": rest["action"], "path_m": [last["path_m"][0]]}]
    row["trace"] += [{**rest, "round": number} for number in range(len(row["trace"]), 60)]
    row["terminal"] |= {"x_m": row["trace"][-2]["path_m"][-1][0], "z_m": row["trace"][-2]["path_m"][-1][1]}
    rescored(row)


def gives_up_at_once(rows: Rows) -> None:
    """Neither a stop nor the budget ends it."""
    row = next(row for row in rows if row["num_rounds"] > 1)
    row["trace"] = row["trace"][:1]
    last = row["trace"][0]["path_m"][-1]
    row["terminal"] |= {"x_m": last[0], "z_m": last[1]}
    rescored(row)


def goes_on_after_its_stop(rows: Rows) -> None:
    row = next(row for row in rows if row["has_stopped"] and row["num_rounds"] < 50)
    row["trace"].append({**row["trace"][-1], "round": len(row["trace"])})
    rescored(row)


def round_left_out(rows: Rows) -> None:
    row = next(row for row in rows if row["num_rounds"] > 3)
    del row["trace"][1]
    rescored(row)


def rounds_exchanged(rows: Rows) -> None:
    row = next(row for row in rows if row["num_rounds"] > 3)
    row["trace"][1:3] = [{**row["trace"][2], "round": 1}, {**row["trace"][1], "round": 2}]
    rescored(row)


def stages_exchanged(rows: Rows) -> None:
    rows[0], rows[1] = {**rows[1], "stage": 1}, {**rows[0], "stage": 2}


def tasks_exchanged(rows: Rows) -> None:
    """The first three stages of both tasks."""
    first, second = rows[:3], rows[4:7]
    rows[:3] = [{**row, "task_id": first[0]["task_id"]} for row in second]
    rows[4:7] = [{**row, "task_id": second[0]["task_id"]} for row in first]


def in_row(number: int, **fields: Any) -> Callable[[Rows], None]:
    return lambda rows: rows[number].update(fields)


def in_part(part: str, **fields: Any) -> Callable[[Rows], None]:
    return lambda rows: rows[0].update({part: {**rows[0][part], **fields}})


def in_round(**fields: Any) -> Callable[[Rows], None]:
    return lambda rows: rows[0]["trace"][0].update(fields)


def in_pose(**fields: Any) -> Callable[[Rows], None]:
    return lambda rows: rows[0]["trace"][1]["pose"].update(fields)


RECORDS: dict[str, tuple[Callable[[Rows], None], str, str]] = {
    "success of a failure": (success_of_a_failure, "paths", "state is success, its path gives failure"),
    "a better SPL": (in_row(0, spl=0.999), "paths", "spl is 0.999"),
    "a better SoftSPL": (in_row(0, soft_spl=0.999), "paths", "soft_spl is 0.999"),
    "a shorter path": (in_row(0, path_length_m=0.5), "paths", "path_length_m is 0.5"),
    "a nearer end": (in_row(0, terminal_distance_m=0.1), "paths", "terminal_distance_m is 0.1"),
    "a farther start": (in_row(0, start_distance_m=90.0), "paths", "start_distance_m is 90"),
    "no reference path": (in_row(0, reference_length_m=None), "paths", "reference path"),
    "a negative reference path": (in_row(0, reference_length_m=-1.0), "paths", "impossible"),
    "a ring beyond it": (in_row(0, reference_ring_m=1e6), "paths", "impossible"),
    "another end by path": (
        in_row(0, is_geodesic_success=True, terminal_geodesic_m=5.0),
        "paths",
        "is_geodesic_success",
    ),
    "seen more often": (in_row(0, num_target_visible_rounds=49), "paths", "num_target_visible_rounds is 49"),
    "fewer rounds": (in_row(0, num_rounds=1), "paths", "num_rounds is 1"),
    "an end at the target": (end_at_target, "paths", "does not lead from start to end"),
    "a teleport to the target": (teleport_to_target, "paths", "jumps"),
    "two rounds in one": (walked_twice_as_far, "paths", "longer than a round allows"),
    "a pose beside the path": (in_pose(x_m=0.0), "paths", "jumps between rounds"),
    "no path": (in_round(path_m=[]), "paths", "a round without a path"),
    "no rounds": (in_row(0, trace=[]), "paths", "without start, end, sensing or rounds"),
    "no sensing": (in_row(0, sensing=None), "paths", "without start, end, sensing or rounds"),
    "a start beside the last end": (start_elsewhere, "paths", "does not begin where the stage before has ended"),
    "too many rounds": (rounds_beyond_the_budget, "paths", "60 rounds and stops in"),
    "no end": (gives_up_at_once, "paths", "1 rounds and stops in"),
    "rounds after a stop": (goes_on_after_its_stop, "paths", "it ends with the first stop"),
    "a round left out": (round_left_out, "paths", "not numbered"),
    "rounds exchanged": (rounds_exchanged, "paths", "jumps between rounds"),
    "too many views": (
        in_part("sensing", later_rounds={"count": 8, "spacing_deg": 45.0}),
        "paths",
        "later_rounds.count = 8",
    ),
    "a longer stride": (in_part("sensing", max_travel_m=9.0), "paths", "max_travel_m = 9.0"),
    "an error that was none": (in_row(0, error={"kind": "agent", "message": "x"}), "paths", "error is"),
    "a nearer target": (nearer_target, "targets", "target is another"),
    "a first start elsewhere": (first_start_elsewhere, "targets", "requested_start is another"),
    "another goal": (in_part("goal", category="Bed"), "targets", "goal is another"),
    "another house": (in_row(0, house="house|9"), "targets", "house is another"),
    "more stages": (in_row(0, num_stages=9), "targets", "num_stages is another"),
    "another change": (in_part("transition", num_added=3), "targets", "transition is another"),
    "a target that moved": (in_part("target", is_relocated_now=True), "targets", "target is another"),
    "a failure made guided": (guided_failure, "targets", "it is guided, the task's stage is not guided"),
    "stages exchanged": (stages_exchanged, "targets", "is another than the task's"),
    "tasks exchanged": (tasks_exchanged, "targets", "is another than the task's"),
    "a stage dropped": (lambda rows: rows.pop(), "complete", "ftu .* stage 1 instead of fu .* stage 3"),
    "a failure dropped": (lambda rows: rows.pop(1), "complete", "stage 3 instead of"),
    "a stage twice": (lambda rows: rows.append(rows[-1]), "complete", "fu .* stage 3 instead of ftu .* stage 1"),
    "a stage in place of another": (lambda rows: rows.__setitem__(1, rows[0]), "complete", "stage 1 instead of"),
    "another order": (lambda rows: rows.reverse(), "complete", "once and in order"),
    "no records": (lambda rows: rows.clear(), "complete", "ftu .* stage 1 instead of fu .* stage 1"),
    "another agent's record": (in_row(0, agent="ftu"), "complete", "ftu .* stage 1 instead of fu .* stage 1"),
    "an error": (in_row(0, state="errored"), "complete", "it is errored"),
    "a stage not run": (in_row(0, state="not_run"), "complete", "it is not_run"),
    "an unknown state": (in_row(0, state="won"), "file", "line 2: state = 'won': Input should be"),
    "an unknown field": (in_row(0, surprise=1), "file", "line 2: surprise = 1: Extra"),
    "a number as text": (in_row(0, spl="1"), "file", "spl = '1': .*number"),
    "a count with a point": (in_row(0, num_rounds=1.0), "file", r"num_rounds = 1\.0: .*integer"),
    "a list as a number": (in_row(0, spl=[1.0]), "file", "spl = .*: .*number"),
    "stage 0": (in_row(0, stage=0), "file", "stage = 0: .*greater than or equal to 1"),
    "NaN": (in_row(0, spl=float("nan")), "file", "spl = nan: .*finite"),
    "infinity": (in_row(0, reference_length_m=float("inf")), "file", "reference_length_m = inf: .*finite"),
    "a huge length": (in_row(0, reference_length_m=1e300), "file", "reference_length_m = .*: .*equal to -?1000000"),
    "a huge place": (in_pose(x_m=-1e308), "file", r"trace.1.pose.x_m = .*: .*equal to -?1000000"),
    "a huge count": (in_round(num_entries=10**400), "file", "trace.0.num_entries = "),
    "a huge counter": (in_round(counters={"decisions": 2**64}), "file", "trace.0.counters.decisions = "),
}


@pytest.mark.parametrize("name", RECORDS)
def test_forged_records_are_rejected(parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, name: str) -> None:
    forge, check, reason = RECORDS[name]
    before = copy.deepcopy(parts.rows[0])
    forge(parts.rows[0])
    assert parts.rows[0] != before
    if check in ("paths", "targets"):
        parts.claim()
    verdict = verify(parts.write(tmp_path / "f.gz"), tasks, scores_only=True)
    assert_rejected(verdict, check, reason)
    assert max(len(one.detail) for one in verdict.checks) < 3000


@pytest.mark.parametrize(
    ("forge", "found"),
    [(lambda rows: rows.pop(), 13), (lambda rows: rows.append(rows[-1]), 15), (lambda rows: rows.clear(), 7)],
)
def test_the_last_agent_has_its_records_and_no_others(
    parts: ForgedPack, tasks: list[TaskFile], tmp_path: Path, forge: Callable[[Rows], Any], found: int
) -> None:
    forge(parts.rows[-1])
    verdict = verify(parts.write(tmp_path / "f.gz"), tasks, scores_only=True)
    assert_rejected(verdict, "complete", f"{found} records of 14 stages")
