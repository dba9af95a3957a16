"""A second implementation of the benchmark's scores, from the raw records alone.

Written from the paper's formulas (Sec. C.2) and docs/metrics.md, with sqlite3, json and math; it imports nothing of
evonav and shares no code with it. It believes no score that a record holds: success, SPL and SoftSPL follow from poses,
paths and the reference length.
"""

import json
import math
import sqlite3
from collections import Counter, defaultdict

ERRORS = {
    "reference": "no_path",
    "decision": "decision_failure",
    "agent": "agent_error",
    "crash": "agent_error",
    "timeout": "agent_error",
}


def ground(a, b):
    """Distance on the ground plane of two points `(x, y, z)`."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[2] - b[2]) ** 2)


def walked(record):
    total = 0.0
    for taken in record["trace"]:
        points = taken["path_m"]
        for i in range(1, len(points)):
            total += math.sqrt((points[i][0] - points[i - 1][0]) ** 2 + (points[i][1] - points[i - 1][1]) ** 2)
    return total


def place(pose):
    return (pose["x_m"], pose["y_m"], pose["z_m"])


def scores(record, radius_m):
    """Success, SPL and SoftSPL."""
    target = record["target"]["position_m"]
    start_m, end_m = ground(place(record["effective_start"]), target), ground(place(record["terminal"]), target)
    is_success = end_m < radius_m
    length, shortest = walked(record), record["reference_length_m"]
    ratio = 1.0 if length == 0 and shortest == 0 else shortest / max(length, shortest)
    progress = 1.0 if start_m == 0 else max(0.0, (start_m - end_m) / start_m)
    return float(is_success), float(is_success) * ratio, progress * ratio


def is_the_target(record, entry):
    target = record["target"]
    return (
        not entry["is_stale"]
        and entry["label"] == target["category"]
        and ground(entry["centre_m"], target["position_m"]) <= 1.0
    )


def cause(record, radius_m):
    """The taxonomy of docs/metrics.md; `None` for a success."""
    if record["state"] == "not_run":
        return "not_run"
    if record["state"] == "errored":
        return ERRORS.get(record["error"]["kind"], "harness_error")
    if scores(record, radius_m)[0]:
        return None
    chosen = [taken["chosen_entry"] for taken in record["trace"]]
    if record["trace"][-1]["action"]["kind"] == "stop":
        if chosen[-1] is None:
            return "no_object"
        if chosen[-1]["is_stale"]:
            return "stale_entry"
        if chosen[-1]["label"] != record["target"]["category"]:
            return "wrong_category"
        return "stopped_short" if is_the_target(record, chosen[-1]) else "wrong_instance"
    if not any(taken["is_target_visible"] for taken in record["trace"]):
        return "never_in_view"
    if not any(is_the_target(record, entry) for entry in record["entries"]):
        return "not_remembered"
    return "not_reached" if any(entry and is_the_target(record, entry) for entry in chosen) else "not_approached"


def stratum(record):
    if record["stage"] == 1:
        return "stage_1"
    return "relocated" if record["target"]["is_relocated"] else "not_relocated"


def table(path):
    """Of every agent: counts by state and cause, and means over all scored stages and by stratum."""
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as db:
        header = dict(db.execute("SELECT key, value FROM meta"))
        texts = [row[0] for row in db.execute("SELECT record FROM stages")]
    radius_m = json.loads(header["config"])["protocol"]["success_radius_m"]
    expected = {(task, k + 1) for task, num in json.loads(header["num_stages"]).items() for k in range(num)}
    found = defaultdict(dict)
    for text in texts:
        record = json.loads(text)
        key = (record["task_id"], record["stage"])
        assert key in expected, f"{key} is no stage of the run"
        assert key not in found[record["agent"]], f"{key} is there twice"
        found[record["agent"]][key] = record
    result = {}
    for agent, records in found.items():
        values = defaultdict(list)
        for record in records.values():
            if record["state"] in ("success", "failure"):
                values["all"].append(scores(record, radius_m))
                values[stratum(record)].append(values["all"][-1])
        result[agent] = {
            "states": Counter(
                [record["state"] for record in records.values()] + ["not_run"] * len(expected - set(records))
            ),
            "causes": Counter(cause(record, radius_m) for record in records.values()),
            "means": {
                name: (len(rows), *(math.fsum(column) / len(rows) for column in zip(*rows, strict=True)))
                for name, rows in values.items()
            },
        }
    return result
