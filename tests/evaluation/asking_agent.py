"""An agent that tries to reach a model's server, key and exchanges past the evaluator, and to break the connection."""

import os
import socket
from pathlib import Path

from evonav.agents.agent import SensorConfig, Stop
from evonav.agents.explanation import Explanation
from evonav.decision.prompts import Prompt
from evonav.errors import DecisionError, InvalidArgumentError


class Asking:
    def __init__(self, decision):
        self.sensors = SensorConfig()
        self._client = decision.model.client
        self._found = {}

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        text = goal.unified_instruction
        self._found = {
            "answer": self._client.ask(Prompt.of("What is 1 + 1?")),
            "first cached": self._client.ask_first((Prompt.of("Another question?"), Prompt.of("What is 1 + 1?")))[0],
            "none cached": self._client.ask_first((Prompt.of(f"{text}?"), Prompt.of(f"{text}!")), otherwise=1)[0],
            "key": os.environ.get("OPENAI_API_KEY"),
            "held": sorted(vars(self._client)) if hasattr(self._client, "__dict__") else [],
            "large": self._large(),
            "server": _tried(lambda: socket.create_connection(("127.0.0.1", 80))),
            "exchanges": _tried(lambda: Path(text.split()[-1]).read_bytes()),
        }
        if goal.stage == 2:
            os.write(self._client._descriptor, b"\xff" * 8)
            self._found["broken"] = _tried(lambda: self._client.ask(Prompt.of("Still there?")))
        if goal.stage == 3:
            message = b'{"prompts": [], "attempt": 0, "otherwise": 0, "images": []}\n'
            os.write(self._client._descriptor, len(message).to_bytes(8, "little") + message)

    def _large(self):
        try:
            return self._client.ask(Prompt.of("x" * (65 << 20)))
        except (DecisionError, InvalidArgumentError) as error:
            return str(error)

    def act(self, observation):
        return Stop()

    def explain(self):
        return Explanation(details=self._found)


def _tried(action):
    try:
        return str(action())
    except Exception as error:
        return type(error).__name__
