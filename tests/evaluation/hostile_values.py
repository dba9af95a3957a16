"""Agents that answer what no agent may: each stage of a long task has a mischief of its own; see its test."""

import math
from dataclasses import replace
from itertools import islice

import numpy as np
import toy_house
from toy_agents import Explorer

from evonav.agents.agent import EntryBelief, Move, NavigateTo, SensorConfig, Stop, ViewSchedule
from evonav.agents.explanation import Explanation
from evonav.agents.hosting import wire
from evonav.errors import DecisionError
from evonav.world.simulator import Action


def entry(**values):
    return EntryBelief(**{**WELL_BEHAVED, **values})


WELL_BEHAVED = {
    "entry_id": 1,
    "label": "Mug",
    "centre_m": (0.0, 0.0, 0.0),
    "size_m": (1.0, 1.0, 1.0),
    "num_detections": 1,
}
CYCLE = []
CYCLE.append(CYCLE)

# What the agent says, and a part of the message of its error; `None` where it is no failure.
ENTRIES = {
    "nan": ([entry(centre_m=(0.0, math.nan, 0.0))], "entries.0.centre_m.1 = nan: Input should be a finite number"),
    "infinite": ([entry(size_m=(math.inf, 1.0, 1.0))], "entries.0.size_m.0 = inf: Input should be a finite number"),
    "nan of NumPy": ([entry(centre_m=np.array([0.0, np.nan, 0.0]))], "entries.0.centre_m.1 = nan"),
    "far": ([entry(centre_m=(1e308, 0.0, -1e308))], "entries.0.centre_m.0 = 1e+308: Input should be less than"),
    "large": ([entry(size_m=(1e308, 1e308, 1e308))], "entries.0.size_m.0 = 1e+308: Input should be less than"),
    "inside out": ([entry(size_m=(-1.0, 1.0, 1.0))], "size_m = -1.0: must be 0 to 1000000"),
    "many digits": ([entry(centre_m=(10**400, 0, 0))], "entries.0.centre_m.0 = 1000"),
    "long id": ([entry(entry_id=2**63)], "entry_id must have at most 64 bits"),
    "count": ([entry(num_detections=10**30)], ": must be 0 to 1000000000000000"),
    "negative": ([entry(num_detections=-1)], ": must be 0 to 1000000000000000"),
    "novel": ([entry(label="x" * 1_000_000)], "label must have at most 1000 characters"),
    "true": ([entry(entry_id=True)], "entries.0.entry_id = True: Input should be a valid integer"),
    "too many": ([entry(entry_id=i) for i in range(200_000)], "bytes of JSON: must be at most 16000000"),
    "none": (None, "TypeError: 'NoneType' object is not iterable"),
    "words": (["a"], "entries.0 = 'a': Input should be an object"),
    "half": ([{"entry_id": 1}], 'missing "entries.0.label"'),
    "markup": ([entry(label="<script>alert(1)</script>")], None),
    "twins": ([entry(), entry()], None),
    "surrogate": ([entry(label="\ud800\x00")], None),
}
SENSORS = {
    "nan": (SensorConfig(max_travel_m=math.nan), "sensors.max_travel_m = nan"),
    "infinite": (SensorConfig(occupancy_range_m=math.inf), "sensors.occupancy_range_m = inf"),
    "far": (SensorConfig(occupancy_range_m=1e308), "sensors.occupancy_range_m = 1e+308: Input should be"),
    "backwards": (SensorConfig(max_travel_m=-1.0), "sensors.max_travel_m = -1.0: must be in"),
    "blind": (SensorConfig(later_rounds=ViewSchedule(0, 10.0)), "sensors.later_rounds.count = 0"),
    "fly": (
        SensorConfig(later_rounds=ViewSchedule(2**70, 10.0)),
        "sensors.later_rounds.count = 1180591620717411303424",
    ),
    "spinning": (
        SensorConfig(later_rounds=ViewSchedule(3, 1e308)),
        "sensors.later_rounds.spacing_deg = 1e+308: Input should be less than",
    ),
    "magic": (SensorConfig(motion="teleport"), "sensors.motion = 'teleport'"),
    "none": (None, "sensors = None"),
    "novel": ("x" * 2_000_000, "sensors: 2000002 bytes of JSON: must be at most 1000000"),
    "tiny": (SensorConfig(max_travel_m=1e-320), None),
}
ACTIONS = {
    "nan": (NavigateTo((math.nan, 0.0)), "navigate_to.position_m.0 = nan: Input should be a finite number"),
    "infinite face": (
        NavigateTo((1.0, 1.0), (math.inf, 0.0)),
        "navigate_to.face_m.0 = inf: Input should be a finite number",
    ),
    "far": (NavigateTo((1e308, -1e308)), "navigate_to.position_m.0 = 1e+308: Input should be less than"),
    "far face": (NavigateTo((1.0, 1.0), (1e308, 1e308)), "navigate_to.face_m.0 = 1e+308: Input should be less than"),
    "many digits": (NavigateTo((10**400, 0)), "navigate_to.position_m.0 = "),
    "three": (NavigateTo((1.0, 2.0, 3.0)), "action.navigate_to.position_m"),
    "novel": (Stop("x" * 5_000_000), "action: 5000027 bytes of JSON: must be at most 1000000"),
    "long": (Stop("x" * 500_000), None),
    "surrogate": (Stop("\ud800\x00"), None),
    "no reason": (Stop(None), "action.stop.reason = None"),
    "flight": (Move("FLY"), "action.move.action = 'FLY'"),
    "text": ("x" * 3_000_000, "xxx ..."),
    "none": (None, "None is no action"),
}
DIAGNOSTICS = {
    "nan": (Explanation(counters={"a": math.nan}), "diagnostics.counters.a = nan"),
    "half": (Explanation(counters={"a": 1.5}), "diagnostics.counters.a = 1.5"),
    "large": (
        Explanation(counters={"a": 2**63}),
        "counters.a = 9223372036854775808: must be -1000",
    ),
    "number": (Explanation(num_entries=10**50), ": must be 0 to 1000000000000000"),
    "negative": (Explanation(num_frontiers=-1), "num_frontiers = -1: must be 0 to 1000000000000000"),
    "many": (Explanation(counters={str(i): i for i in range(2000)}), "counters must be at most 1000"),
    "entry": (Explanation(chosen_entry=entry(centre_m=(math.nan, 0.0, 0.0))), "chosen_entry.centre_m.0 = nan"),
    "far": (Explanation(chosen_entry=entry(centre_m=(1e308, 0.0, 0.0))), "chosen_entry.centre_m.0 = 1e+308: Input"),
    "digits": (Explanation(details={"a": 10**5000}), "Invalid JSON"),
    "bytes": (Explanation(details={"a": b"\xff"}), "diagnostics: not JSON-ready"),
    "cycle": (Explanation(details={"a": CYCLE}), "diagnostics: not JSON-ready: Circular reference"),
    "key": (Explanation(details={"\ud800": 1}), "diagnostics: not JSON-ready"),
    "text": ("none", "explain = 'none'"),
    "long": (Explanation(choice="x" * 900_000), None),
    "anything": (Explanation(details={"a": math.nan, "b": [-math.inf], math.nan: {None: True}}), None),
}
STAGES = [
    (kind, value, message)
    for kind, values in (("entries", ENTRIES), ("sensors", SENSORS), ("act", ACTIONS), ("diagnostics", DIAGNOSTICS))
    for value, message in values.values()
]


class NamelessType(type):
    @property
    def __name__(cls):
        raise ValueError("no name")


class ExitingError(Exception):
    def __str__(self):
        raise SystemExit(3)


class NumericError(Exception):
    def __str__(self):
        return 5


def deep_chain():
    error = None
    for number in range(3000):
        later = RuntimeError(str(number))
        later.__cause__, error = error, later
    return error


def named_at_length():
    name = "f" * 1_000_000
    exec(f"def {name}(): raise RuntimeError('long')\n{name}()", {"__name__": "m" * 1_000_000})


ERRORS = [
    (lambda: RuntimeError("x" * 50_000_000), "RuntimeError: xxx"),
    (lambda: DecisionError("x" * 50_000_000), "xxx"),
    (lambda: type("N" * 1_000_000, (Exception,), {})("a"), "NNN"),
    (lambda: NamelessType("Nameless", (Exception,), {})("a"), "Nameless: a"),
    (ExitingError, "ExitingError: (its message cannot be read)"),
    (NumericError, "NumericError: (its message cannot be read)"),
    (deep_chain, "RuntimeError: 2999"),
    (lambda: RuntimeError("a\n\x1b[31mb\r\x00"), "RuntimeError: a\n\x1b[31mb\r\x00"),
    (named_at_length, "RuntimeError: long"),
]
ENDS = [lambda: SystemExit(5), lambda: GeneratorExit(), lambda: BaseException("over")]
"""Raised in the evaluator's own process, they cost a stage; in its own, the agent loses its process."""


class Saying(Explorer):
    """Says in each stage what `STAGES` has for it."""

    kind, value = "", None

    @property
    def sensors(self):
        return self.value if self.kind == "sensors" else SensorConfig()

    @sensors.setter
    def sensors(self, sensors):
        pass

    def begin_stage(self, goal):
        super().begin_stage(goal)
        self.kind, self.value, _ = STAGES[goal.stage - 1]
        self.has_acted = False

    def act(self, observation):
        self.has_acted = True
        return self.value if self.kind == "act" else super().act(observation)

    def entries(self):
        return self.value if self.kind == "entries" else []

    def explain(self):
        has_acted = self.kind == "diagnostics" and self.has_acted
        return self.value if has_acted else Explanation(objects=self.entries)


class Raising(Explorer):
    """Raises in each stage what `errors` has for it."""

    errors = tuple(make for make, _ in ERRORS)

    def act(self, observation):
        if self.stage <= len(self.errors):
            raise self.errors[self.stage - 1]()
        return super().act(observation)


class Ending(Raising):
    errors = tuple(ENDS)


class Talkative(Explorer):
    """Says little enough in each round, and too much in a stage."""

    def act(self, observation):
        return Move(Action.TURN_LEFT)

    def explain(self):
        return Explanation(details={"thoughts": "x" * 999_000} if self.stage == 1 else {})


def raw_entry(text):
    return b'[{"entry_id":1,"label":"Mug","centre_m":[%b,0,0],"size_m":[1,1,1],"num_detections":1}]' % text


RAW = [
    ("ENTRIES", raw_entry(b"NaN"), "entries.0.centre_m.0 = nan"),
    ("ENTRIES", raw_entry(b"1e999"), "entries.0.centre_m.0 = inf"),
    ("ENTRIES", raw_entry(b'"0"'), "entries.0.centre_m.0 = '0'"),
    ("ENTRIES", b"[" * 100_000, "Invalid JSON"),
    ("ENTRIES", b"[" + b" " * 20_000_000 + b"]", "entries: 20000002 bytes of JSON: must be at most 16000000"),
    ("DIAGNOSTICS", b'{"details":' + b'{"a":' * 100_000, "Invalid JSON"),
    ("DIAGNOSTICS", b'{"details":{"a":"' + b"x" * 2_000_000 + b'"}}', "bytes of JSON: must be at most 1000000"),
    ("COSTS", b'{"cost_usd":NaN}', None),
    ("COSTS", b'{"agent_peak_rss_mb":1e999}', None),
    ("COSTS", b'{"input_tokens":-1}', None),
    ("COSTS", b'{"wall_s":0}', None),
    ("COSTS", b'{"cost_usd":' + b"9" * 5000 + b"}", None),
    ("SENSORS", b'{"max_travel_m":NaN}', "sensors.max_travel_m = nan"),
]


class Forging(Explorer):
    """Writes in each stage the JSON that `RAW` has, where `wire` would write its answer."""

    def begin_stage(self, goal):
        super().begin_stage(goal)
        for part in (wire.ENTRIES, wire.DIAGNOSTICS, wire.COSTS, wire.SENSORS):
            part.__dict__.pop("write", None)
        wire.Entries.write = lambda self, entries: wire.ENTRIES.write(entries)
        if goal.stage <= len(RAW):
            name, text, _ = RAW[goal.stage - 1]
            getattr(wire, name).__dict__["write"] = lambda value: text

    def explain(self):
        return Explanation()


def load_long(path, num_stages):
    """Read the toy task with its first stage over and over."""
    spec = toy_house.load_spec(path)
    first = spec.stages[0]
    stages = (replace(first, public=replace(first.public, stage=k)) for k in range(1, num_stages + 1))
    return replace(spec, stages=tuple(islice(stages, num_stages)))
