"""Force the situations in which agents under development crash: scripted episodes on bundled houses.

An evaluation reaches these branches of an agent only sometimes. Here each is one stage, and one line of the result.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from math import atan2, dist, inf
from pathlib import Path
from typing import Any, cast

import numpy as np

from evonav.agents.agent import Agent, NavigateTo
from evonav.counted import counted
from evonav.evaluation.contract.points import Check
from evonav.evaluation.episode import motion
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.outcome import StageOutcome
from evonav.evaluation.episode.spec import EpisodeSpec, GuidedWalk, StageSpec
from evonav.evaluation.hosting.agent import HostedAgent
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord, TargetRecord, TransitionRecord
from evonav.evaluation.run.components import Backend
from evonav.house import House
from evonav.perception import Percept, Perception
from evonav.sensors.observation import Detections
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Frame, Simulator

PROTOCOL = ProtocolConfig(max_rounds=12, max_actions=24)
SOFA, BATHROOM, LARGE = "bundled-0095-21f0cc-s0", "bundled-0115-9a1931-s0", "bundled-0108-831091-s0"
"""Bundled tasks.

Stage 3 of the first looks for the only sofa, the last stage of the second for an object in a small bathroom, and the
third is in a house of ten rooms.
"""
APPROACH_M = 3.0
"""Length of the path on which the agent is shown the target."""
NEAR_M = 1.5


@dataclass(frozen=True, slots=True)
class Situation:
    """The situation that one stage of a script forces."""

    name: str
    summary: str
    """Its description, for an agent with which nothing went wrong."""
    missing: Callable[[StageRecord], str | None] = lambda _: None
    """Returns why the agent's own choices did not lead there; `None` if they did."""


@dataclass(frozen=True, slots=True)
class Script:
    """An episode that forces a situation in each of its stages."""

    spec: EpisodeSpec
    situations: tuple[Situation, ...]
    is_blocked: bool = False
    """Every step and every `NavigateTo` fails."""
    is_blind: bool = False
    """Nothing is detected."""


def check_situations(
    backend: Backend, name: str, new_agent: Callable[[], Agent | HostedAgent], seed: int
) -> Iterator[Check]:
    """Run an agent through all scripts, and yield a check for each situation."""
    with closing(backend.simulator.create()) as simulator:
        for script in _scripts(backend, simulator):
            perception = backend.perception.create()
            episode = Episode(
                script.spec,
                name,
                new_agent(),
                cast("Simulator", _Blocked(simulator)) if script.is_blocked else simulator,
                _Blind(perception) if script.is_blind else perception,
                PROTOCOL,
                seed,
            )
            for situation, outcome in zip(script.situations, episode.run(), strict=True):
                yield _check(situation, outcome)


def _check(situation: Situation, outcome: StageOutcome) -> Check:
    record = outcome.record
    if record.error is not None and record.error.kind.is_agents:
        place = place_of(outcome.traceback)
        where = f"{place}: " if place else ""
        return Check(situation.name, "fail", f"{where}{record.error.message}")
    if record.error is not None and not record.trace:
        return Check(situation.name, "skip", f"cannot be set up here: {record.error.message}")
    missing = situation.missing(record)
    if missing is not None:
        return Check(situation.name, "skip", f"not reached: {missing}")
    return Check(situation.name, "pass", f"{situation.summary}; {_end(record)}")


def place_of(traceback: str) -> str:
    """Return the innermost place of a traceback that is not in evonav, as `file.py:line`; empty if there is none."""
    package = str(Path(__file__).parents[2])
    places = [line.split('"')[1::2] + line.split(", ")[1:] for line in traceback.splitlines() if 'File "' in line]
    others = [place for place in places if not place[0].startswith((package, "<"))]
    if not others:
        return ""
    file, line = others[-1][0], others[-1][1].removeprefix("line ")
    return f"{Path(file).name}:{line}"


def _end(record: StageRecord) -> str:
    rounds = counted(record.num_rounds, "round")
    return f"it stopped after {rounds}" if record.has_stopped else f"it went on for all {rounds}"


# Scripts


def _scripts(backend: Backend, simulator: Simulator) -> Iterator[Script]:
    small, one, large = (backend.tasks.create(BUNDLED_TASKS / name) for name in (SOFA, BATHROOM, LARGE))
    sofa, other = small.stages[2], small.stages[0]
    simulator.reset(sofa.house_json, small.start)
    start, walk = _approach(simulator, sofa.target)
    gone = replace(sofa, house_json=_without(sofa, sofa.target.category), target=other.target)
    yield Script(
        _spec(small, start, replace(sofa, guided=walk), gone),
        (
            Situation("guided stage", "observed while the evaluator walked"),
            Situation("target gone", "went back to a target that is no longer there", _not_near(sofa.target)),
        ),
    )
    yield Script(
        _spec(small, start, sofa, gone),
        (
            Situation("failed actions", "every step failed, with the target in view", _not_moved),
            Situation("failed search", "every step failed, with the target nowhere", _not_moved),
        ),
        is_blocked=True,
    )
    room = _one_room(one.stages[-1])
    x_m, _, z_m = room.target.position_m
    empty = replace(room, house_json=_without(room, room.target.category))
    yield Script(
        _spec(one, replace(one.start, x_m=x_m, z_m=z_m), room, empty),
        (
            Situation("one room", "searched a house of one small, closed room"),
            Situation("all explored", "searched that room for what is not there", _stopped_at_once),
        ),
    )
    first, second = large.stages[0], large.stages[1]
    absent = replace(second, house_json=_without(second, second.target.category), target=first.target)
    yield Script(
        _spec(large, large.start, first, absent),
        (
            Situation("many rooms", "searched a house of ten rooms", _stopped_at_once),
            Situation("never found", "looked for what is not in the house", _stopped_at_once),
        ),
    )
    yield Script(
        _spec(small, small.start, other),
        (Situation("no detections", "nothing was detected in any view"),),
        is_blind=True,
    )


def _spec(spec: EpisodeSpec, start: Pose, *stages: StageSpec) -> EpisodeSpec:
    """Return an episode of other stages, without recorded changes."""
    numbered = tuple(
        replace(stage, public=replace(stage.public, stage=number), transition=TransitionRecord())
        for number, stage in enumerate(stages, start=1)
    )
    return replace(spec, start=start, stages=numbered)


def _approach(simulator: Simulator, target: TargetRecord) -> tuple[Pose, GuidedWalk]:
    """Return the last metres of the path to a target, and the pose at their beginning, which faces the target."""
    pose = simulator.pose
    x_m, _, z_m = target.position_m
    backwards = [*reversed(motion.Planner(simulator).path_m((x_m, z_m)))]
    points = [*reversed([backwards[0], *motion.waypoints(backwards, inf, APPROACH_M)[0]])]
    first, last = (replace(pose, x_m=x, z_m=z, yaw_rad=atan2(x_m - x, z_m - z)) for x, z in (points[0], points[-1]))
    return first, GuidedWalk(tuple(points), last)


def _without(stage: StageSpec, category: str) -> str:
    """Return the stage's house without the objects of a category, and without what stands on them."""
    house = House(stage.house_json, name="stage")
    removed: set[str] = set()
    for item in house.objects:  # a parent comes before its children
        if item.category == category or item.parent_id in removed:
            removed.add(item.id)
    return house.apply(json.dumps({"removed": sorted(removed)})).to_json()


def _one_room(stage: StageSpec) -> StageSpec:
    """Return the stage in a house that has only the target's room, closed on all sides."""
    room_id = stage.target.room_id
    document: dict[str, Any] = json.loads(stage.house_json)
    house = House(stage.house_json, name="stage")
    ids = {item.id for item in house.objects if item.room_id == room_id}
    document["rooms"] = [room for room in document["rooms"] if room["id"] == room_id]
    document["walls"] = [wall | {"empty": False} for wall in document["walls"] if wall["roomId"] == room_id]
    document["objects"] = [item for item in document["objects"] if item["id"] in ids]
    document |= {"doors": [], "windows": []}
    return replace(stage, house_json=json.dumps(document))


# What the agent's own choices led to


def _stopped_at_once(record: StageRecord) -> str | None:
    return "the agent stopped in the first round" if record.has_stopped and record.num_rounds == 1 else None


def _not_moved(record: StageRecord) -> str | None:
    if all(entry.is_action_success for entry in record.trace):
        return "the agent did not try to move"
    return None


def _not_near(target: TargetRecord) -> Callable[[StageRecord], str | None]:
    """Return a test whether an agent that navigates went where the target was."""
    place = (target.position_m[0], target.position_m[2])

    def missing(record: StageRecord) -> str | None:
        goals = [entry.action.position_m for entry in record.trace if isinstance(entry.action, NavigateTo)]
        if any(dist(goal, place) <= NEAR_M for goal in goals):
            return None
        if not goals and not record.has_stopped:
            return "the agent never answered NavigateTo"
        return "the agent did not go back to where it had seen the target"

    return missing


# Worlds that do not cooperate


class _Blocked:
    """A simulator in which the agent can turn but not move."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - all else is the simulator's
        return getattr(self._simulator, name)

    def step(self, action: Action) -> bool:
        return action is not Action.MOVE_FORWARD and self._simulator.step(action)

    def teleport(self, pose: Pose) -> bool:
        here = self._simulator.pose
        return (pose.x_m, pose.z_m) == (here.x_m, here.z_m) and self._simulator.teleport(pose)


class _Blind:
    """A perception that detects nothing."""

    def __init__(self, perception: Perception) -> None:
        self._perception = perception
        self.begin_stage = perception.begin_stage
        self.change_scene = perception.change_scene
        self.text_feature = perception.text_feature

    @property
    def needs_rgb(self) -> bool:
        return self._perception.needs_rgb

    def perceive(self, frames: Sequence[Frame]) -> Sequence[Percept]:
        return [replace(percept, detections=_nothing(percept)) for percept in self._perception.perceive(frames)]


def _nothing(percept: Percept) -> Detections:
    features = percept.detections.features
    return Detections(
        masks=np.full_like(percept.detections.masks, -1),
        labels=(),
        confidences=np.zeros(0, dtype=np.float32),
        features=None if features is None else features[:0],
    )
