"""UniGoal on the toy house: its actions, records and beliefs."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import toy_episode
from evonav_studies.variants import unigoal_as_published
from scripted_model import scripted
from toy_episode import START, belief_of, noted
from toy_house import OBJECTS, stage_case

from evonav.agents.unigoal.agent import UniGoal, UniGoalConfig
from evonav.agents.unigoal.bev import BevMap
from evonav.agents.unigoal.graphs import GraphConfig
from evonav.agents.unigoal.questions import CategoryQuestion
from evonav.agents.unigoal.scene_questions import GroupScoreQuestion, RelationLinesQuestion
from evonav.decision.rules import TextMatch
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.memory.occupancy import BLOCKED, FREE
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.tasks.vocabulary import MAP_CATEGORIES, category_image
from evonav.world.pose import Pose

SHORT = ProtocolConfig(max_actions=60)
CHAIR_TEXT = "Please navigate to the chair next to the dining table."


def run(agent, *stages, start=START, perception=None, protocol=SHORT):
    return toy_episode.run(agent, *stages, start=start, perception=perception, protocol=protocol, size_px=64)


def choices(record):
    return [entry.choice for entry in record.trace]


def cell_at(belief, place_m):
    """What a belief's map shows at `(x, z)`."""
    frame = belief.map_frame
    col, row = (math.floor((at - corner) / frame.cell_m) for at, corner in zip(place_m, frame.corner_m, strict=True))
    return belief.cells[row, col]


def blocked_m(belief):
    """Middles `(x, z)` of the blocked cells of a belief's map, in centimetres."""
    frame = belief.map_frame
    middles = (np.argwhere(belief.cells == BLOCKED)[:, ::-1] + 0.5) * frame.cell_m + frame.corner_m
    return {tuple(middle) for middle in np.round(middles * 100).astype(int).tolist()}


def test_the_goal_in_view_is_approached_confirmed_and_stopped_at():
    agent = UniGoal()
    (record,) = run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig())
    assert record.state is EndState.SUCCESS
    assert record.has_stopped
    assert len(record.trace) < 200
    seen = choices(record)
    first = seen.index("temporary detection")
    assert set(seen[:first]) == {"exploration"}
    assert seen[-1] == "confirmed detection"
    assert set(seen[first:-1]) <= {"temporary detection", "confirmed detection"}
    assert agent.explain().details["distance_m"] < 0.25


@pytest.fixture(scope="module")
def in_vain():
    """A search for what no detector knows, to the end of the budget; only as published may it be named so."""
    agent = unigoal_as_published()
    rounds = noted(agent)
    (record,) = run(agent, stage_case(1, "GarbageCan|1"), protocol=ProtocolConfig())
    return rounds, record


def test_a_category_without_a_word_never_triggers_and_the_budget_is_500_actions(in_vain):
    rounds, record = in_vain
    assert rounds[-1].said.details["category"] is None
    assert len(record.trace) == 500
    assert not record.has_stopped
    assert set(choices(record)) <= {"exploration", "stuck", "none"}


def test_with_nothing_left_to_explore_it_goes_to_random_explored_places(in_vain):
    drawn = []
    for before, after in pairwise(in_vain[0]):
        (was,), (target,) = before.belief.frontiers, after.belief.frontiers
        if target != was and after.said.counters["targets"] == 31:
            drawn.append((target.position_m, after.observation.pose, after.belief))
    assert len(drawn) >= 10
    drawn = drawn[1:]  # the first one is the last frontier
    assert len({place_m for place_m, _, _ in drawn}) == len(drawn)
    for place_m, pose, belief in drawn:
        assert cell_at(belief, place_m) == FREE
        assert math.dist(place_m, (pose.x_m, pose.z_m)) >= 0.5


def test_as_released_six_categories_are_known_as_published_all_that_are_mapped():
    for kind, category in ((UniGoal, "chair"), (unigoal_as_published, "refrigerator")):
        agent = kind()
        run(agent, stage_case(1, "Fridge|1"), protocol=ProtocolConfig(max_actions=1))
        assert agent.explain().details["category"] == category


def test_as_released_the_category_is_a_chair_after_ten_answers_that_name_none():
    model = scripted(category="none")
    (record,) = run(UniGoal(decision=model), stage_case(1, "Fridge|1"), protocol=ProtocolConfig(max_actions=1))
    assert sum(isinstance(question, CategoryQuestion) for question in model.questions) == 10
    assert record.trace[0].details["category"] == "chair"


def test_a_category_may_be_declined_and_then_nothing_is_taken_for_the_goal():
    agent = UniGoal(UniGoalConfig(graph=GraphConfig(may_decline=True)), scripted(category="none"))
    (record,) = run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig(max_actions=40))
    assert all(entry.details["category"] is None for entry in record.trace)
    assert not record.has_stopped
    agent = UniGoal(UniGoalConfig(graph=GraphConfig(may_decline=True)))
    (record,) = run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig(max_actions=1))
    assert record.trace[0].details["category"] == "bed"


class ShySight(GroundTruthPerception):
    """Ground truth that loses the bed as soon as the camera is within 1.5 m of its edge."""

    def detect(self, frame, objects):
        found = GroundTruthPerception.detect(self, frame, objects)
        if "Bed" not in found.labels:
            return found
        near_m = frame.depth_m[found.masks == found.labels.index("Bed")].min()
        labels = tuple("Blinds" if label == "Bed" and near_m < 1.5 else label for label in found.labels)
        return replace(found, labels=labels)


def test_a_goal_not_seen_again_within_a_metre_is_blacklisted_and_dropped():
    agent = UniGoal()
    (record,) = run(agent, stage_case(1, "Bed|1"), perception=ShySight(), protocol=ProtocolConfig(max_actions=150))
    seen, counters = choices(record), [entry.counters for entry in record.trace]
    dropped = next(i for i, c in enumerate(counters) if c["given_up"] == 1)
    assert seen[dropped - 1] == "temporary detection"
    assert seen[dropped] != "temporary detection"
    assert counters[dropped]["blacklisted_cells"] > 0
    assert not record.has_stopped
    assert "confirmed detection" not in seen


def test_a_blacklisted_place_is_no_goal_again_until_the_next_stage():
    agent = UniGoal()
    perception = ShySight()
    stages = (stage_case(1, "Bed|1"), stage_case(2, "Chair|1"))
    first, second = run(agent, *stages, perception=perception, protocol=ProtocolConfig(max_actions=150))
    assert first.trace[-1].counters["blacklisted_cells"] > 0
    assert second.trace[0].counters["blacklisted_cells"] == 0
    assert second.trace[0].counters["given_up"] == 0


TABLE_AWAY = {"DiningTable|1": (3.2, 0.4, 4.3), "Chair|1": (0.6, 0.45, 0.6), "Mug|1": (3.2, 0.87, 4.3)}


def test_an_obstacle_stays_when_it_is_gone_and_seals_nothing_else():
    before = []

    class Remembering(UniGoal):
        def begin_stage(self, goal):
            if goal.stage == 2:
                before.append(belief_of(self))
            super().begin_stage(goal)

    agent = Remembering()
    # Looking at the table, then with the table gone.
    start = Pose(1.0, 0.9, 3.0, 2.4)
    stages = (stage_case(1, "Chair|1"), stage_case(2, "Bed|1", moves=TABLE_AWAY, mode="FULL_SHUFFLE"))
    _, second = run(agent, *stages, start=start, protocol=ProtocolConfig())
    obstacles = blocked_m(before[0])
    assert obstacles <= blocked_m(belief_of(agent))  # nothing is taken back
    x_m, _, z_m = OBJECTS["DiningTable|1"][1]
    assert any(abs(x_cm - 100 * x_m) < 50 and abs(z_cm - 100 * z_m) < 35 for x_cm, z_cm in obstacles)
    assert second.state is EndState.SUCCESS


def test_the_scene_graph_stays_and_the_goal_graph_goes():
    noted = []

    class Noting(UniGoal):
        def begin_stage(self, goal):
            before = self.explain().entries() if goal.stage == 2 else []
            super().begin_stage(goal)
            noted.append((before, self.explain().entries()))

    model = scripted()
    first, second = run(Noting(decision=model), stage_case(1, "GarbageCan|1"), stage_case(2, "Bed|1"))
    before, after = noted[1]
    assert len(before) >= 2
    assert after == before
    # The goal is read once a stage, and again in the next one.
    assert [q.goal.stage for q in model.questions if q.kind == "goal-objects"] == [1, 2]
    categories = [{entry.details["category"] for entry in record.trace} for record in (first, second)]
    assert categories == [{"chair"}, {"bed"}]


def test_a_wrong_number_of_relation_lines_drops_the_edges():
    def one_too_many(question):
        return question.answer_text(TextMatch().answer(question).answer) + "\nchair_1 and bed_2: chair_1 is on bed_2"

    models = scripted(scene_relations=one_too_many), scripted()
    wrong, right = (UniGoal(decision=model) for model in models)
    (bad,), (good,) = (run(agent, stage_case(1, "GarbageCan|1")) for agent in (wrong, right))
    assert good.trace[-1].counters["edges"] >= 1
    assert bad.trace[-1].counters["edges"] == 0
    assert wrong.explain().entries() == right.explain().entries()
    num_asked = sum(isinstance(question, RelationLinesQuestion) for question in models[0].questions)
    assert bad.trace[-1].counters["invalid_answers"] == num_asked  # no second try


def test_a_group_score_that_is_no_number_is_zero():
    model = scripted(group_score="quite likely")
    (record,) = run(unigoal_as_published(decision=model), stage_case(1, "GarbageCan|1"))
    assert any(isinstance(question, GroupScoreQuestion) for question in model.questions)
    assert all(entry.details.get("mid_term_m") is None for entry in record.trace)


def test_as_released_the_score_is_nothing_or_a_half():
    for goal, score in (("Please navigate to the chair.", 0.5), (CHAIR_TEXT, 0.0)):
        agent = UniGoal(decision=scripted(category="none"))
        (record,) = run(agent, stage_case(1, "Chair|1", instruction=goal))
        assert {(e.details["match"], e.details["score"]) for e in record.trace} == {("zero", score)}
        assert len(agent.explain().entries()) >= 2


def test_as_published_a_node_found_whole_is_walked_to():
    text = "Please navigate to the dresser."
    agent = unigoal_as_published(decision=scripted(goal_objects="[cabinet]"))
    (record,) = run(agent, stage_case(1, "Dresser|1", instruction=text), protocol=ProtocolConfig())
    assert record.state is EndState.SUCCESS
    assert record.trace[-1].chosen_entry is not None
    assert record.trace[-1].chosen_entry.label == "Dresser"
    assert choices(record)[-1] == "confirmed graph"


def test_runs_are_the_same_every_time(in_vain):
    rounds, record = in_vain
    agent = unigoal_as_published()
    again = noted(agent)
    (shorter,) = run(agent, stage_case(1, "GarbageCan|1"), protocol=ProtocolConfig(max_actions=350))
    assert shorter.trace == record.trace[:350]
    # Places drawn when nothing is left to explore are the same ones, too.
    targets = [[one.belief.frontiers for one in noted_[:350]] for noted_ in (rounds, again)]
    assert targets[0] == targets[1]


def test_belief_shows_the_known_part_of_the_map_at_half_its_resolution():
    agent = UniGoal()
    rounds = noted(agent)
    run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig(max_actions=20))
    belief = rounds[-1].belief
    frame = belief.map_frame
    assert frame.cell_m == pytest.approx(0.1)
    assert belief.cells.shape == (frame.rows, frame.cols)
    assert {entry.label for entry in belief.entries} <= {category for category, _, _ in OBJECTS.values()}
    assert (belief.cells > 0).sum() > 300
    # The same views make the same map.
    assert rounds[-1].said.counters["collisions"] == 0
    bev = BevMap((START.x_m, START.z_m), len(MAP_CATEGORIES))
    for one in rounds:
        view = one.observation.views[-1]
        bev.integrate(view, category_image(view.detections))
    for value in (FREE, BLOCKED):
        cells = [bev.map_frame.centre_m(row, col) for row, col in np.argwhere(bev.cells == value).tolist()]
        assert len(cells) > 100
        assert all(cell_at(belief, place_m) >= value for place_m in cells)
    fine = {(math.floor(10 * x_m), math.floor(10 * z_m)) for x_m, z_m in cells}
    assert {(x_cm // 10, z_cm // 10) for x_cm, z_cm in blocked_m(belief)} == fine
