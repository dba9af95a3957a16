"""The report in headless Chromium: no word in the console, controls that work, and no text that becomes a script."""

import re
from pathlib import Path

import pytest
from browser import XSS_CORPUS, needs_browser, probed
from command_line import command
from made_up_run import WriteRun, entry, record_run, stage_record

from evonav.evaluation.records.schema import EndState, StageError, StageRecord
from evonav.report.pages import run_page as html
from evonav.report.pages.run_page import write_report

PROBE = (Path(__file__).parent / "report_probe.js").read_text("utf-8")
FOREIGN = {"iframe", "object", "embed", "base", "link", "form", "video", "audio", "math", "animate", "foreignobject"}
"""Elements that the corpus brings; a report has one `iframe` of its own."""

pytestmark = needs_browser


@pytest.mark.slow
@pytest.mark.parametrize(("size", "is_packed"), [("1400,900", False), ("400,800", True)])
def test_a_report_can_be_worked(
    viewed_run: Path, tmp_path: Path, size: str, is_packed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if is_packed:
        monkeypatch.setattr(html, "MAX_OPEN_STAGES", 1)
    command("report", viewed_run, "--out", tmp_path / "out", "--replays", "1")
    found = probed(tmp_path / "out" / "report.html", PROBE, tmp_path, size)
    assert found["errors"] == []
    assert found["packed"] == is_packed
    assert sorted(found["rows"]) == ["fu", "random-walk"]
    assert found["tables"] >= 6
    num_stages = found["cells"] // 2
    assert num_stages >= 3
    assert found["maps"] == found["cells"] == 2 * num_stages
    assert found["squares"] >= found["cells"]
    assert found["uses"]
    assert found["overflow"] <= 0
    assert (found["nothing"], found["noTasks"], found["everything"]) == ("0 of 1 task", 0, "1 task")
    assert found["before"] == num_stages
    assert found["without"] == 0
    assert found["sorted"] == "descending"
    is_open, num_rounds = found["zoom"]
    assert is_open
    assert num_rounds > 1
    assert found["round"][0].startswith("round 1: ")
    assert found["round"][1] == 1
    assert found["zoomClosed"]
    is_open, place, sandbox, title = found["replay"]
    assert is_open
    assert place == re.sub("stage=.*", "stage=2&round=1", found["place"])
    assert sandbox == "allow-scripts"
    assert " in bundled-" in title
    assert found["apart"]
    assert found["replayClosed"] == [False, ""]
    assert found["handlers"] == []


def hostile_record(i: int, texts: list[str]) -> StageRecord:
    """Every text of a record that a user, a model or a task chose."""
    chosen = entry(texts[0], (2.3, 0.8, 2.0), is_stale=True)
    state = [EndState.FAILURE, EndState.ERRORED, EndState.SUCCESS][i % 3]
    record = stage_record(
        "fu", texts[1], i % 2 + 1, state, chosen=chosen, entries=[chosen], instruction=texts[2], category=texts[3]
    )
    trace = tuple(
        step.model_copy(update={"choice": texts[0], "details": {texts[1]: texts[2]}}) for step in record.trace
    )
    error = None if record.error is None else StageError(kind=record.error.kind, message=texts[2])
    return record.model_copy(
        update={
            "trace": trace,
            "error": error,
            "house": texts[2],
            "stop_reason": texts[3],
            "target": record.target.model_copy(update={"category": texts[0], "room_id": texts[1]}),
            "transition": record.transition.model_copy(update={"room_id": texts[3]}),
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("has_policy", [True, False])
def test_no_text_of_a_run_becomes_a_script(tmp_path: Path, has_policy: bool) -> None:
    assert len(set(XSS_CORPUS)) >= 100
    records = [
        hostile_record(i, [XSS_CORPUS[(i + k) % len(XSS_CORPUS)] for k in range(4)]) for i in range(len(XSS_CORPUS))
    ]
    run_dir = record_run(tmp_path / "run", records, {record.task_id: 2 for record in records}, ["fu"])
    page = write_report(run_dir)
    text = page.read_text("utf-8")
    if not has_policy:
        # What the page would do in a browser that knows no policies.
        text = text.replace("<head>", "<head><script>self.alert = () => { self.hacked = 1; };</script>")
        text = re.sub(r'<meta http-equiv="Content-Security-Policy" content="[^"]*">', "", text)
    page.write_text(text, "utf-8")
    found = probed(page, PROBE, tmp_path)
    assert found["errors"] == []
    assert found["cells"] >= len(XSS_CORPUS)
    assert found["groups"] >= 30
    assert found["handlers"] == []
    assert found["hacked"] == 0
    assert FOREIGN.intersection(found["tags"]) == {"iframe"}


def test_the_page_carries_its_policy_first(write_run: WriteRun) -> None:
    text = write_report(write_run()).read_text("utf-8")
    head = text.partition("<style>")[0]
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', head)
    assert policy.startswith("default-src &#39;none&#39;; script-src &#39;sha256-")
    assert "unsafe" not in policy
    assert not re.search(r"<[^>]+\sstyle=", text)


@pytest.mark.slow
def test_no_table_is_cut_off_on_a_laptop(tmp_path: Path) -> None:
    states = {"fu": "sfsff", "stage-reset": "ffsfs"}
    records = [
        stage_record(
            agent, f"task-{i:02}", j + 1, EndState.SUCCESS if (letter == "s") == (i % 4 < 3) else EndState.FAILURE
        )
        for agent, letters in states.items()
        for i in range(12)
        for j, letter in enumerate(letters)
    ]
    records = [one.model_copy(update={"num_stages": 5, "house": f"house-{one.task_id}"}) for one in records]
    run = record_run(tmp_path / "run", records, {f"task-{i:02}": 5 for i in range(12)}, list(states))
    wide = "[...document.querySelectorAll('.scroll')].filter((box) => box.scrollWidth > box.clientWidth)"
    probe = f"({{tables: document.querySelectorAll('.scroll').length, wide: {wide}.map((box) => box.innerText)}})"
    found = probed(write_report(run), probe, tmp_path, "1400,900")
    assert found["tables"] >= 6
    assert found["wide"] == []
