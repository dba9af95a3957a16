"""Whatever a client sends, the engine answers: a failed action at worst."""

import copy
import math
from typing import Any

import msgpack
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evonav.thor.actions import registry
from evonav.thor.engine import Engine
from evonav.thor.events import Emitter

JsonObject = dict[str, Any]

numbers = st.one_of(
    st.floats(),
    st.floats(-20, 20),
    st.integers(-3, 400),
    st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e-320, 10**300, 2**63, -1]),
)
vectors = st.one_of(
    st.fixed_dictionaries({"x": numbers, "y": numbers, "z": numbers}),
    st.fixed_dictionaries({"x": st.floats(0, 10), "y": st.just(0.9), "z": st.floats(0, 10)}),
    st.dictionaries(st.sampled_from("xyzw"), numbers),
)
texts = st.one_of(
    st.text(max_size=20), st.sampled_from(["2|0", "", "Fridge", "default", "locobot", "\ud800", "x" * 9999])
)
scalars = st.one_of(st.none(), st.booleans(), numbers, texts)
values = st.recursive(
    st.one_of(scalars, vectors),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=6), inner, max_size=4)),
    max_leaves=8,
)


def _settle(engine: Engine, emitter: Emitter, message: JsonObject) -> JsonObject:
    """What the client would read after a message; the client's own decoder must be able to."""
    engine.execute(message)
    fields = emitter.event(message)
    event = msgpack.loads(bytes(fields[0][1]), raw=False, strict_map_key=False)
    agent: JsonObject = event["agents"][0] if "agents" in event else event
    assert isinstance(agent["lastActionSuccess"], bool)
    assert agent["lastActionSuccess"] or agent["errorMessage"]
    assert len(agent["errorMessage"]) < 5000
    position = agent.get("agent", {}).get("position", {"x": 0.0})
    assert all(math.isfinite(value) for value in position.values())
    return agent


def _fresh(house: JsonObject) -> tuple[Engine, Emitter]:
    engine = Engine(width_px=16, height_px=12)
    emitter = Emitter(engine)
    for message in (
        {"action": "Reset", "sceneName": "Procedural"},
        {"action": "Initialize", "renderDepthImage": True, "renderInstanceSegmentation": True},
        {"action": "CreateHouse", "house": copy.deepcopy(house)},
        {"action": "TeleportFull", **house["metadata"]["agent"]},
    ):
        assert _settle(engine, emitter, message)["lastActionSuccess"]
    return engine, emitter


def _arguments(name: str) -> st.SearchStrategy[JsonObject]:
    """Keywords of an action, some of them missing, some unknown, with values of any type."""
    types = registry.parameter_types(name)
    known = st.sampled_from(sorted(types)) if types else st.just("x")
    keys = st.one_of(known, known, known, st.sampled_from(["engine", "self", "agentId", "renderImage", "sequenceId"]))
    return st.dictionaries(keys, values, max_size=6)


# The house is worn out by the actions and thrown away with the engine; sizes would only make it slow.
_NAMES = [name for name in registry.action_names() if name not in {"ChangeResolution"}]


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_any_arguments_are_answered(house: JsonObject, data: st.DataObject) -> None:
    engine, emitter = _fresh(house)
    for _ in range(data.draw(st.integers(1, 6))):
        name = data.draw(st.sampled_from(_NAMES))
        message = {**data.draw(_arguments(name)), "action": name}
        agent = _settle(engine, emitter, message)
        assert "inside the engine" not in agent["errorMessage"], (message, agent["errorMessage"])


def _places(document: Any, path: tuple[Any, ...] = ()) -> dict[tuple[Any, ...], list[tuple[Any, ...]]]:
    """Paths of all values, by their path without indices: rare fields are to come as often as common ones."""
    found: dict[tuple[Any, ...], list[tuple[Any, ...]]] = {}
    inner = (
        document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    )
    for key, value in inner:
        own = (*path, key)
        found.setdefault(tuple("#" if isinstance(part, int) else part for part in own), []).append(own)
        for kind, paths in _places(value, own).items():
            found.setdefault(kind, []).extend(paths)
    return found


_ODD = [
    None,
    True,
    0,
    -1,
    1e5,
    1e9,
    -1e300,
    math.nan,
    math.inf,
    "",
    "2|0",
    "\ud800",
    [],
    {},
    [[]],
    [1],
    {"x": 1},
    10**30,
]


def _changed(data: st.DataObject, house: JsonObject) -> JsonObject:
    """The house with one value gone, doubled, or another."""
    document = copy.deepcopy(house)
    places = _places(document)
    path = data.draw(st.sampled_from(places[data.draw(st.sampled_from(sorted(places, key=str)))]))
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    how = data.draw(st.sampled_from(["gone", "twice", "scaled", "odd", "odd", "odd"]))
    value = holder[path[-1]]
    if how == "gone":
        del holder[path[-1]]
    elif how == "twice" and isinstance(holder, list):
        holder.append(copy.deepcopy(value))
    elif how == "scaled" and isinstance(value, int | float):
        holder[path[-1]] = value * data.draw(st.sampled_from([-1, 1000, 1e-6]))
    else:
        holder[path[-1]] = data.draw(st.sampled_from(_ODD))
    return document


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_any_house_is_loaded_completely_or_refused(house: JsonObject, data: st.DataObject) -> None:
    engine, emitter = _fresh(house)
    changed = _changed(data, house)
    version, agent = engine.scene.version, engine.agent.pose
    settled = _settle(engine, emitter, {"action": "CreateHouse", "house": changed})
    assert "inside the engine" not in settled["errorMessage"]
    if not settled["lastActionSuccess"]:
        assert (engine.scene.version, engine.agent.pose) == (version, agent), "the old scene stays"
    for message in ({"action": "GetReachablePositions"}, {"action": "RotateRight"}, {"action": "MoveAhead"}):
        settled = _settle(engine, emitter, message)
        assert "cannot show" not in settled["errorMessage"]
        assert "inside the engine" not in settled["errorMessage"]
