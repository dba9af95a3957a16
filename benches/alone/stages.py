"""Stages of evaluations: the core's part of them alone, and what agents' own processes need at least."""

import gc
import statistics
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

from benches.alone.round_trip import BarePair, Round
from benches.alone.row import Alone, Figure, sums
from benches.alone.tape import recording
from evonav.agents.agent import Agent, AgentAction, RoundDiagnostics
from evonav.agents.hosting import wire
from evonav.agents.hosting.requests import read_request, write_request
from evonav.agents.hosting.shared_slots import Places, SharedSlots
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.agent import HostedAgent, LocalAgent, RemoteAgent
from evonav.evaluation.hosting.channel import SharedBlock
from evonav.evaluation.hosting.process import AgentHosting
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend, make_agent
from evonav.parallel.work import look_rarely_for_garbage
from evonav.sensors.observation import Observation
from evonav.speed_benchmark.timing import cpu_ms

NUM_TURNS, NUM_BARE_ROUNDS = 3, 100
NUM_KEPT, NUM_CALLS = 4, 20
ISOLATION_AIM = 0.05
BACKEND = Backend()


def rows(what: str, agents: Sequence[str], tasks: Sequence[Path], aim: str, pair: BarePair | None) -> Iterator[str]:
    """Rows of stages of agents at tasks, and, with a bare pair of processes, of the agent's process."""
    gc.collect()
    look_rarely_for_garbage()
    found: dict[str, list[float]] = defaultdict(list)
    with closing(AgentProcesses(AgentHosting())) as processes:
        for task in tasks:
            for agent in agents:
                for name, times_ms in _measured(task, agent, processes, pair).items():
                    found[name] += times_ms
    python = "all Python: evaluator, agent, messages"
    parts = [
        Alone("the core's calls again, with the same arguments", found["core"], python),
        Alone("of these, updates of the object map", found["update"], "the same, all other calls"),
        Alone("of these, drawing", found["render"], "the same, all other calls"),
    ]
    work = f"{what}: a stage of {statistics.fmean(found['rounds']):.0f} rounds"
    yield from Figure(f"{work}, the agent in a process of its own", found["apart"], aim).rows(*parts)
    yield from Figure("the same in one process", found["within"]).rows(parts[0])
    if pair is None:
        return
    more = [a - b for a, b in zip(found["apart"], found["within"], strict=True)]
    aim_ms = [ISOLATION_AIM * one for one in found["within"]]
    yield from Figure("what the agent's process adds to that", more, "5% of a stage", aim_ms).rows(
        Alone("two bare processes: arrays copied, messages of these sizes", found["copied"], "pickling, cold caches"),
        Alone("the same without the copy", found["sent"], "also that the images are the agent's own"),
        Alone("its requests written and read in one process", found["messages"], "switching, answers, cold caches"),
        Alone("this and the processes without a copy", sums(found["messages"], found["sent"]), "answers, cold caches"),
    )


def _measured(task: Path, agent: str, processes: AgentProcesses, pair: BarePair | None) -> dict[str, list[float]]:
    """CPU milliseconds of a stage, a mean over those of a task, in each turn; and its number of rounds."""
    _stages_ms(_read(task), agent, LocalAgent(_made(agent)))  # imports what it needs
    spec = _read(task)
    with recording() as tape:
        noted = _Noted(_made(agent))
        num_stages = len(_stages_ms(spec, agent, noted))
    tape.check()
    num_rounds = len(noted.rounds) / num_stages
    found: dict[str, list[float]] = defaultdict(list)

    def apart() -> None:
        with closing(RemoteAgent(processes, agent, BACKEND.decision, 0)) as remote:
            found["apart"].append(statistics.fmean(_stages_ms(_read(task), agent, remote)))

    def within() -> None:
        found["within"].append(statistics.fmean(_stages_ms(_read(task), agent, LocalAgent(_made(agent)))))

    def core() -> None:
        clocked_ms = {"update": 0.0, "render": 0.0}
        found["core"].append(cpu_ms(lambda _: _drop(tape.replay(clocked_ms)), 0) / num_stages)
        for name, ms in clocked_ms.items():
            found[name].append(ms / num_stages)

    def rounds() -> None:
        found["rounds"].append(num_rounds)
        if pair is not None:
            bare = partial(pair.round_ms, _mean(noted.rounds), NUM_BARE_ROUNDS)
            found["copied"].append(num_rounds * bare(copies=True))
            found["sent"].append(num_rounds * bare(copies=False))
            found["messages"].append(num_rounds * noted.messages_ms())

    apart()  # starts the process
    found.clear()
    turn = (apart, within, core, rounds)
    for number in range(NUM_TURNS):
        for measure in turn[:: 1 if number % 2 else -1]:
            measure()
    return found


def _drop(_: object) -> None:
    """Let objects of the core be freed within the time."""


def _made(agent: str) -> Agent:
    return make_agent(agent, BACKEND.decision.create(0))


def _read(task: Path) -> EpisodeSpec:
    return BACKEND.tasks.create(task)


def _stages_ms(spec: EpisodeSpec, name: str, agent: HostedAgent) -> list[float]:
    """Run an episode; return the CPU milliseconds of its stages, the agent's process included."""
    simulator, perception = BACKEND.simulator.create(), BACKEND.perception.create()
    episode = Episode(spec, name, agent, simulator, perception, ProtocolConfig(), 0)
    with closing(simulator):
        outcomes = list(episode.run())
    for outcome in outcomes:
        if outcome.failure is not None:
            raise AssertionError(f"{spec.task_id}: {outcome.failure.message}")
    return [1e3 * outcome.cpu_s for outcome in outcomes]


class _Noted(LocalAgent):
    """Notes what would go to a process and back in each round."""

    def __init__(self, agent: Agent) -> None:
        super().__init__(agent)
        self.rounds: list[Round] = []
        self._kept: deque[Observation] = deque(maxlen=NUM_KEPT)
        self._block = SharedBlock()
        self._slots = SharedSlots(self._block.descriptor)
        self._array_bytes = self._request_bytes = self._answer_bytes = 0

    def look(self, observation: Observation, *, wants_entries: bool = False) -> None:
        """Note the request."""

        def put(arrays: Iterable[object]) -> Places:
            places = self._block.write(arrays)
            self._array_bytes = places[3]
            return places

        self._request_bytes = len(write_request(0, "act", (observation, wants_entries), put))
        self._kept.append(observation)
        super().look(observation, wants_entries=wants_entries)

    def act(self) -> AgentAction:
        """Note the action."""
        action = super().act()
        self._answer_bytes = len(wire.write_action(action))
        return action

    def diagnostics(self) -> RoundDiagnostics:
        """Note the diagnostics; they end a round."""
        found = super().diagnostics()
        self._answer_bytes += len(wire.DIAGNOSTICS.write(found))
        self.rounds.append(Round(self._array_bytes, self._request_bytes, self._answer_bytes))
        return found

    def messages_ms(self) -> float:
        """Return the CPU milliseconds in which a request is written, its arrays copied, and read again."""

        def call(_: int) -> None:
            for observation in self._kept:
                request = write_request(0, "act", (observation, False), self._block.write)
                _drop(read_request(request, self._slots.arrays))
                self._block.free = self._slots.free

        return cpu_ms(call, 0, NUM_CALLS) / len(self._kept)


def _mean(rounds: Sequence[Round]) -> Round:
    columns = zip(*((one.array_bytes, one.request_bytes, one.answer_bytes) for one in rounds), strict=True)
    return Round(*(round(statistics.fmean(column)) for column in columns))
