"""A hostile agent searches everything that it is handed; the target and the simulator's ids must not be there."""

import gc
import json
import types

import numpy as np
import pytest
from toy_house import CHAIR_AWAY, OBJECTS, ToySimulator, episode_spec, write_tasks
from toy_run import SHORT

from evonav.agents.agent import NavigateTo, SensorConfig
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.oracle_baseline import OracleBaseline
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.run.evaluate import evaluate
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.tasks.listing import task_files

FORBIDDEN = (
    "evonav.tasks.oracle",
    "evonav.tasks.manifest",
    "evonav.tasks.files",
    "evonav.house",
    "evonav.world.embedded",
    "evonav.evaluation",
)
CODE = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.MethodType, types.FrameType)


def reachable(roots):
    """Every object that the garbage collector, attributes and array bases lead to, code left out."""
    seen, pending = {}, list(roots)
    while pending:
        thing = pending.pop()
        if id(thing) in seen or isinstance(thing, CODE):
            continue
        seen[id(thing)] = thing
        pending.extend(gc.get_referents(thing))
        if isinstance(thing, np.ndarray) and thing.base is not None:
            pending.append(thing.base)
        for slot in getattr(type(thing), "__slots__", ()):
            pending.append(getattr(thing, slot, None))
    return list(seen.values())


class Hostile:
    """Walks the object graph of all its arguments."""

    sensors = SensorConfig(needs_rgb=True)

    def __init__(self):
        self.handed = []

    def begin_task(self, task):
        self.handed.append(task)

    def begin_stage(self, goal):
        self.handed.append(goal)

    def act(self, observation):
        self.handed.append(observation)
        return NavigateTo((observation.pose.x_m + 1.0, observation.pose.z_m))


@pytest.fixture(scope="module")
def loot():
    agent = Hostile()
    episode = Episode(
        episode_spec("toy-moved"), "h", agent, ToySimulator(), GroundTruthPerception(), ProtocolConfig(max_rounds=4), 0
    )
    records = [outcome.record for outcome in episode.run()]
    assert all(record.is_scored for record in records)
    return reachable(agent.handed)


def test_no_simulator_id_reaches_the_agent(loot):
    ids = {*OBJECTS, "room|1", "room|2", "wall|south", "floor"}
    strings = {thing for thing in loot if isinstance(thing, str)}
    assert "Chair" in strings
    assert not strings & ids
    assert not any(object_id in text for text in strings for object_id in OBJECTS)


def test_no_position_of_an_object_reaches_the_agent(loot):
    places = {*(centre for _, centre, _ in OBJECTS.values()), *CHAIR_AWAY.values()}
    for thing in loot:
        if isinstance(thing, tuple) and len(thing) in (2, 3) and all(isinstance(value, float) for value in thing):
            assert not any(thing in (place, (place[0], place[2])) for place in places)
        if isinstance(thing, np.ndarray) and thing.dtype.kind == "f" and thing.shape[-1:] == (3,):
            flat = thing.reshape(-1, 3)
            assert not any((np.abs(flat - place) < 1e-6).all(axis=1).any() for place in places)


def test_masks_number_detections_and_not_instances(loot):
    for thing in loot:
        if isinstance(thing, np.ndarray) and thing.dtype == np.int32 and thing.ndim == 2 and thing.shape == (48, 48):
            present = np.unique(thing)
            # -1 and then 0, 1, 2 ... without a gap: an instance image of the toy house has gaps and starts at 1.
            assert present.tolist() == list(range(-1 if present[0] == -1 else 0, int(present[-1]) + 1))


def test_nothing_handed_over_can_reach_the_evaluator(loot):
    modules = {type(thing).__module__ for thing in loot}
    assert not {name for name in modules if name.startswith("evonav.evaluation")}
    assert (
        not {"toy_house", "evonav.world.embedded", "evonav.tasks.oracle", "evonav.tasks.manifest", "evonav.tasks.files"}
        & modules
    )


def test_the_whole_occupancy_is_not_there(loot):
    simulator = ToySimulator()
    simulator.reset(episode_spec("toy-moved").stages[0].house_json)
    shape = simulator.occupancy().cells.shape
    assert not any(isinstance(thing, np.ndarray) and thing.shape == shape for thing in loot)


@pytest.fixture(scope="module")
def process_loot(tmp_path_factory):
    """All that an agent finds in a process of its own, after the target has moved."""
    folder = tmp_path_factory.mktemp("x")
    write_tasks(folder / "secret-tasks")
    found = folder / "loot.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOY_LOOT", str(found))
        tasks = task_files(folder / "secret-tasks", 1)
        evaluate(["prying_agent:Prying"], tasks, folder / "secret-run", config=SHORT)
    return json.loads(found.read_text())


def test_no_oracle_data_is_in_an_agents_process(process_loot):
    strings, ids = process_loot["strings"], {*OBJECTS, "room|1", "room|2", "wall|south"}
    assert "Chair" in strings
    assert not [text for text in strings if "toy-moved" in text]  # the task's own name would lead to its targets
    assert not ids & set(strings)
    assert not [text for text in strings if any(name in text for name in ids)]
    places = [*(centre for _, centre, _ in OBJECTS.values()), *CHAIR_AWAY.values()]
    flat = [[x, z] for x, _, z in places]
    assert process_loot["points"]
    assert not [point for point in process_loot["points"] if point in map(list, places) or point in flat]
    simulator = ToySimulator()
    simulator.reset(episode_spec("toy-moved").stages[0].house_json)
    assert [48, 48, 3] in process_loot["shapes"]
    assert list(simulator.occupancy().cells.shape) not in process_loot["shapes"]


def test_no_path_of_tasks_or_records_is_told_to_an_agents_process(process_loot):
    told = [*process_loot["strings"], *process_loot["system"]]
    assert any("TOY_LOOT=" in text for text in told)
    assert not [text for text in told if "secret-" in text]


def test_an_agents_process_loads_nothing_of_the_evaluator(process_loot):
    modules = process_loot["modules"]
    assert "evonav.agents.hosting.serving" in modules
    assert not [name for name in modules if name.startswith(FORBIDDEN) or name == "toy_house"]


class Impostor(OracleBaseline):
    """Inherits from the oracle baselines and hopes to be given something."""

    told = False

    def reveal_target(self, position_m):
        Impostor.told = True

    def reveal_sighting(self, sighting):
        Impostor.told = True

    def act(self, observation):
        return self._go_to_target(observation)


def test_inheriting_from_an_oracle_baseline_gives_nothing():
    episode = Episode(
        episode_spec("toy-moved"), "i", Impostor(), ToySimulator(), GroundTruthPerception(), ProtocolConfig(), 0
    )
    first = next(iter(episode.run())).record
    assert not Impostor.told
    assert first.state is EndState.ERRORED  # its target is unknown: NaN is no place to go
