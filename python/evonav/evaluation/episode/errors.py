"""Define the failure of an agent that runs in its own process."""

from evonav.errors import EvonavError
from evonav.evaluation.records.schema import ErrorKind


class AgentFailedError(EvonavError):
    """An agent in its own process has failed: it raised an exception, died, or did not answer in time."""

    def __init__(self, kind: ErrorKind, message: str, traceback: str = "") -> None:
        """Create an error of one of the agent's own kinds (`ErrorKind.is_agents`).

        Args:
            kind: The kind of failure.
            message: A description in one or a few lines.
            traceback: The traceback of the agent's process.
        """
        super().__init__(message)
        self.kind = kind
        self.traceback = traceback
