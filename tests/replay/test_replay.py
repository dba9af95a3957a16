"""Replays for the viewer: equal to the records or said not to be, and what they add is true."""

import itertools
import json
import math
import shutil
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from toy_house import CHAIR_AWAY, OBJECTS, make_simulator, write_tasks

from evonav.agents.baselines import NearestFrontier
from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.component import Component
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.episode.outcome import as_errored
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.encoded import encode_stage
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.generation import GenerationParameters, generate_task
from evonav.house import bundled_houses
from evonav.replay.replay import RunReplay
from evonav.replay.types import EXPLORED, FREE
from evonav.tasks.files import write_task
from evonav.tasks.listing import BUNDLED_TASKS, task_files

TOY = Backend(tasks=Component("toy_house:load_spec"), simulator=Component("test_replay:colour_simulator"))
CONFIG = RunConfig(backend=TOY, protocol=ProtocolConfig(max_rounds=12))


class ColourSimulator(type(make_simulator())):
    """The toy house with a colour a body, so that views can be compared."""

    def render(self, pose=None, *, rgb=True, instances=True):
        frame = super().render(pose, rgb=rgb, instances=True)
        colours = (np.arange(64 * 3, dtype=np.uint8).reshape(64, 3) * 83) % 251
        return replace(frame, rgb=colours[frame.instances] if rgb else None)


def colour_simulator():
    return ColourSimulator()


class Fickle(NearestFrontier):
    """Stops one round later each time that it is made."""

    num_made = itertools.count(2)

    def begin_task(self, task):
        super().begin_task(task)
        self._num_rounds = next(self.num_made)

    def act(self, observation):
        from evonav.agents.agent import Stop

        self._num_rounds -= 1
        return super().act(observation) if self._num_rounds else Stop("bored")


class Failing(FrontierUpdate):
    """Raises in the third round of stage 2."""

    def act(self, observation):
        if self._goal.stage == 2 and observation.num_rounds_left == 10:
            raise RuntimeError("no idea")
        return super().act(observation)


class Deadly(FrontierUpdate):
    """Would end the process that asks it in stage 2."""

    def act(self, observation):
        assert self._goal.stage != 2, "asked where its process was lost"
        return super().act(observation)


class Reticent(FrontierUpdate):
    """Cannot say what it holds true."""

    def explain(self):
        return replace(super().explain(), map=self._map)

    def _map(self):
        raise KeyError("belief")


def run_of(tmp_path: Path, agent: str) -> Path:
    write_tasks(tmp_path / "tasks")
    tasks = [task for task in task_files(tmp_path / "tasks") if task.task_id == "toy-moved"]
    evaluate([agent], tasks, tmp_path / "run", config=CONFIG, num_workers=0)
    return tmp_path / "run"


def replay_of(run_dir: Path, agent: str, task_id: str = "toy-moved", **options):
    return list(RunReplay(run_dir, lambda name: run_dir.parent / "tasks" / name).episode(agent, task_id, **options))


def rewrite(run_dir: Path, change):
    """Records as `change` makes them."""
    with RunStore(run_dir) as store:
        records = [change(record) for record in store.records()]
        for record in records:
            store.forget_episode(record.agent, record.task_id, 1)
        for record in records:
            store.add_stage(encode_stage(record, wall_s=0.0, cpu_s=0.0))


@pytest.fixture(scope="module")
def fu_run(tmp_path_factory):
    return run_of(tmp_path_factory.mktemp("fu"), "fu")


@pytest.fixture(scope="module")
def fu_stages(fu_run):
    return replay_of(fu_run, "fu")


@pytest.fixture
def own_fu_run(fu_run, tmp_path):
    """A copy that may be changed."""
    return Path(shutil.copytree(fu_run.parent, tmp_path / "copy")) / "run"


@pytest.mark.parametrize("agent", ["ftu", "random-walk", "shortest-path"])
def test_a_replay_equals_the_records_and_has_every_round(tmp_path, agent):
    run_dir = run_of(tmp_path, agent)
    told = []
    stages = replay_of(run_dir, agent, on_round=lambda stage, number: told.append((stage, number)))
    with RunStore(run_dir) as store:
        stored = list(store.record_texts(agent, "toy-moved"))
    assert [stage.record.model_dump_json() for stage in stages] == stored
    assert all(stage.differences == () and stage.is_replayed for stage in stages)
    for stage in stages:
        assert [step.record for step in stage.rounds] == list(stage.record.trace)
        assert all(step.pose == step.record.pose for step in stage.rounds)
        assert (stage.rounds[0].map is not None) == (agent in ("fu", "ftu"))
    assert told == [(stage.record.stage, step.record.round) for stage in stages for step in stage.rounds]
    assert [stage.record.stage for stage in replay_of(run_dir, agent, last_stage=2)] == [1, 2]


def test_views_are_drawn_in_colours_at_the_recorded_poses(fu_run, fu_stages):
    stages = fu_stages
    simulator = ColourSimulator()
    case = TOY.tasks.create(fu_run.parent / "tasks" / "toy-moved")
    simulator.reset(case.stages[2].house_json)
    for step in stages[2].rounds:
        assert len(step.views) == (7 if step.record.round == 0 else 3)
        assert step.views[-1].pose.yaw_rad == pytest.approx(step.pose.yaw_rad)
        for view in step.views:
            pose = replace(case.start, x_m=step.pose.x_m, z_m=step.pose.z_m, yaw_rad=view.pose.yaw_rad)
            wanted = simulator.render(pose).rgb
            drawn = np.asarray(Image.open(BytesIO(view.jpeg)))
            assert drawn.shape == wanted.shape
            # JPEG blurs the edges of plain colours.
            assert np.median(np.abs(drawn.astype(int) - wanted)) <= 12
    assert stages[2].fov_rad == pytest.approx(math.pi / 2)


def test_beliefs_are_the_agents_and_what_is_stale_is_told_apart(fu_stages):
    stages = fu_stages
    for stage in stages:
        assert tuple(entry.record for entry in stage.rounds[-1].entries) == stage.record.entries
        for step in stage.rounds:
            assert len(step.entries) == step.record.num_entries
            assert len(step.frontiers) == step.record.num_frontiers
    moved_m = CHAIR_AWAY["Chair|1"]

    def chairs(step):
        return [entry for entry in step.entries if entry.record.label == "Chair"]

    def truth_of(entry):
        return (entry.truth.object_id, entry.truth.stood_in_stage, entry.truth.now_m)

    before = [entry for entry in chairs(stages[1].rounds[-1]) if not entry.record.is_stale]
    assert before
    assert {truth_of(entry) for entry in before} == {("Chair|1", 2, OBJECTS["Chair|1"][1])}
    first = {entry.record.entry_id: entry for entry in stages[2].rounds[0].entries}
    for entry in before:
        stale = first[entry.record.entry_id]
        assert stale.record.is_stale
        assert truth_of(stale) == ("Chair|1", 2, moved_m)
    others = [entry for entry in first.values() if entry.record.label != "Chair"]
    assert others
    assert not any(entry.record.is_stale for entry in others)


def test_maps_and_questions_are_those_of_the_round(fu_stages):
    stages = fu_stages
    steps = stages[0].rounds
    known = [int((step.map.cells > 0).sum()) for step in steps]
    assert known == sorted(known)
    assert {FREE, EXPLORED} <= set(np.unique(steps[-1].map.cells))
    # The cell that the agent stands on is free, and where it is depends on rows being z.
    for step in steps:
        col = int((step.pose.x_m - step.map.corner_m[0]) / step.map.cell_m)
        row = int((step.pose.z_m - step.map.corner_m[1]) / step.map.cell_m)
        assert step.map.cells[row, col] in (FREE, EXPLORED)
    asked = [question for stage in stages for step in stage.rounds for question in step.questions]
    assert asked
    for question in asked:
        assert (question.kind, question.outcome) == ("choose", "answered")
        words = "\n".join(content for _, content in question.parts)
        assert "Goal of the robot: Please navigate to the" in words
        named = {name for name, _, _ in question.offered}
        assert question.answer.splitlines()[0] in named
        assert all(f"{name}:" in words for name in named)
    chosen = next(step for stage in stages for step in stage.rounds if step.questions and step.record.chosen_entry)
    named = {name: number for name, _, number in chosen.questions[-1].offered}
    assert named[chosen.questions[-1].answer.splitlines()[0]] == chosen.record.chosen_entry.entry_id
    assert chosen.record.chosen_entry.entry_id in chosen.candidate_ids


def test_an_agent_that_is_not_deterministic_is_found_out(tmp_path):
    stages = replay_of(run_of(tmp_path, "test_replay:Fickle"), "test_replay:Fickle")
    assert stages[0].is_replayed
    assert any(difference.startswith("num_rounds: ") for difference in stages[0].differences)
    assert len(stages[0].rounds) == stages[0].record.num_rounds


def test_a_changed_record_is_told_with_field_and_values(own_fu_run):
    run_dir = own_fu_run
    rewrite(run_dir, lambda record: record.model_copy(update={"stop_reason": "changed"} if record.stage == 2 else {}))
    stages = replay_of(run_dir, "fu")
    assert [stage.differences for stage in stages if stage.record.stage != 2] == [(), ()]
    reason = stages[1].record.stop_reason
    assert stages[1].differences == (f'stop_reason: "changed" stored, "{reason}" replayed',)


def test_a_stage_that_errored_has_the_round_in_which_it_did(tmp_path):
    stages = replay_of(run_of(tmp_path, "test_replay:Failing"), "test_replay:Failing")
    assert [stage.record.state for stage in stages][1] is EndState.ERRORED
    assert all(stage.differences == () for stage in stages)
    last = stages[1].rounds[-1]
    assert (len(stages[1].rounds), last.record) == (3, None)
    assert last.views
    assert last.entries


@pytest.mark.parametrize("num_rounds", [0, 1])
def test_the_loss_of_an_agents_process_is_repeated_without_asking_it(tmp_path, num_rounds):
    agent = "test_replay:Deadly"
    run_dir = run_of(tmp_path, agent)

    def lose(record):
        if record.stage != 2:
            return record
        lost = record.model_copy(update={"trace": record.trace[:num_rounds]})
        return as_errored(lost, ErrorKind.CRASH, "the agent's process died (killed)")

    rewrite(run_dir, lose)
    stages = replay_of(run_dir, agent)
    assert stages[1].record.error.kind is ErrorKind.CRASH
    assert stages[1].record.error.message == "the agent's process died (killed)"
    assert len(stages[1].record.trace) == 0
    assert stages[2].record.memory_lost_at == 3
    assert stages[2].record.failed_before == (2,)
    assert {entry.record.label for entry in stages[2].rounds[0].entries} != set()
    assert stages[2].record.is_scored


def test_an_agent_lost_between_stages_begins_anew_in_the_replay(own_fu_run):
    def num_known(stages):
        return len(stages[1].rounds[0].entries)

    kept = replay_of(own_fu_run, "fu")
    lost_at = {1: None, 2: 2, 3: 2}
    rewrite(own_fu_run, lambda record: record.model_copy(update={"memory_lost_at": lost_at[record.stage]}))
    lost = replay_of(own_fu_run, "fu")
    assert [stage.record.memory_lost_at for stage in lost] == [None, 2, 2]
    assert num_known(lost) < num_known(kept)


def test_what_cannot_be_run_again_is_shown_as_recorded(own_fu_run):
    run_dir = own_fu_run

    def lose(record):
        return (
            record if record.stage < 2 else as_errored(record, ErrorKind.SIMULATOR_LOST, "the simulator's process died")
        )

    rewrite(run_dir, lose)
    stages = replay_of(run_dir, "fu")
    assert [stage.is_replayed for stage in stages] == [True, False, False]
    assert "simulator_lost" in stages[1].why_not
    assert [len(stage.rounds) for stage in stages] == [stage.record.num_rounds for stage in stages]
    assert all(step.views == () and step.map is None for step in stages[1].rounds)
    assert stages[1].floor_plan is not None


def test_an_agent_that_cannot_tell_its_belief_costs_nothing_but_that(tmp_path):
    stages = replay_of(run_of(tmp_path, "test_replay:Reticent"), "test_replay:Reticent")
    assert all(stage.differences == () for stage in stages)
    step = stages[0].rounds[0]
    assert (step.map, step.entries) == (None, ())
    assert "KeyError" in step.note


def test_bundled_tasks_replay_with_the_embedded_simulator(tmp_path):
    evaluate(["ftu"], task_files(BUNDLED_TASKS, 1), tmp_path, num_workers=0)
    (task_id,) = {task.task_id for task in task_files(BUNDLED_TASKS, 1)}
    stages = list(RunReplay(tmp_path, lambda name: BUNDLED_TASKS / name).episode("ftu", task_id))
    assert all(stage.differences == () for stage in stages)
    sizes = [len(view.jpeg) for stage in stages for step in stage.rounds for view in step.views]
    assert max(sizes) < 40_000


def test_a_house_that_changes_during_a_stage_is_replayed(tmp_path):
    during = {"during_stage": {"probability": 1.0, "rounds": [1, 3]}}
    config = GenerationParameters.model_validate_json(json.dumps({"num_stages": [3], "extensions": during}))
    task = generate_task(next(iter(bundled_houses(1))), seed=0, config=config)
    write_task(task, tmp_path / "tasks")
    evaluate(
        ["ftu"],
        task_files(tmp_path / "tasks"),
        tmp_path / "run",
        config=RunConfig(protocol=ProtocolConfig(max_rounds=5)),
        num_workers=0,
    )
    stages = replay_of(tmp_path / "run", "ftu", task.header.task_id)
    assert [stage.differences for stage in stages] == [()] * 3
    assert all(stage.record.during.at_round is not None for stage in stages)


def test_what_is_not_there_is_said(fu_run, tmp_path):
    with pytest.raises(InvalidArgumentError, match="no record of task 'x' by agent 'fu'"):
        replay_of(fu_run, "fu", "x")
    with pytest.raises(StoreError, match="no run here"):
        RunReplay(tmp_path, Path)
