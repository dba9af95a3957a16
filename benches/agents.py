"""What agents themselves cost: time of a decision round with a full memory, and memory of a long task."""

import gc
import json
import math
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from evonav.agents.agent import Agent, AgentAction, ExplainingAgent, NavigateTo, Stop
from evonav.agents.registry import BUILT_IN
from evonav.decision.question import Question, Reply
from evonav.decision.text.matcher import TextMatch
from evonav.evaluation.agent_order import PAPER_ORDER
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.sensors import Sensors
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend, make_agent
from evonav.perception import Perception, StageScene
from evonav.sensors.observation import Observation
from evonav.tasks.bundled import bundled_tasks
from evonav.tasks.listing import task_file
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.simulator import Simulator

A = TypeVar("A")

TASK = "bundled-0101-298696-s0"
"""Eight rooms, 155 objects, five stages."""
NUM_ENTRIES = 100
MAX_ROUND_MS = 50.0
MAX_GROWTH_MB = 500.0

NOTES = f"""One decision round of each agent in `{TASK}` (8 rooms, 155 objects), on ground-truth views of 300x300:
mapping, memory, candidates, questions, and the text matcher's answers; rendering and all else outside of the agent is
not counted. When stage 1 begins the agent is led through the whole house; then it plays all stages by its own choices,
and rounds count while it remembers at least {NUM_ENTRIES} objects (`stage-reset`: in stage 1). `unigoal` remembers
things of its own categories alone, and all its steps count. Limit: {MAX_ROUND_MS:g} ms.
Memory: growth of a fresh process's peak RSS over all five stages with every budget spent to its end, 50 rounds a stage
(`unigoal`: 500 actions), colours kept and candidates with images as for a VLM; the simulator's growth is in it. Limit:
{MAX_GROWTH_MB:g} MB.
"""


@dataclass
class Led:
    """An agent that is led through the whole house at the beginning of stage 1, and whose rounds are timed then."""

    agent: Agent
    tour: Callable[[Agent], None]
    never_stops: bool = False
    round_ms: list[float] = field(default_factory=list)
    num_entries: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.sensors = self.agent.sensors

    def begin_task(self, task: TaskInfo) -> None:
        """Of the house."""
        self.agent.begin_task(task)

    def begin_stage(self, goal: Goal) -> None:
        """The first one with the tour."""
        self.agent.begin_stage(goal)
        if goal.stage == 1:
            self.tour(self.agent)

    def act(self, observation: Observation) -> AgentAction:
        """The agent's round, timed."""
        gc.disable()
        start_s = time.process_time()
        action = self.agent.act(observation)
        self.round_ms.append(1e3 * (time.process_time() - start_s))
        gc.enable()
        self.num_entries.append(len(self.agent.entries()) if isinstance(self.agent, ExplainingAgent) else 0)
        if self.never_stops and isinstance(action, Stop):
            pose = observation.pose
            return NavigateTo((pose.x_m + math.sin(pose.yaw_rad), pose.z_m + math.cos(pose.yaw_rad)))
        return action


class TextMatchWithImages:
    """The text matcher, for agents that believe that it looks at images; prompts are made as for a VLM."""

    needs_images = True

    def __init__(self) -> None:
        self._rules = TextMatch()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """The rule's answer."""
        question.prompt()
        return self._rules.answer(question, attempt)


def run() -> str:
    """Measures every built-in agent."""
    lines = ["| agent | p50 | p95 | rounds | entries | peak memory grows by |", "| --- | --- | --- | --- | --- | --- |"]
    for name in [name for name in PAPER_ORDER if name in BUILT_IN]:
        led = timed(name)
        full = [ms for ms, num in zip(led.round_ms, led.num_entries, strict=True) if num >= NUM_ENTRIES]
        counted = full or led.round_ms
        p50, p95 = statistics.median(counted), float(np.quantile(counted, 0.95))
        remembered = [num for num in led.num_entries if num >= NUM_ENTRIES] or led.num_entries
        entries = f"{min(remembered)}-{max(remembered)}"
        growth = growth_mb(name)
        lines.append(f"| {name} | {p50:.1f} ms | {p95:.1f} ms | {len(counted)} | {entries} | {growth:.0f} MB |")
    return "\n".join(lines)


def timed(name: str) -> Led:
    """An agent after its rounds."""
    backend = Backend()
    simulator, perception = backend.simulator.create(), backend.perception.create()
    case = _case(backend)
    agent = make_agent(name, backend.decision.create(0))
    led = Led(agent, lambda led: _tour(led, case, simulator, perception))
    _play(case, name, led, simulator, perception)
    return led


def growth_mb(name: str) -> float:
    """Peak memory of a long task in a fresh process, less what the process needs before it."""
    told = subprocess.run(
        [sys.executable, "-m", "benches.agents", name], check=True, capture_output=True, text=True
    ).stdout
    return float(json.loads(told)["growth_mb"])


def _measure_growth(name: str) -> None:
    backend = Backend()
    simulator, perception = backend.simulator.create(), backend.perception.create()
    case = _case(backend)
    agent: Any = make_agent(name, TextMatchWithImages())
    simulator.reset(case.stages[0].house_json, case.start)
    sensors = Sensors(simulator, perception, agent.sensors, _scene(case, simulator))
    sensors.observe(is_first=True, is_action_success=True, has_arrived=False, num_rounds_left=1)
    before_mb = _peak_mb()
    led = Led(agent, lambda _: None, never_stops=agent.sensors.motion == "waypoints")
    _play(case, name, led, simulator, perception)
    sys.stdout.write(json.dumps({"growth_mb": _peak_mb() - before_mb, "rounds": len(led.round_ms)}))


def _peak_mb() -> float:
    """Of this process image: `getrusage` would count the parent's."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024


def _case(backend: Backend) -> EpisodeSpec:
    with bundled_tasks() as folder:
        return backend.tasks.create(task_file(folder / TASK).path)


def _play(case: EpisodeSpec, name: str, led: Led, simulator: Simulator, perception: Perception) -> None:
    for outcome in Episode(case, name, led, simulator, perception, ProtocolConfig(), 0).run():
        if outcome.record.error is not None:
            raise AssertionError(outcome.record.error)


def _scene(case: EpisodeSpec, simulator: Simulator) -> StageScene:
    return StageScene(case.task_id, case.stages[0].public, "", 0, simulator.objects)


def _tour(agent: Agent, case: EpisodeSpec, simulator: Simulator, perception: Perception) -> None:
    """Leads an agent through every room: it looks ahead and back from places about 1.5 m apart."""
    start = simulator.pose
    sensors = Sensors(simulator, perception, agent.sensors, _scene(case, simulator))
    is_first = True
    for x_m, z_m in _places(simulator):
        for yaw_rad in (0.0, math.pi):
            simulator.teleport(replace(start, x_m=x_m, z_m=z_m, yaw_rad=yaw_rad))
            observation = sensors.observe(
                is_first=is_first, is_action_success=True, has_arrived=False, num_rounds_left=50
            )
            agent.act(observation)
            is_first = False
    simulator.teleport(start)


def _places(simulator: Simulator, spacing_m: float = 1.5) -> Sequence[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    for x_m, _, z_m in simulator.reachable_positions().tolist():
        if all(math.dist((x_m, z_m), other) >= spacing_m for other in found):
            found.append((x_m, z_m))
    return found


if __name__ == "__main__":
    _measure_growth(sys.argv[1])
