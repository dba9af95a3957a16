"""Ask the decision model for an agent's process that has no network (`evonav.decision.vlm.relay` is its side).

The key, the address, the recorded exchanges and the spending stay in the evaluator's process. The agent can ask the one
model of the run whatever it likes, within the run's limit of costs, and reach nothing else.
"""

import socket
import threading
import time
from contextlib import suppress

from evonav.component import Component
from evonav.decision.question import DecisionModel
from evonav.decision.vlm.client import VlmClient
from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.relay import (
    RELAYED,
    Known,
    Response,
    read_message,
    read_request,
    response_type,
    write_message,
)
from evonav.errors import EvonavError, InvalidArgumentError

MAX_ERROR = 2000
"""Longest error that an agent is sent, in characters."""


def is_relayed(decision: Component[DecisionModel]) -> bool:
    """Return whether a decision model can be asked for an agent's process."""
    return decision.path == RELAYED


def sandboxed_model_problem(decision: Component[DecisionModel]) -> str | None:
    """Return why agents in a sandbox cannot use a decision model, in a few words; `None` if they can."""
    needs_more = decision.host_options or "path" in decision.options
    if needs_more and not is_relayed(decision):
        return "a decision model of your own needs files or a network, which a sandbox shuts: use `process`"
    return None


class ModelRelay:
    """Answers the questions of one agent's process, one after the other."""

    def __init__(self) -> None:
        """Open the connection; `far_descriptor` is the end for the agent's process, to be closed here then."""
        self._near, self._far = socket.socketpair()
        self.far_descriptor = self._far.fileno()
        self.agents_descriptor = self.far_descriptor
        """Descriptor of that end in the agent's process."""
        self._client: VlmClient | None = None
        self._known: Known = {}
        self._thread: threading.Thread | None = None
        self.cpu_s = 0.0
        """CPU time that it has used."""

    def use(self, decision: Component[DecisionModel]) -> dict[str, object]:
        """Make the client of a decision model, and return the options with which the agent's process makes its side.

        Raises:
            DecisionError: The model cannot be asked.
            InvalidArgumentError: An option makes no sense.
        """
        from evonav.decision.options import VlmOptions

        self._client = VlmOptions(**decision.keywords).client()
        if self._thread is None:
            self._thread = threading.Thread(target=self._serve, daemon=True)
            self._thread.start()
        return {**decision.options, "mode": self._client.mode, "relay": self.agents_descriptor}

    @property
    def is_open(self) -> bool:
        """True if questions can be asked."""
        return self._near.fileno() >= 0

    def costs(self) -> dict[str, float]:
        """Return what the model has cost since `use`, as the evaluator counts it; empty before."""
        return {} if self._client is None else self._client.costs()

    def close_far_end(self) -> None:
        """Close this process's copy of the agent's end."""
        self._far.close()

    def close(self) -> None:
        """End the connection; a question that the model is answering is given up."""
        with suppress(OSError):
            self._near.shutdown(socket.SHUT_RDWR)
        if self._thread is None:
            self._near.close()

    def _serve(self) -> None:
        descriptor = self._near.fileno()
        # An end of the agent's process, or a message of an impossible size, after which no next one can be found.
        with self._near, suppress(OSError, InvalidArgumentError):
            while True:
                answer = response_type().dump_json(self._answer(read_message(descriptor)))
                self.cpu_s = time.thread_time()
                write_message(descriptor, answer)

    def _answer(self, message: bytes) -> Response:
        try:
            prompts, attempt, otherwise = read_request(message, self._known)
        except InvalidArgumentError as error:
            return Response(error=f"malformed question: {error}"[:MAX_ERROR])
        client = self._client
        assert client is not None  # made before the thread
        try:
            index, answer = client.ask_first(prompts, attempt, otherwise=otherwise)
            return Response(answer, index)
        except VlmError as error:
            return Response(failure=error.kind, error=error.message)
        except EvonavError as error:
            return Response(error=str(error)[:MAX_ERROR])
