"""The cost of agents themselves: time of a decision round with a full memory, and memory of a long task."""

import gc
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from evonav.agents.agent import Agent, AgentAction, NavigateTo, Stop
from evonav.agents.explanation import explains, explanation_of
from evonav.agents.hosting.serving import peak_memory_mb
from evonav.agents.registry import BUILT_IN
from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.rules import TextMatch
from evonav.errors import SimulationError
from evonav.evaluation.agent_order import PAPER_ORDER
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.sensors import Sensors
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend, make_agent
from evonav.perception import Perception, StageScene
from evonav.sensors.observation import Observation
from evonav.speed_benchmark.timing import Row, Sampling, rows_of
from evonav.tasks.listing import BUNDLED_TASKS, task_file
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.simulator import Simulator

A = TypeVar("A")

NAME, TITLE = "agents", "Agents"
TASK = "bundled-0101-298696-s0"
"""Eight rooms, 155 objects, five stages."""
NUM_ENTRIES = 100
MAX_ROUND_MS = 50.0
MAX_GROWTH_MB = 500.0
NOTES = f"""\
Decision rounds in `{TASK}` (8 rooms, 155 objects), 300x300, without rendering, while the agent remembers at least
{NUM_ENTRIES} objects (`unigoal`: all steps). Limit: {MAX_ROUND_MS:g} ms. Memory: growth of a fresh process's peak over
five stages with every budget spent. Limit: {MAX_GROWTH_MB:g} MB.
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
        """Begin the task."""
        self.agent.begin_task(task)

    def begin_stage(self, goal: Goal) -> None:
        """Begin a stage, the first one with the tour."""
        self.agent.begin_stage(goal)
        if goal.stage == 1:
            self.tour(self.agent)

    def act(self, observation: Observation) -> AgentAction:
        """Return the agent's action, timed."""
        gc.disable()
        start_s = time.process_time()
        action = self.agent.act(observation)
        self.round_ms.append(1e3 * (time.process_time() - start_s))
        gc.enable()
        self.num_entries.append(len(explanation_of(self.agent).entries()) if explains(self.agent) else 0)
        if self.never_stops and isinstance(action, Stop):
            pose = observation.pose
            return NavigateTo((pose.x_m + math.sin(pose.yaw_rad), pose.z_m + math.cos(pose.yaw_rad)))
        return action


class TextMatchWithImages(DecisionModel):
    """The text matcher, for agents that believe that it looks at images; prompts are made as for a VLM."""

    needs = frozenset({"images"})

    def __init__(self) -> None:
        self._rules = TextMatch()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the rule's answer."""
        question.prompt()
        return self._rules.answer(question, attempt)


def measure(sampling: Sampling, *, agents: Sequence[str] | None = None, has_growth: bool = True) -> Iterator[Row]:
    """Yield the time of a decision round of each agent.

    Args:
        sampling: Its `repeats` is the number of times that the task is played.
        agents: Names as `evonav agents` lists them; default: those of the paper.
        has_growth: Also measure the growth of memory, in a process of its own, where the system reports it.

    Raises:
        SimulationError: A stage fails.
    """
    names = [name for name in PAPER_ORDER if name in BUILT_IN] if agents is None else agents
    for number, name in enumerate(names):
        sampling.on_progress(number, len(names), name)
        round_ms: list[float] = []
        num_entries: list[int] = []
        for _ in range(sampling.repeats):
            led = timed(name)
            round_ms += led.round_ms
            num_entries += led.num_entries
        is_full = [num >= NUM_ENTRIES for num in num_entries]
        counted = [at for at, full in enumerate(is_full) if full or not any(is_full)]
        counted_ms = [round_ms[at] for at in counted]
        entries = [num_entries[at] for at in counted]
        facts = {
            "p95 ms": float(np.quantile(counted_ms, 0.95)),
            "entries, least": float(min(entries)),
            "entries, most": float(max(entries)),
        }
        growth = growth_mb(name) if has_growth and peak_memory_mb() is not None else None
        if growth is not None:
            facts["memory grows by MB"] = growth
        yield from rows_of(f"a round of {name}", counted_ms, {}, [TASK] * len(counted_ms), facts)
    sampling.on_progress(len(names), len(names), "")


def timed(name: str) -> Led:
    """Return an agent after its rounds.

    Raises:
        SimulationError: A stage fails.
    """
    backend = Backend()
    simulator, perception = backend.simulator.create(), backend.perception.create()
    case = _case(backend)
    agent = make_agent(name, backend.decision.create(0))
    led = Led(agent, lambda led: _tour(led, case, simulator, perception))
    _play(case, name, led, simulator, perception)
    return led


def growth_mb(name: str) -> float:
    """Return the peak memory of a long task in a fresh process, less what the process needs before it.

    Raises:
        SimulationError: The process fails.
    """
    command = [sys.executable, "-m", __name__, name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - this Python
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise SimulationError(f"{name}: the process that measures its memory failed: {last}")
    return float(json.loads(done.stdout)["growth_mb"])


def _measure_growth(name: str) -> None:
    backend = Backend()
    simulator, perception = backend.simulator.create(), backend.perception.create()
    case = _case(backend)
    agent: Any = make_agent(name, TextMatchWithImages())
    simulator.reset(case.stages[0].house_json, case.start)
    sensors = Sensors(simulator, perception, agent.sensors, _scene(case, simulator))
    sensors.observe(is_first=True, is_action_success=True, has_arrived=False, num_rounds_left=1)
    before_mb = peak_memory_mb() or 0.0
    led = Led(agent, lambda _: None, never_stops=agent.sensors.motion == "waypoints")
    _play(case, name, led, simulator, perception)
    sys.stdout.write(json.dumps({"growth_mb": (peak_memory_mb() or 0.0) - before_mb}))


def _case(backend: Backend) -> EpisodeSpec:
    return backend.tasks.create(task_file(BUNDLED_TASKS / TASK).path)


def _play(case: EpisodeSpec, name: str, led: Led, simulator: Simulator, perception: Perception) -> None:
    for outcome in Episode(case, name, led, simulator, perception, ProtocolConfig(), 0).run():
        if outcome.record.error is not None:
            raise SimulationError(f"{name}: {outcome.record.error}")


def _scene(case: EpisodeSpec, simulator: Simulator) -> StageScene:
    return StageScene(case.task_id, case.stages[0].public, "", 0, simulator.objects)


def _tour(agent: Agent, case: EpisodeSpec, simulator: Simulator, perception: Perception) -> None:
    """Lead an agent through every room: it looks ahead and back from places about 1.5 m apart."""
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
