import base64
import hashlib
import re
import sqlite3
import zlib
from pathlib import Path
from urllib.parse import unquote

import pytest
from html_page import HtmlPage
from made_up_run import WriteRun, record_run, stage_record

from evonav.errors import StoreError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, ErrorKind, StageError, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.report.pages import run_page as html
from evonav.report.pages.run_page import write_report
from evonav.report.run import load_run
from evonav.report.tables import run_tables as findings
from evonav.report.tables import table as tables
from evonav.report.tables.run_metadata import reproduction
from evonav.report.tables.run_tables import run_breakdowns
from evonav.tasks.listing import BUNDLED_TASKS, task_files


def test_the_page_holds_every_stage_and_fetches_nothing(write_run: WriteRun) -> None:
    run_dir = write_run()
    path = write_report(run_dir, has_maps=True)
    assert path == run_dir / "report.html"
    page = HtmlPage(path)
    assert page.count("section", "task") == 6
    assert page.count("figure", "cell") == 24
    assert page.count("figure", "success") == 6 + 11
    assert len([a for tag, a in page.elements if tag == "i" and (a.get("title") or "").startswith("stage")]) == 24
    assert len(list((run_dir / "maps").glob("*.svg"))) == 24
    for reference in page.values("href"):
        assert reference.startswith("#")
        assert unquote(reference[1:]) in page.ids
    assert not [a for tag, a in page.elements if tag in ("script", "img", "link") and (a.get("src") or a.get("href"))]
    text = path.read_text(encoding="utf-8")
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "")
    assert "@import" not in text
    assert "url(" not in text


def test_the_page_shows_the_numbers_of_the_tables(write_run: WriteRun) -> None:
    run_dir = write_run()
    text = write_report(run_dir).read_text(encoding="utf-8")
    run = load_run(run_dir)
    for table in findings.run_tables(run, run_breakdowns(run)):
        for row in table.rows:
            for cell in row:
                assert f">{cell}<" in text, cell
    assert tables.headline(run.summaries).markdown() in (run_dir / "table.md").read_text(encoding="utf-8")
    assert (run_dir / "table.tex").read_text(encoding="utf-8").startswith(tables.headline(run.summaries).latex())
    assert (run_dir / "table.csv").read_text(encoding="utf-8") == tables.summary_csv(run.summaries)
    assert "Incomplete" not in text
    assert all(digest in text for digest in run.rows_sha256.values())
    assert "ftu has the highest success rate" in text


def test_an_incomplete_run_says_so(write_run: WriteRun) -> None:
    text = write_report(write_run(is_complete=False)).read_text(encoding="utf-8")
    assert "<b>Incomplete.</b> ftu: 1 errored, 1 not run of 12." in text
    assert "Errored (simulation): the floor &lt;gave&gt; way" in text
    assert "This stage has no record yet." in text


def test_a_run_without_a_stage_says_so(tmp_path: Path) -> None:
    run_dir = record_run(tmp_path / "run", [], {"task-1": 3}, ["fu"])
    text = write_report(run_dir).read_text(encoding="utf-8")
    assert "<b>Empty.</b>" in text
    HtmlPage(run_dir / "report.html")
    (tmp_path / "bare").mkdir()
    with RunStore(tmp_path / "bare", create=True):
        pass
    HtmlPage(write_report(tmp_path / "bare"))


def test_names_cannot_break_out_of_the_page(tmp_path: Path) -> None:
    wild = '../<script>alert("1")</script>&\x1b\x00'
    agent = "my_package:<Agent>"
    records = [
        stage_record(
            agent, wild, 1, EndState.FAILURE, instruction=f"Go to {wild} {{{{ 7 * 7 }}}}", category="<b>Plate"
        ),
        stage_record(agent, wild.replace("&", "+"), 1, EndState.SUCCESS),
    ]
    run_dir = record_run(tmp_path / "run", records, {}, [agent])
    path = write_report(run_dir, has_maps=True)
    text = path.read_text(encoding="utf-8")
    page = HtmlPage(path)
    assert "<script>alert" not in text
    assert "<b>Plate" not in text
    assert "\x1b" not in text
    assert "\x00" not in text
    assert "{{ 7 * 7 }}" in text
    assert page.count("section", "task") == 2
    written = {item.relative_to(tmp_path).parts[0] for item in tmp_path.rglob("*")}
    assert written == {"run"}
    assert len(list((run_dir / "maps").glob("*.svg"))) == 2


def test_many_stages_are_packed_until_they_are_looked_at(write_run: WriteRun, monkeypatch: pytest.MonkeyPatch) -> None:
    run_dir = write_run()
    sections = re.findall(r'<section class="task".*?</section>', write_report(run_dir).read_text("utf-8"), re.DOTALL)
    monkeypatch.setattr(html, "MAX_OPEN_STAGES", 23)
    path = write_report(run_dir)
    page = HtmlPage(path)
    assert page.count("section", "task") == len(sections) == 6
    assert page.count("figure", "cell") == 0
    packed = re.findall(r'<script type="text/plain" class="packed">(.*?)</script>', path.read_text("utf-8"))
    assert len(packed) == 6
    for content, section in zip(packed, sections, strict=True):
        text = zlib.decompress(base64.b64decode(content)).decode()
        assert text.count('<figure class="cell') == 4
        assert text.strip() in section
    assert [item.name for item in sorted(run_dir.iterdir()) if item.suffix == ".html"] == ["report.html"]


def test_the_same_records_give_the_same_page(write_run: WriteRun) -> None:
    run_dir = write_run()
    first = write_report(run_dir).read_bytes()
    assert write_report(run_dir).read_bytes() == first


def test_houses_are_drawn_once_a_task(write_run: WriteRun) -> None:
    text = write_report(write_run()).read_text(encoding="utf-8")
    assert len(re.findall(r'class="floor kitchen"', text)) == 6
    assert text.count("<title>fridge</title>") == 6


def test_no_run_is_an_error_that_names_the_folder(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=re.escape(str(tmp_path))):
        write_report(tmp_path)


def test_agents_come_in_the_order_of_the_paper(tmp_path: Path) -> None:
    agents = ["ftu", "a-walk", "stage-reset", "fu"]
    records = [stage_record(agent, "t", 1, EndState.SUCCESS) for agent in agents]
    assert load_run(record_run(tmp_path, records, {"t": 1}, agents)).agents == ("fu", "stage-reset", "ftu", "a-walk")


def test_what_moves_is_not_part_of_what_stages_share(write_run: WriteRun) -> None:
    text = write_report(write_run()).read_text(encoding="utf-8")
    still, _, moving = text.partition('<g class="map" id="h0s1">')
    shared = still.partition('<g class="map" id="h0">')[2]
    assert shared.count("<title>fridge</title>") == 1
    assert "dining table" not in shared
    assert "<title>dining table</title>" in moving.partition('<g class="map" id="h0s2">')[0]


def test_tasks_carry_what_the_filters_look_at(write_run: WriteRun) -> None:
    page = HtmlPage(write_report(write_run()))
    (first, second) = page.all("section", "task")[:2]
    # Of the first task each agent fails one stage, the other agent succeeding; of the second, fu fails stage 2.
    assert (first["data-failures"], first["data-disagreements"]) == ("2", "2")
    assert (second["data-failures"], second["data-disagreements"]) == ("1", "1")
    assert first["data-causes"] == "NO_OBJECT STALE_ENTRY"
    assert first["data-words"] == "task-0 plate"


def test_the_digest_is_that_of_the_rows_as_stored(write_run: WriteRun) -> None:
    run_dir = write_run()
    with RunStore(run_dir) as store:
        rows = "".join(f"{text}\n" for text in store.record_texts("fu"))
    assert load_run(run_dir).rows_sha256["fu"] == hashlib.sha256(rows.encode()).hexdigest()


def test_tasks_without_a_record_are_listed(tmp_path: Path) -> None:
    run_dir = record_run(tmp_path, [stage_record("fu", "a", 1, EndState.SUCCESS)], {"a": 2, "b": 3}, ["fu"])
    run = load_run(run_dir)
    assert dict(run.num_stages) == {"a": 2, "b": 3}
    assert run.summaries[0].counts["not_run"] == 4
    assert HtmlPage(write_report(run_dir)).count("figure", "not_run") == 4


def test_statements_follow_the_numbers(write_run: WriteRun, tmp_path: Path) -> None:
    first, second, *both = findings.statements(load_run(write_run()))
    assert first.startswith("ftu has the highest success rate, 91.7 [")
    assert second.startswith("ftu has the highest SPL, ")
    assert both[0].startswith("SR: undecided between ftu and fu: +41.7 [")
    assert both[1].startswith("SPL: undecided between ftu and fu: ")
    few = findings.statements(load_run(write_run("few", num_tasks=2)))
    assert few[2] == "2 houses: too few to tell agents apart."
    (partial,) = findings.statements(load_run(write_run("partial", is_complete=False)))
    assert partial.startswith("Not every agent has been scored on every stage")
    records = [stage_record(agent, "t", 1, EndState.SUCCESS) for agent in ("fu", "ftu")]
    tied = findings.statements(load_run(record_run(tmp_path / "tied", records, {"t": 1}, ["fu", "ftu"])))
    assert tied[0] == "fu and ftu have the same success rate, 100.0%, the highest."


def test_effort_counts_the_way_to_stale_entries(write_run: WriteRun) -> None:
    run = load_run(write_run())
    table = findings.effort_table(run)
    fu, ftu = (dict(zip(table.columns, row, strict=True)) for row in table.rows)
    # fu chose a stale entry in the three moves (1 m each) of each of its second stages.
    assert (fu["path to stale entries m"], fu["stale entries"], fu["rounds"]) == ("1.5", "0.5", "4.0")
    assert (ftu["path to stale entries m"], ftu["stale entries"]) == ("0.0", "0.0")
    assert (fu["path m"], fu["SoftSPL %"], fu["stopped itself"]) == ("3.0", "50.0", "12 of 12")
    assert run.wall_s == {"fu": [1.0] * 12, "ftu": [1.0] * 12}


def test_a_row_that_is_no_record_is_an_error_that_names_the_run(write_run: WriteRun) -> None:
    run_dir = write_run()
    with sqlite3.connect(run_dir / "records.sqlite") as database:
        database.execute("UPDATE stages SET record = '{}' WHERE task_id = 'task-2'")
    database.close()
    with pytest.raises(StoreError, match='a record is not valid: missing "agent"'):
        write_report(run_dir)


def failing(record: StageRecord, counts: list[int], **changes: object) -> StageRecord:
    """The record with a counter of failed decisions, cumulative over the task, in each of its rounds."""
    trace = tuple(
        entry.model_copy(update={"counters": {"failed_decisions": count}})
        for entry, count in zip(record.trace, counts, strict=False)
    )
    return record.model_copy(update={"trace": trace, **changes})


def test_failures_of_agents_and_their_models_are_counted(tmp_path: Path) -> None:
    lost = StageError(kind=ErrorKind.TIMEOUT, message="no answer")
    won, errored = EndState.SUCCESS, EndState.ERRORED
    records = [
        failing(stage_record("fu", "a", 1, won), [0, 1, 2, 2]),
        failing(stage_record("fu", "a", 2, won), [2, 2, 2, 2]),
        failing(stage_record("fu", "b", 1, errored), [1, 1], error=lost),
        failing(stage_record("fu", "b", 2, won), [0, 3, 3, 3], failed_before=(1,), memory_lost_at=2),
        stage_record("ftu", "a", 1, won),
    ]
    run = load_run(record_run(tmp_path / "run", records, {"a": 2, "b": 2}, ["fu", "ftu"]))
    table = findings.failure_table(run)
    assert table.rows == (("fu", "1 timeout", "6", "3", "1", "1"),)
    page = write_report(tmp_path / "run").read_text()
    assert "What failed" in page
    assert "1 timeout" in page
    assert "What failed" in (tmp_path / "run" / "table.md").read_text()


def test_a_run_without_failures_does_not_speak_of_them(write_run: WriteRun) -> None:
    assert findings.failure_table(load_run(write_run())).rows == ()
    assert "What failed" not in write_report(write_run("again")).read_text()


def test_a_report_tells_how_to_run_it_again_and_what_went_wrong(write_run: WriteRun, tmp_path: Path) -> None:
    run_dir = write_run(is_complete=False)
    command = "evonav evaluate --agents fu,ftu --tasks 'my <tasks>' --out out/run"
    trace = 'Traceback (most recent call last):\n  File "agent.py", line 3\nValueError: <b>no</b>'
    with RunStore(run_dir) as store:
        store.set_meta("sessions", [{"command": command, "python": "3.11.2", "git": "abc123"}])
        store.set_meta("task_digests", {"task-0": "f" * 64})
        (errored,) = [record for record in store.records("ftu", "task-5") if record.state is EndState.ERRORED]
        store.forget_episode("ftu", "task-5", 1)
        store.add_stage(encode_stage(errored, wall_s=1.0, cpu_s=1.0, traceback=trace))
    text = write_report(run_dir).read_text("utf-8")
    assert "evonav evaluate --agents fu,ftu --tasks &#39;my &lt;tasks&gt;&#39; --out out/run</pre>" in text
    assert "git: abc123" in text
    assert "f" * 64 in text
    assert "<b>1 × simulation</b> ftu: the floor &lt;gave&gt; way" in text
    assert "<li>ftu, task-5, stage 1</li>" in text
    assert "ValueError: &lt;b&gt;no&lt;/b&gt;</pre>" in text
    # Without notes, the command is worked out from what the run is; of unknown parts it is not.
    assert reproduction(load_run(write_run("other"))) == []


def test_a_run_notes_its_command_and_versions(tmp_path: Path) -> None:
    for agents in (["random-walk"], ["random-walk"], ["stay-still"]):
        evaluate(
            agents,
            task_files(BUNDLED_TASKS, 1),
            tmp_path,
            num_workers=0,
            config=RunConfig(protocol=ProtocolConfig(max_rounds=1)),
        )
    with RunStore(tmp_path) as store:
        sessions = store.meta("sessions")
    assert len(sessions) == 2  # the second call had nothing to do
    assert {"command", "began", "evonav", "git", "python", "platform", "cpus", "workers", "isolation"} == set(
        sessions[0]
    )


def test_a_run_is_loaded_from_its_metrics_without_parsing_traces(write_run: WriteRun) -> None:
    run_dir = write_run()
    outcomes = load_run(run_dir).outcomes
    with sqlite3.connect(run_dir / "records.sqlite") as db:
        db.execute("UPDATE stages SET record = json_set(record, '$.trace', 'no trace', '$.entries', 'no entries')")
    assert load_run(run_dir).outcomes == outcomes
