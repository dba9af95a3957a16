"""Doors and windows in a real house: who remembers them, and that no question offers them as a goal."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scripted_model import Scripted

from evonav.agents.agent import Agent
from evonav.agents.frontier_update.questions import ChooseQuestion
from evonav.agents.msgnav.agent import MsgNav
from evonav.agents.msgnav.questions import GraphQuestion, SubgraphQuestion
from evonav.agents.registry import agent_factory
from evonav.agents.three_d_mem.questions import PrefilterQuestion
from evonav.decision.question import Question
from evonav.decision.text.matcher import Matcher
from evonav.house import bundled_houses
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.sensors.observation import MapFrame, Observation, View
from evonav.sensors.visibility import visible_occupancy
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.embedded import EmbeddedSimulator

ANSWERS = {
    "choose": "Frontier 0",
    "prefilter": "none",
    "choose_snapshot": "Frontier 0",
    "subgraph": "none",
    "graph": "Continue Exploration",
    "frontier": "Frontier 0",
}
DOORS, WINDOWS = set(STRUCTURE_TYPES[:2]), {STRUCTURE_TYPES[2]}
GOAL = "Please navigate to the mug near the window and near the doorway."


@pytest.fixture(scope="module")
def look() -> tuple[Observation, TaskInfo]:
    """A look all around from near a door and a window of a bundled house."""
    simulator = EmbeddedSimulator()
    pose = simulator.reset(list(bundled_houses())[11].to_json())
    grid = simulator.occupancy()
    kinds = ("door", "window")
    places = [[o.centre_m for o in simulator.objects if o.kind == kind] for kind in kinds]

    def farthest_m(at: list[float]) -> float:
        return max(min(math.hypot(at[0] - x, at[2] - z) for x, _, z in of_kind) for of_kind in places)

    x_m, _, z_m = min(simulator.reachable_positions().tolist(), key=farthest_m)
    pose = replace(pose, x_m=x_m, z_m=z_m)
    views = []
    for step in range(12):
        frame = simulator.render(replace(pose, yaw_rad=step * math.pi / 6.0), rgb=False)
        found = GroundTruthPerception().detect(frame, simulator.objects)
        seen = visible_occupancy(grid, pose, frame.intrinsics, 3.0)
        views.append(View(frame.pose, frame.intrinsics, frame.depth_m, found, seen))
    observation = Observation(tuple(views), pose, is_action_success=True, num_rounds_left=50)
    rows, cols = grid.cells.shape
    return observation, TaskInfo("a", 1, 50, MapFrame(rows, cols, grid.cell_m, grid.corner_m), 0)


def after(name: str, look: tuple[Observation, TaskInfo], *config: object) -> tuple[Agent, list[Question]]:
    """Return an agent after a round, and what it asked."""
    model = Scripted(lambda question: ANSWERS[question.kind])
    agent = agent_factory(name)(*config, decision=model)
    agent.begin_task(look[1])
    agent.begin_stage(Goal(1, "Mug", GOAL, GOAL, GOAL, np.zeros((1, 1, 3), np.uint8)))
    agent.act(look[0])
    return agent, model.questions


@pytest.mark.parametrize("name", ["fu", "stage-reset", "ftu", "3d-mem", "evonav_studies.variants:three_d_mem_plus"])
def test_agents_with_3d_mems_background_remember_windows_and_no_doors(name: str, look) -> None:
    labels = {entry.label for entry in after(name, look)[0].explain().entries()}
    assert labels >= WINDOWS
    assert not DOORS & labels


@pytest.mark.parametrize("name", ["msgnav", "evonav_studies.variants:msgnav_plus"])
def test_msgnav_remembers_doors_and_windows(name: str, look) -> None:
    agent, _ = after(name, look)
    labels = {entry.label for entry in agent.explain().entries()}
    assert labels >= WINDOWS
    assert "Doorway" in labels


def test_the_list_is_each_agents_own(look) -> None:
    config = MsgNav().config
    bare = replace(config, navigator=replace(config.navigator, background=("Door", "windows", "chair")))
    agent, _ = after("msgnav", look, bare)
    assert not {*STRUCTURE_TYPES, "Chair"} & {entry.label for entry in agent.explain().entries()}


@pytest.mark.parametrize("name", ["fu", "ftu"])
def test_windows_are_around_the_candidates_and_none_of_them(name: str, look) -> None:
    (asked,) = [q for q in after(name, look)[1] if isinstance(q, ChooseQuestion)]
    assert asked.objects
    assert not set(STRUCTURE_TYPES) & {candidate.label for candidate in asked.objects}
    assert "Window" in {candidate.label for candidate in asked.surroundings}


def test_3d_mems_prefilter_is_not_asked_about_windows(look) -> None:
    (asked,) = [q for q in after("3d-mem", look)[1] if isinstance(q, PrefilterQuestion)]
    assert len(asked.class_names) > 1
    assert not set(STRUCTURE_TYPES) & set(asked.class_names)


def test_msgnavs_graph_has_doors_and_its_rules_and_mistakes_choose_none(look) -> None:
    asked = after("msgnav", look)[1]
    subgraph = next(q for q in asked if isinstance(q, SubgraphQuestion))
    doors = {node.entry_id for node in subgraph.objects if node.candidate.label in STRUCTURE_TYPES}
    assert doors
    chosen, _ = subgraph.by_rule(Matcher())
    assert chosen
    assert not doors & set(chosen)
    assert not doors & {one for ids in subgraph.alternatives(chosen) for one in ids}
    (graph,) = [q for q in asked if isinstance(q, GraphQuestion)]
    graph = replace(graph, objects=subgraph.objects)
    explore, _ = graph.by_rule(Matcher())
    assert explore.kind == "explore"
    offered = {choice.id for choice in graph.alternatives(explore) if choice.kind == "object"}
    assert offered == {node.entry_id for node in subgraph.objects} - doors
    alone = replace(graph, objects=[node for node in graph.objects if node.entry_id in doors], num_frontiers=0)
    assert alone.by_rule(Matcher())[0].kind == "explore", "a door is not where a mug should be"
