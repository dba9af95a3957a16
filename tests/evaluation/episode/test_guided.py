"""Stages that the evaluator walks: the same way for every agent, observed, not scored, whatever the agent answers."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_house import CHAIR_AWAY, ToySimulator, stage_case

from evonav.agents.agent import NavigateTo, SensorConfig, Stop, ViewSchedule
from evonav.evaluation.episode import motion
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec, GuidedWalk
from evonav.evaluation.metrics.navigation import summarise
from evonav.evaluation.metrics.stage_metrics import metrics_of
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind, StageRecord
from evonav.evaluation.run.components import make_agent
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.world.pose import Pose

AGENTS = ("fu", "stage-reset", "ftu", "3d-mem", "msgnav", "unigoal")
START = Pose(1.0, 0.9, 3.0, 0.0)
TO_CHAIR = GuidedWalk(((1.0, 3.0), (1.2, 2.9)), Pose(1.2, 0.9, 2.9, math.radians(135)))
TO_BED = GuidedWalk(((1.2, 2.9), (3.4, 2.5), (4.6, 2.5), (5.2, 2.6)), Pose(5.2, 0.9, 2.6, math.radians(45)))


def pair_case(*, is_evolved):
    """Walked to the chair and to the bed; then the chair is sought, which may have moved to the bedroom's far end."""
    moves = CHAIR_AWAY if is_evolved else None
    last = stage_case(3, "Chair|1", moves=moves, mode="SALIENT_OBJECT" if is_evolved else None)
    stages = (
        replace(stage_case(1, "Chair|1"), guided=TO_CHAIR),
        replace(stage_case(2, "Bed|1"), guided=TO_BED),
        last,
    )
    return EpisodeSpec("toy", "toy", START, stages)


def run(agent, case, protocol=None):
    agent = make_agent(agent) if isinstance(agent, str) else agent
    episode = Episode(case, "a", agent, ToySimulator(), GroundTruthPerception(), protocol or ProtocolConfig(), 7)
    return [outcome.record for outcome in episode.run()]


def way(record):
    points = [point for taken in record.trace for point in taken.path_m]
    return [point for i, point in enumerate(points) if i == 0 or point != points[i - 1]]


@pytest.fixture(scope="module")
def walked():
    short = ProtocolConfig(max_rounds=2, max_actions=2)
    return {name: run(name, pair_case(is_evolved=True), short) for name in AGENTS}


@pytest.mark.parametrize("name", AGENTS)
def test_every_agent_is_walked_along_the_same_way(walked, name):
    first, second, third = walked[name]
    assert [first.state, second.state] == [EndState.GUIDED] * 2
    for record, guided in ((first, TO_CHAIR), (second, TO_BED)):
        corners = [point for point in way(record) if point in guided.path_m]
        assert corners == list(guided.path_m)
        assert record.path_length_m == pytest.approx(motion.polyline_length_m(guided.path_m))
        assert record.terminal.yaw_rad == pytest.approx(guided.end.yaw_rad)
        assert all(taken.is_action_success for taken in record.trace)
    assert (third.requested_start.x_m, third.requested_start.z_m) == TO_BED.path_m[-1]
    assert third.is_scored


@pytest.mark.parametrize("name", AGENTS)
def test_nothing_of_a_walk_is_scored(walked, name):
    first, _, third = walked[name]
    assert (first.spl, first.soft_spl, first.reference_length_m, first.has_stopped) == (None, None, None, False)
    summary = summarise(name, [metrics_of(record) for record in walked[name]], 3)
    assert (summary.n, summary.counts["guided"], summary.is_incomplete) == (1, 2, False)
    assert metrics_of(first).success is None
    assert metrics_of(first).cause is None
    assert metrics_of(third).success is not None
    assert StageRecord.model_validate_json(first.model_dump_json()) == first


def test_what_was_seen_on_the_way_is_remembered(walked):
    for name in ("fu", "ftu", "3d-mem", "msgnav"):
        _, second, third = walked[name]
        labels = {entry.label for entry in second.entries}
        assert {"Chair", "Bed"} <= labels, (name, labels)
        assert third.trace[0].num_entries >= len(labels) - 1
    # What forgets at each stage knows only what its first look at the evaluated stage shows.
    assert walked["stage-reset"][2].trace[0].num_entries < walked["fu"][2].trace[0].num_entries


def test_memory_leads_to_the_target_in_the_fixed_house_and_astray_in_the_evolved_one():
    fixed, evolved = (run("fu", pair_case(is_evolved=is_evolved))[2] for is_evolved in (False, True))
    assert fixed.state is EndState.SUCCESS
    assert fixed.spl == pytest.approx(1.0, abs=0.2)
    assert evolved.state is EndState.FAILURE
    last = evolved.trace[-1].chosen_entry
    assert (last.label, last.is_stale) == ("Chair", True)
    assert metrics_of(evolved).cause == "stale_entry"
    assert run("ftu", pair_case(is_evolved=True))[2].state is EndState.SUCCESS
    assert run("stage-reset", pair_case(is_evolved=True))[2].state is EndState.SUCCESS


def test_arms_share_all_that_precedes_the_change():
    for name in ("fu", "unigoal"):
        short = ProtocolConfig(max_rounds=1, max_actions=1)
        fixed, evolved = (run(name, pair_case(is_evolved=is_evolved), short) for is_evolved in (False, True))
        assert fixed[:2] == evolved[:2]
        assert fixed[2].effective_start == evolved[2].effective_start
        assert fixed[2].goal == evolved[2].goal


def test_runs_are_the_same_again():
    first, again = (run("ftu", pair_case(is_evolved=True)) for _ in range(2))
    assert [record.model_dump_json() for record in first] == [record.model_dump_json() for record in again]


def test_a_walk_of_the_evaluators_blocks_nothing_on_the_agents_map():
    corners = [(1.0 + 0.05 * i, 3.0 - 0.1 * (i % 2)) for i in range(50)]  # a step of it is no step forward
    zigzag = GuidedWalk(tuple(corners), Pose(*(corners[-1][0], 0.9, corners[-1][1]), 0.0))
    case = pair_case(is_evolved=False)
    case = replace(case, stages=(replace(case.stages[1], guided=zigzag), *case.stages[1:]))
    walk = run("unigoal", case, ProtocolConfig(max_rounds=1, max_actions=1))[0]
    steps = [taken.action.action.value for taken in walk.trace]
    assert walk.state is EndState.GUIDED
    assert "MOVE_FORWARD" in steps[:-1]
    assert all(taken.counters["collisions"] == 0 for taken in walk.trace)


class Told:
    """Notes what it is given, and answers what makes no sense in a walk."""

    def __init__(self, fails_at=None, motion_kind="waypoints"):
        one = ViewSchedule(1, 0.0)
        self.sensors = SensorConfig(one, one, motion=motion_kind)
        self.fails_at, self.stage, self.seen = fails_at, 0, []

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        self.stage = goal.stage

    def act(self, observation):
        self.seen.append((self.stage, observation.is_guided, observation.num_rounds_left, observation.has_arrived))
        if self.fails_at == (self.stage, len([one for one in self.seen if one[0] == self.stage])):
            raise RuntimeError("no")
        return Stop("enough") if len(self.seen) % 2 or self.sensors.motion == "actions" else NavigateTo((7.0, 4.0))


@pytest.mark.parametrize("kind", ["waypoints", "actions"])
def test_agents_of_others_are_walked_too(kind):
    agent = Told(motion_kind=kind)
    first, second, third = run(agent, pair_case(is_evolved=False))
    assert [first.state, second.state] == [EndState.GUIDED] * 2
    assert third.is_scored
    for stage, record in ((1, first), (2, second)):
        told = [one for one in agent.seen if one[0] == stage]
        assert [one[1] for one in told] == [True] * record.num_rounds
        assert [one[2] for one in told] == list(range(record.num_rounds, 0, -1))
        assert not any(one[3] for one in told)
        step_m = 0.25 if kind == "actions" else 1.0
        assert record.num_rounds == math.ceil(record.path_length_m / step_m - 1e-9) + 1
    assert [one[1] for one in agent.seen if one[0] == 3] == [False] * third.num_rounds


def test_an_agent_that_fails_in_a_walk_begins_the_evaluated_stage_where_it_ends():
    records = run(Told(fails_at=(2, 2)), pair_case(is_evolved=False))
    assert [record.state for record in records[:2]] == [EndState.GUIDED, EndState.ERRORED]
    assert records[1].error.kind is ErrorKind.AGENT
    assert records[2].failed_before == (2,)
    assert (records[2].requested_start.x_m, records[2].requested_start.z_m) == TO_BED.path_m[-1]


def test_a_walk_that_is_blocked_is_no_failure_of_the_agent():
    through_the_fridge = GuidedWalk(((1.0, 3.0), (0.5, 4.4)), Pose(0.5, 0.9, 4.4, 0.0))
    case = pair_case(is_evolved=False)
    case = replace(case, stages=(replace(case.stages[0], guided=through_the_fridge), *case.stages[1:]))
    records = run("fu", case)
    assert records[0].error.kind is ErrorKind.SIMULATION
    assert "blocked" in records[0].error.message
    assert [record.state for record in records[1:]] == [EndState.NOT_RUN] * 2


points = st.tuples(st.floats(-20, 20), st.floats(-20, 20)).map(lambda p: (round(p[0], 2), round(p[1], 2)))


@given(st.lists(points, min_size=1, max_size=8), st.sampled_from((0.25, 1.0, 3.0)))
def test_pieces_of_a_path_are_the_path(corners, travel_m):
    pieces = motion.legs(corners, travel_m)
    lengths = [motion.polyline_length_m(piece) for piece in pieces]
    assert math.fsum(lengths) == pytest.approx(motion.polyline_length_m(corners), abs=1e-6)
    assert all(length == pytest.approx(travel_m, abs=1e-6) for length in lengths[:-1])
    assert all(0.0 < length <= travel_m + 1e-6 for length in lengths)
    assert all(a[-1] == b[0] for a, b in pairwise(pieces))
    passed = [point for piece in pieces for point in piece] or [corners[0]]
    assert passed[0] == corners[0]
    assert passed[-1] == corners[-1]
    assert [point for point in corners if point not in passed] == []


def test_runs_with_walks_are_handed_in_and_verified(tmp_path):
    from typer.testing import CliRunner

    from evonav.cli import app
    from evonav.controlled.generate import generate_arms
    from evonav.controlled.layout import ControlledOptions
    from evonav.evaluation.run.evaluate import evaluate
    from evonav.house import bundled_houses
    from evonav.tasks import write_task
    from evonav.tasks.listing import task_files
    from evonav.tasks.parameters import GenerationParameters

    options = ControlledOptions(parameters=GenerationParameters(reference_image_px=64, reference_min_visible_px=10))
    house = min(bundled_houses(), key=lambda one: len(one.rooms) if len(one.rooms) > 1 else 99)
    tasks = tmp_path / "tasks"
    write_task(generate_arms(house, options, seed=0)["evolved"], tasks)
    evaluate(["fu"], task_files(tasks), tmp_path / "run", num_workers=0)
    packed = str(tmp_path / "run.zip")
    runner = CliRunner()
    assert runner.invoke(app, ["pack", str(tmp_path / "run"), "--out", packed], catch_exceptions=False).exit_code == 0
    verdict = runner.invoke(app, ["verify", packed, "--tasks", str(tasks), "--workers", "0"])
    assert verdict.exit_code == 0, verdict.output
