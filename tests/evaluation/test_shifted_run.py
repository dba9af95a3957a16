"""Runs whose agents are told shifted places: they do not know the house's coordinates, and records are in them."""

from dataclasses import replace
from pathlib import Path

import pytest
from house_knowing_agents import starts
from short_tasks import short_tasks
from test_engine import records, texts
from typer.testing import CliRunner

import evonav
from evonav.cli import app
from evonav.errors import StoreError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.run import NAMES_KEY, SHIFT_KEY, RunConfig, evaluate
from evonav.replay.replay import RunReplay
from evonav.submission.file import SubmissionFile
from evonav.submission.pack import pack
from evonav.submission.packed_setup import packed_setup
from evonav.submission.verify import verify
from evonav.tasks.bundled import bundled_tasks
from evonav.tasks.listing import task_files

AGENTS = ["fu", "ftu", "msgnav", "3d-mem", "unigoal", "random-walk", "stay-still"]
SECRET = "5" * 64


@pytest.fixture(scope="module")
def bundled():
    with bundled_tasks() as directory:
        yield directory


@pytest.fixture
def known_secret(monkeypatch):
    """Make every run draw the same shifts, so that the test does the same each time."""
    monkeypatch.setattr("evonav.evaluation.run.run.secrets.token_hex", lambda _: SECRET)


def run(agents, directory, folder, *, is_shifted, num_stages=1, limit=2, num_workers=0, max_rounds=50):
    """Evaluate on the first stages of the first tasks, and return the records of each agent."""
    tasks, reader = short_tasks(directory, num_stages, limit)
    config = RunConfig(backend=Backend(tasks=reader), protocol=ProtocolConfig(max_rounds=max_rounds))
    config = replace(config, shift_coordinates=is_shifted)
    evaluate(agents, tasks, folder, config=config, num_workers=num_workers)
    return {agent: records(folder, agent) for agent in agents}


def house_coordinates(record):
    """Return the coordinates of an agent's places in a stage, but for whole ones, which counts are too."""
    found = {value for entry in record.trace for value in (entry.pose.x_m, entry.pose.z_m)}
    return {value for value in found if value != round(value)}


def test_an_agent_is_given_no_coordinate_of_the_house(bundled, tmp_path):
    agent = "house_knowing_agents:Collecting"
    for is_shifted in (False, True):
        folder = tmp_path / str(is_shifted)
        found = run([agent], bundled, folder, is_shifted=is_shifted, limit=4, num_workers=1)[agent]
        assert len(found) == 4
        for record in found:
            own = house_coordinates(record)
            assert len(own) > 1
            given = set(record.trace[-1].details["numbers"])
            assert (own & given == set()) if is_shifted else (own <= given)


def test_an_agent_that_holds_the_houses_finds_none_by_where_it_begins(bundled, tmp_path):
    """Distances stay: an agent that compares where it is on the map knows the house in any case."""
    by_place, by_shape = "house_knowing_agents:Recognising", "house_knowing_agents:RecognisingShape"
    assert len({start for _, start, _ in starts()}) == 4
    plain = run([by_place], bundled, tmp_path / "plain", is_shifted=False, num_workers=1)[by_place]
    assert [record.stop_reason for record in plain] == [record.task_id for record in plain]
    assert all(record.state is EndState.SUCCESS for record in plain)
    shifted = run([by_place, by_shape], bundled, tmp_path / "shifted", is_shifted=True, limit=4, num_workers=1)
    for record in shifted[by_place]:
        assert record.stop_reason == "no house begins here"
        assert record.terminal == record.effective_start
    assert not any(record.stop_reason == "no house begins here" for record in shifted[by_shape])


def places_of(record):
    """Yield every place of an agent that a record has, as `(x, z)`."""
    yield from ((entry.centre_m[0], entry.centre_m[2]) for entry in record.entries)
    for entry in record.trace:
        yield (entry.pose.x_m, entry.pose.z_m)
        yield from entry.path_m
        if entry.action.position_m is not None:
            yield entry.action.position_m
        if entry.action.face_m is not None:
            yield entry.action.face_m
        if entry.chosen_entry is not None:
            yield (entry.chosen_entry.centre_m[0], entry.chosen_entry.centre_m[2])
        for name in ("goal_m", "mid_term_m"):
            if entry.details.get(name) is not None:
                yield (entry.details[name][0], entry.details[name][-1])


@pytest.fixture(scope="module")
def built_in(bundled, tmp_path_factory):
    """The built-in agents on two tasks: with true places, and with shifted ones."""
    folders = {is_shifted: tmp_path_factory.mktemp("run") for is_shifted in (False, True)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("evonav.evaluation.run.run.secrets.token_hex", lambda _: SECRET)
        for is_shifted, folder in folders.items():
            run(AGENTS, bundled, folder, is_shifted=is_shifted, num_stages=2, num_workers=2)
    return folders


@pytest.mark.parametrize("agent", AGENTS)
def test_records_of_built_in_agents_are_in_the_coordinates_of_the_house(built_in, agent):
    """Every place lies in the house, from which each shift leads out. Rounding may change what an agent does."""
    plain, shifted = (records(built_in[is_shifted], agent) for is_shifted in (False, True))
    assert len(plain) == len(shifted) == 4
    assert all(record.is_scored for record in (*plain, *shifted))
    for record in shifted:
        assert all(-1.0 < coordinate_m < 25.0 for place in places_of(record) for coordinate_m in place)
    for before, after in zip(plain, shifted, strict=True):
        if before.stage == 1:
            assert after.effective_start == before.effective_start
            assert after.trace[0].pose == before.trace[0].pose
            assert after.reference_length_m == before.reference_length_m


def test_an_agent_that_does_not_reckon_with_places_does_the_same(built_in):
    plain, shifted = (records(built_in[is_shifted], "stay-still") for is_shifted in (False, True))
    assert shifted == plain


def test_an_agent_that_remembers_no_places_walks_the_same_way(built_in):
    plain, shifted = (records(built_in[is_shifted], "random-walk") for is_shifted in (False, True))
    for before, after in zip(plain, shifted, strict=True):
        assert (after.state, after.num_rounds) == (before.state, before.num_rounds)
        assert after.path_length_m == pytest.approx(before.path_length_m, abs=1e-9)
        for one, other in zip(before.trace, after.trace, strict=True):
            assert (other.pose.x_m, other.pose.z_m) == pytest.approx((one.pose.x_m, one.pose.z_m), abs=1e-9)


def test_the_header_says_it_and_a_run_without_it_has_no_such_entry(built_in):
    for is_shifted, folder in built_in.items():
        with RunStore(folder) as store:
            assert store.meta("config").get(SHIFT_KEY) == (True if is_shifted else None)


def test_records_are_the_same_for_any_number_of_workers_and_after_resuming(built_in, bundled, tmp_path, known_secret):
    agents = ["fu", "random-walk"]
    run(agents, bundled, tmp_path / "run", is_shifted=True, num_stages=2, num_workers=0)
    before = texts(tmp_path / "run")
    for agent in agents:
        assert records(tmp_path / "run", agent) == records(built_in[True], agent)
    with RunStore(tmp_path / "run") as store:
        task_id = next(iter(store.records("fu"))).task_id
        store.forget_episode("fu", task_id, 2)
    run(agents, bundled, tmp_path / "run", is_shifted=True, num_stages=2, num_workers=1)
    assert texts(tmp_path / "run") == before


def test_a_resumed_run_draws_the_same_shifts(bundled, tmp_path):
    run(["fu"], bundled, tmp_path, is_shifted=True, max_rounds=3)
    before = texts(tmp_path)
    with RunStore(tmp_path) as store:
        secret = store.meta(NAMES_KEY)
        store.forget_episode("fu", next(iter(store.records("fu"))).task_id, 1)
    run(["fu"], bundled, tmp_path, is_shifted=True, max_rounds=3)
    assert texts(tmp_path) == before
    with RunStore(tmp_path) as store:
        assert store.meta(NAMES_KEY) == secret


def test_a_run_is_resumed_with_what_it_was_begun_with(built_in, bundled):
    for is_shifted, folder in built_in.items():
        with pytest.raises(StoreError, match="shift_coordinates: there"):
            run(AGENTS, bundled, folder, is_shifted=not is_shifted, num_stages=2)


@pytest.mark.parametrize("agent", ["ftu", "unigoal"])
def test_a_replay_is_the_record_and_beliefs_are_in_the_house(built_in, bundled, agent):
    found = next(iter(records(built_in[True], agent)))
    (stage,) = RunReplay(built_in[True], lambda name: Path(bundled) / name).episode(agent, found.task_id, last_stage=1)
    assert stage.is_replayed
    assert stage.differences == ()
    assert stage.rounds[-1].entries
    for shown in stage.rounds:
        assert not shown.note
        places = [one.record.centre_m for one in shown.entries] + [one.position_m for one in shown.frontiers]
        assert all(-1.0 < coordinate_m < 25.0 for place in places for coordinate_m in place)
        assert all(abs(coordinate_m) < 26.0 for coordinate_m in shown.map.corner_m)


def test_a_packed_run_is_verified_by_its_actions(bundled, tmp_path):
    tasks = task_files(bundled, 1)
    agents = ["fu", "unigoal"]
    evaluate(agents, tasks, tmp_path / "run", config=RunConfig(shift_coordinates=True), num_workers=0)
    pack(tmp_path / "run", tmp_path / "run.zip")
    verdict = verify(tmp_path / "run.zip", tasks, limit=1)
    assert verdict.is_accepted, verdict.checks
    assert [check.name for check in verdict.checks][-1] == "actions"
    with SubmissionFile(tmp_path / "run.zip") as file:
        assert file.header.config[SHIFT_KEY] is True
        assert packed_setup(file.header).isolation.endswith("shifted coordinates")


def test_what_a_shift_leads_out_of_range_costs_the_stage(bundled, tmp_path):
    agent = "house_knowing_agents:Boasting"
    plain = run([agent], bundled, tmp_path / "plain", is_shifted=False, limit=1)[agent]
    assert [record.state for record in plain] == [EndState.FAILURE]
    (record,) = run([agent], bundled, tmp_path / "shifted", is_shifted=True, limit=1)[agent]
    assert record.error.kind is ErrorKind.AGENT
    assert "centre_m" in record.error.message
    assert "of the house's own" in record.error.message


SWEEP = """
agents = ["stay-still"]
tasks = ["bundled:1"]
workers = 0
shift_coordinates = true
"""


def test_command_sweep_and_python_have_the_option(tmp_path):
    words = ["evaluate", "--agent", "stay-still", "--limit", "1", "--workers", "0", "--shift-coordinates"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "command")])
    assert done.exit_code == 0, done.output
    (tmp_path / "sweep.toml").write_text(SWEEP)
    done = CliRunner().invoke(app, ["sweep", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "sweep")])
    assert done.exit_code == 0, done.output
    evonav.evaluate("stay-still", limit=1, workers=0, shift_coordinates=True, out=tmp_path / "python")
    (cell,) = (tmp_path / "sweep" / "runs").iterdir()
    for folder in (tmp_path / "command", cell, tmp_path / "python"):
        with RunStore(folder) as store:
            assert store.meta("config")[SHIFT_KEY] is True


def test_an_oracle_baseline_is_told_where_the_target_is_and_so_true_places(bundled, tmp_path):
    for name in ("shortest-path", "oracle-memory"):
        plain, shifted = (
            run([name], bundled, tmp_path / name / str(is_shifted), is_shifted=is_shifted, limit=1)[name]
            for is_shifted in (False, True)
        )
        assert shifted == plain
        assert shifted[0].state is EndState.SUCCESS
