"""Observe episodes, and attribute the errors of a stage."""

from evonav.agents.hosting import error_text
from evonav.errors import DecisionError, SimulationError, SimulatorLostError
from evonav.evaluation.hosting.process import AgentFailedError
from evonav.evaluation.records.schema import ErrorKind, RoundRecord
from evonav.parallel.local import EndedError
from evonav.sensors.observation import Observation
from evonav.world.simulator import Simulator


class EpisodeObserver:
    """Observes a running episode (`evonav.replay.replay`) without changing the agent or the record.

    If it raises `AgentFailedError`, the stage fails as if the agent had failed.
    """

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        """Note that a stage's house is loaded; the agent has not received the goal yet."""

    def house_changes(self, simulator: Simulator) -> None:
        """Note that the house has changed during the stage, before the views of the next round."""

    def round_begins(self, observation: Observation) -> None:
        """Receive the observation that the agent receives next."""

    def round_ends(self, record: RoundRecord) -> None:
        """Receive the record of a round, after the agent's action was executed."""


class StageFailedError(Exception):
    """A stage that cannot continue, and the kind of its error."""

    def __init__(self, kind: ErrorKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class AttributedErrors:
    """Turns exceptions of a block into a stage failure of a kind; errors with a cause of their own keep it."""

    def __init__(self, kind: ErrorKind) -> None:
        """Store the kind."""
        self._kind = kind

    def __enter__(self) -> None:
        """Begin the block."""

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Raise the failure, if there is one."""
        if error is not None and (failure := _failure(error, self._kind)) is not None:
            raise failure from error


def _failure(error: BaseException, kind: ErrorKind) -> StageFailedError | None:
    """Return what an exception in a part of a stage becomes; `None` if it is to go on as it is."""
    if isinstance(error, StageFailedError | KeyboardInterrupt | EndedError):  # the last two: the user's, the driver's
        return None
    if isinstance(error, AgentFailedError):
        return StageFailedError(error.kind, str(error))
    if isinstance(error, DecisionError):
        return StageFailedError(ErrorKind.DECISION, error_text.message_of(error))
    if kind is ErrorKind.AGENT:  # `sys.exit()` in an agent ends its stage, not the run
        return StageFailedError(ErrorKind.AGENT, error_text.describe(error, caller="evonav.evaluation"))
    if isinstance(error, SimulationError):
        is_lost = isinstance(error, SimulatorLostError)
        return StageFailedError(ErrorKind.SIMULATOR_LOST if is_lost else ErrorKind.SIMULATION, str(error))
    return StageFailedError(kind, f"{type(error).__name__}: {error}") if isinstance(error, Exception) else None


def traceback_of(failure: StageFailedError) -> str:
    """Return the traceback of a failure; for an agent in its own process, that process's."""
    cause = failure.__cause__ or failure
    return (isinstance(cause, AgentFailedError) and cause.traceback) or error_text.traceback_of(cause)
