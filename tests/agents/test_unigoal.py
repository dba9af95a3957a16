"""UniGoal on the toy house."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scripted_model import Scripted
from toy_house import OBJECTS, ToySimulator, stage_case

from evonav.agents.unigoal.agent import UniGoal, UniGoalAsPublished, UniGoalConfig
from evonav.agents.unigoal.goal_graph import GoalEdge, GoalGraph
from evonav.agents.unigoal.goals import Glimpse, largest_detection
from evonav.agents.unigoal.graphs import GraphConfig
from evonav.agents.unigoal.object_graph import SceneNode
from evonav.agents.unigoal.questions import DecomposeQuestion, DescribeQuestion, ObjectsQuestion
from evonav.agents.unigoal.scene_questions import (
    CorrectionQuestion,
    GroupScoreQuestion,
    LayoutQuestion,
    RelationLinesQuestion,
)
from evonav.decision.text.decision import TextMatch
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.world.pose import Pose

START = Pose(1.0, 0.9, 3.0, 0.0)
SHORT = ProtocolConfig(max_actions=60)


def run(agent, *stages, start=START, perception=None, protocol=None):
    case = EpisodeSpec("toy", "toy", start, stages)
    simulator = ToySimulator(width_px=64, height_px=64)
    episode = Episode(case, "a", agent, simulator, perception or GroundTruthPerception(), protocol or SHORT, 7)
    records = [outcome.record for outcome in episode.run()]
    assert all(record.is_scored for record in records), [record.error for record in records]
    return records


def scripted(**said):
    """The text matcher, but for questions of the kinds given: words, or a function of the question."""
    rules = TextMatch()

    def script(question):
        words = said.get(question.kind.replace("-", "_"))
        if words is None:
            return question.answer_text(rules.answer(question).answer)
        return words(question) if callable(words) else words

    return Scripted(script)


def choices(record):
    return [entry.choice for entry in record.trace]


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
    assert agent.diagnostics().details["distance_m"] < 0.25


def test_a_category_without_a_word_never_triggers_and_the_budget_is_500_actions():
    agent = UniGoal()
    (record,) = run(agent, stage_case(1, "GarbageCan|1"), protocol=ProtocolConfig())
    assert agent.diagnostics().details["category"] is None
    assert len(record.trace) == 500
    assert not record.has_stopped
    assert set(choices(record)) <= {"exploration", "stuck", "none"}


def test_as_released_six_categories_are_known_as_published_all_that_are_mapped():
    for kind, category in ((UniGoal, None), (UniGoalAsPublished, "refrigerator")):
        agent = kind()
        run(agent, stage_case(1, "Fridge|1"), protocol=ProtocolConfig(max_actions=1))
        assert agent.diagnostics().details["category"] == category


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
    agent = UniGoal()
    # Looking at the table, then with the table gone.
    start = Pose(1.0, 0.9, 3.0, 2.4)
    stages = (stage_case(1, "Chair|1"), stage_case(2, "Bed|1", moves=TABLE_AWAY, mode="FULL_SHUFFLE"))
    obstacles = []
    begin_stage = agent.begin_stage

    def note(stage):
        begin_stage(stage)
        if agent._bev is not None:
            obstacles.append(agent._bev.obstacles)

    agent.begin_stage = note
    _, second = run(agent, *stages, start=start, protocol=ProtocolConfig())
    (before,) = obstacles
    after = agent._bev.obstacles
    assert (after[before]).all()  # nothing is taken back
    x_m, _, z_m = OBJECTS["DiningTable|1"][1]
    edge = agent._bev.cell_of((x_m, z_m - 0.35)), agent._bev.cell_of((x_m, z_m + 0.35))
    under = before[edge[0][0] : edge[1][0], edge[0][1] - 10 : edge[0][1] + 10]
    assert under.any()
    assert second.state is EndState.SUCCESS


def test_the_scene_graph_stays_and_the_goal_graph_goes():
    agent = UniGoal()
    noted = []
    begin_stage = agent.begin_stage

    def note(stage):
        before = [node.name for node in agent._graphs.scene.nodes]
        had_goal = agent._graphs.goal_graph is not None
        begin_stage(stage)
        graphs = agent._graphs
        after = [node.name for node in graphs.scene.nodes]
        noted.append((before, had_goal, after, graphs.goal_graph, graphs.subgraphs, graphs.category))

    agent.begin_stage = note
    run(agent, stage_case(1, "GarbageCan|1"), stage_case(2, "Bed|1"))
    before, had_goal, after, *cleared = noted[1]
    assert len(before) >= 2
    assert had_goal
    assert after == before
    assert cleared == [None, (), None]


def test_a_wrong_number_of_relation_lines_drops_the_edges():
    def one_too_many(question):
        return question.answer_text(TextMatch().answer(question).answer) + "\nchair_1 and bed_2: chair_1 is on bed_2"

    stage = stage_case(1, "GarbageCan|1")
    wrong, right = UniGoal(decision=scripted(scene_relations=one_too_many)), UniGoal(decision=scripted())
    run(wrong, stage)
    run(right, stage)
    assert len(right._graphs.scene.edges) >= 1
    assert wrong._graphs.scene.edges == []
    assert [n.name for n in wrong._graphs.scene.nodes] == [n.name for n in right._graphs.scene.nodes]
    asked = [q for q in wrong._queries.model.questions if isinstance(q, RelationLinesQuestion)]
    assert wrong._queries.counters["invalid_answers"] == len(asked)  # no second try


CHAIR_TEXT = "Please navigate to the chair next to the dining table."


def test_decomposition_is_given_up_after_ten_tries():
    model = scripted(decompose="no JSON")
    agent = UniGoal(decision=model)
    run(agent, stage_case(1, "Chair|1", instruction=CHAIR_TEXT), protocol=ProtocolConfig(max_actions=2))
    asked = [question for question in model.questions if isinstance(question, DecomposeQuestion)]
    assert len(asked) == 10
    graph = GoalGraph(("chair", "dining table"), (GoalEdge("chair", "next to", "dining table"),))
    assert agent._graphs.subgraphs == (graph,) == (agent._graphs.goal_graph,)


def test_a_group_score_that_is_no_number_is_zero():
    agent = UniGoal(decision=scripted(group_score="quite likely"))
    (record,) = run(agent, stage_case(1, "GarbageCan|1"))
    assert any(isinstance(q, GroupScoreQuestion) for q in agent._queries.model.questions)
    assert {tuple(e.details.items()) for e in record.trace if e.details.get("mid_term_m") is not None} == set()


def test_as_released_the_score_is_nothing_or_a_half():
    for goal, score in (("Please navigate to the chair.", 0.5), (CHAIR_TEXT, 0.0)):
        agent = UniGoal(decision=scripted(category="none"))
        (record,) = run(agent, stage_case(1, "Chair|1", instruction=goal))
        assert {(e.details["match"], e.details["score"]) for e in record.trace} == {("zero", score)}
        assert len(agent._graphs.scene.nodes) >= 2


def knowing(agent, *nodes, relations=()):
    """An agent with a scene graph, at the beginning of its first stage."""
    graphs = agent._graphs
    graphs.scene._nodes = {node.id: node for node in nodes}
    graphs.scene.relate(
        [(graphs.scene.node(a), graphs.scene.node(b)) for a, b, _ in relations], [r[2] for r in relations]
    )
    return graphs


def begun(decision, goal="Chair|1", instruction=CHAIR_TEXT):
    agent = UniGoalAsPublished(decision=decision)
    run(agent, stage_case(1, goal, instruction=instruction), protocol=ProtocolConfig(max_actions=1))
    return agent


def node(node_id, caption, x, z):
    return SceneNode(node_id, caption, (x, 0.4, z), (0.5, 0.8, 0.5), 5)


OBJECTS_ASKED = "[vase, table, chair]"
RELATIONS = "vase and table: vase is on table\ntable and chair: table is next to chair"


def test_a_partly_found_goal_is_predicted_by_the_transform_of_two_anchors():
    layout = "vase: (1, 1)\ntable: (0, 0)\nchair: (1, 0)"
    agent = begun(scripted(goal_objects=OBJECTS_ASKED, goal_relations=RELATIONS, layout=layout))
    graphs = knowing(agent, node(1, "table", 2.0, 1.0), node(2, "chair", 2.0, 3.0), relations=[(1, 2, "beside")])
    advice = graphs.advise(lambda _: False)
    # Two of three nodes, degrees 1 of 2 and 1 of 1, one of two edges.
    assert advice.score == pytest.approx(((2 / 3 + 0.75) / 2 + 0.5) / 2)
    assert advice.stage == "partial"
    # The layout's x axis is the way from table to chair: +z, twice as long. Its y axis then points to -x.
    assert advice.mid_term_m == pytest.approx((0.0, 3.0))
    assert any(isinstance(question, LayoutQuestion) for question in agent._queries.model.questions)


def test_a_goals_noun_is_compared_as_the_word_that_it_goes_under():
    agent = begun(scripted())  # the chair next to the dining table
    relations = [(2, 1, "next to")]
    graphs = knowing(agent, node(1, "table", 2.0, 1.0), node(2, "chair", 2.0, 2.0), relations=relations)
    advice = graphs.advise(lambda _: False)
    assert (advice.stage, advice.score, advice.target.name) == ("perfect", 1.0, "chair_2")


def perfect(correction):
    model = scripted(
        goal_objects="[chair, table]", goal_relations="chair and table: chair is on table", correction=correction
    )
    agent = begun(model)
    nodes = [
        node(1, "table", 2.0, 1.0),
        node(2, "chair", 2.0, 2.0),
        node(3, "plant", 2.5, 2.5),
        node(4, "tv", 7.9, 4.0),
    ]
    relations = [(2, 1, "on"), (2, 3, "next to"), (2, 4, "under"), (1, 3, "next to")]
    return model, knowing(agent, *nodes, relations=relations)


def test_a_goal_found_whole_is_corrected_and_gone_to():
    verdicts = "0: keep\n1: keep\n2: delete\n3: rename to near\n4: keep\n5: delete"
    model, graphs = perfect(lambda q: verdicts if len(q.edges) == 3 else "")
    advice = graphs.advise(lambda _: False)
    assert (advice.stage, advice.score) == ("zero", 0.25)  # the relation is not the goal's any more
    (asked,) = [question for question in model.questions if isinstance(question, CorrectionQuestion)]
    assert [n.name for n in asked.nodes] == ["table_1", "chair_2", "plant_3"]  # the television is too far away
    assert [n.name for n in graphs.scene.nodes] == ["table_1", "chair_2", "tv_4"]
    assert [(e.subject_id, e.object_id, e.relation) for e in graphs.scene.edges] == [(2, 1, "near"), (2, 4, "under")]
    model, graphs = perfect("\n".join(f"{i}: keep" for i in range(6)))
    advice = graphs.advise(lambda _: False)
    assert (advice.stage, advice.score, advice.target.name) == ("perfect", 1.0, "chair_2")
    # What was visited in vain does not match.
    assert graphs.advise(lambda n: n.id == 2).target is None


def test_a_corrected_name_is_not_the_goals_any_more():
    _, graphs = perfect("0: keep\n1: rename to stool\n2: keep\n3: keep\n4: keep\n5: keep")
    assert graphs.advise(lambda _: False).stage == "zero"
    assert graphs.scene.node(2).caption == "stool"


def test_as_published_a_node_found_whole_is_walked_to():
    text = "Please navigate to the dresser."
    agent = UniGoalAsPublished(decision=scripted(goal_objects="[cabinet]"))
    (record,) = run(agent, stage_case(1, "Dresser|1", instruction=text), protocol=ProtocolConfig())
    assert record.state is EndState.SUCCESS
    assert record.trace[-1].chosen_entry is not None
    assert record.trace[-1].chosen_entry.label == "Dresser"
    assert choices(record)[-1] == "confirmed graph"


@pytest.mark.parametrize(("goal_input", "kinds"), [("category", set()), ("image", {DescribeQuestion, ObjectsQuestion})])
def test_goals_may_be_categories_or_images(goal_input, kinds):
    model = scripted()
    agent = UniGoal(UniGoalConfig(graph=GraphConfig(goal_input=goal_input)), model)
    run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig(max_actions=1))
    assert agent._graphs.goal_graph == GoalGraph(("bed",))
    asked = {type(question) for question in model.questions}
    assert asked & {DescribeQuestion, ObjectsQuestion} == kinds
    assert agent._graphs.category == "bed"


def test_the_largest_box_is_the_one_taken():
    simulator = ToySimulator(width_px=64, height_px=64)
    simulator.reset(stage_case(1, "Bed|1").house_json, START)
    seen = []

    class Watching(UniGoal):
        def act(self, observation):
            seen.append(observation.views[-1])
            return super().act(observation)

    run(Watching(), stage_case(1, "Bed|1"), start=Pose(5.0, 0.9, 2.5, 0.9), protocol=ProtocolConfig(max_actions=1))
    view = seen[0]
    bed = view.detections.labels.index("Bed")
    masks = np.where(view.detections.masks == bed, bed, -1)
    masks[:2, :3] = len(view.detections.labels)  # a second bed, far and small
    found = replace(view.detections, masks=masks, labels=(*view.detections.labels, "Bed"))
    taken = largest_detection(replace(view, detections=found), "bed")
    assert np.array_equal(taken, masks == bed)
    assert largest_detection(view, "tv") is None


def test_runs_are_the_same_every_time():
    agents = (UniGoal(), UniGoal())
    stages = (stage_case(1, "GarbageCan|1"), stage_case(2, "Bed|1"))
    first, second = (run(agent, *stages) for agent in agents)
    assert [r.trace for r in first] == [r.trace for r in second]
    # Places drawn when nothing is left to explore: the same ones, explored, and not where it stands.
    drawn = [[agent._somewhere(agent._bev, agent._planner, START) for _ in range(3)] for agent in agents]
    assert drawn[0] == drawn[1]
    assert len(set(drawn[0])) == 3
    bev = agents[0]._bev
    for place_m in drawn[0]:
        assert math.dist(place_m, (START.x_m, START.z_m)) >= 0.5
        assert bev.explored[bev.cell_of(place_m)]
        assert not bev.obstacles[bev.cell_of(place_m)]


def watching(agent, distances):
    """An agent's goals with a detection held, the planner saying how long the way is; the agent is 0.9 m from it."""
    run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig(max_actions=1))
    watch, planner = agent._watch, agent._planner
    planner.distance_m = lambda pose, cells: distances.pop(0)
    watch.temporary = Glimpse(np.array([agent._bev.cell_of((1.9, 3.0))], np.int32), (1.9, 3.0), "detection")
    return watch


@pytest.mark.parametrize(
    ("way_m", "is_in_view", "held", "confirmed", "given_up"),
    [
        (0.14, True, False, True, 0),
        (0.16, True, True, False, 0),
        (1.7, True, True, False, 0),
        (1.9, True, False, True, 0),  # more than twice the straight distance: behind something
        (None, True, False, True, 0),
        (0.14, False, False, False, 1),
    ],
)
def test_a_temporary_goal_nearby_is_confirmed_kept_or_given_up(way_m, is_in_view, held, confirmed, given_up):
    watch = watching(UniGoal(), [way_m])
    watch.is_in_view = is_in_view
    watch.judge(START)
    assert (watch.temporary is not None, watch.confirmed is not None, watch.num_given_up) == (held, confirmed, given_up)


def test_a_goal_without_a_way_is_held_until_another_is_seen():
    agent = UniGoal()
    watch = watching(agent, [None, None])
    watch.judge(replace(START, x_m=4.5))
    assert (watch.temporary.centre_m, watch.confirmed, watch.num_given_up) == ((1.9, 3.0), None, 0)
    other = Glimpse(np.array([agent._bev.cell_of((3.5, 3.0))], np.int32), (3.5, 3.0), "detection")
    assert watch._gives_way(other)


def test_of_two_goals_in_view_the_one_held_is_kept():
    agent = UniGoal()
    views = []

    def detect(view):
        masks = np.full((64, 64), -1, np.int32)
        masks[30:40, 2:14], masks[30:50, 40:62] = 0, 1
        return replace(view.detections, masks=masks, labels=("Chair", "Chair"), confidences=np.ones(2, np.float32))

    class Seeing(UniGoal):
        def act(self, observation):
            views.append(observation.views[-1])
            return super().act(observation)

    run(Seeing(), stage_case(1, "Chair|1"), protocol=ProtocolConfig(max_actions=1))
    run(agent, stage_case(1, "Chair|1"), protocol=ProtocolConfig(max_actions=1))
    view, watch = replace(views[0], detections=detect(views[0])), agent._watch
    only_left = replace(view.detections, labels=("Chair", "Mug"))
    watch.temporary = None
    watch.look(replace(view, detections=only_left), "chair", frozenset())
    left = watch.temporary
    watch.look(view, "chair", frozenset())
    assert watch.temporary is left  # the larger one, on the right, does not take over
    watch.temporary = None
    watch.look(view, "chair", frozenset())
    assert watch.temporary.centre_m != left.centre_m


def test_belief_shows_the_known_part_of_the_map_at_half_its_resolution():
    agent = UniGoal()
    run(agent, stage_case(1, "Bed|1"), protocol=ProtocolConfig(max_actions=20))
    belief, bev = agent.belief(), agent._bev
    frame = belief.map_frame
    assert frame.cell_m == pytest.approx(0.1)
    assert belief.cells.shape == (frame.rows, frame.cols)
    assert {entry.label for entry in belief.entries} <= {category for category, _, _ in OBJECTS.values()}
    assert (belief.cells > 0).sum() > 300
    for row, col in np.argwhere(belief.cells == 2)[::7].tolist():
        x_m, z_m = frame.corner_m[0] + col * 0.1, frame.corner_m[1] + row * 0.1
        fine = [bev.cell_of((x_m + dx, z_m + dz)) for dx in (0.025, 0.075) for dz in (0.025, 0.075)]
        assert any((bev.obstacles | bev.collisions)[cell] for cell in fine)
