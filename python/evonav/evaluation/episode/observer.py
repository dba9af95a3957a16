"""Observe episodes, and attribute the errors of a stage."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from evonav.agents.hosting import error_text
from evonav.errors import DecisionError, SimulationError, SimulatorLostError
from evonav.evaluation.hosting.process import AgentFailedError
from evonav.evaluation.records.schema import ErrorKind, RoundRecord
from evonav.parallel.local import EndedError
from evonav.sensors.observation import Observation
from evonav.world.simulator import Simulator


class EpisodeObserver(Protocol):
    """Observes a running episode (`evonav.replay.replay`) without changing the agent or the record.

    If it raises `AgentFailedError`, the stage fails as if the agent had failed.
    """

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        """Note that a stage's house is loaded; the agent has not received the goal yet."""
        ...

    def house_changes(self, simulator: Simulator) -> None:
        """Note that the house has changed during the stage, before the views of the next round."""
        ...

    def round_begins(self, observation: Observation) -> None:
        """Receive the observation that the agent receives next."""
        ...

    def round_ends(self, record: RoundRecord) -> None:
        """Receive the record of a round, after the agent's action was executed."""
        ...


class StageFailedError(Exception):
    """A stage that cannot continue, and the kind of its error."""

    def __init__(self, kind: ErrorKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


@contextmanager
def attribute_errors(kind: ErrorKind) -> Iterator[None]:
    """Turn exceptions into a stage failure of `kind`; errors with a cause of their own keep it."""
    try:
        yield
    except StageFailedError:
        raise
    except AgentFailedError as error:
        raise StageFailedError(error.kind, str(error)) from error
    except DecisionError as error:
        raise StageFailedError(ErrorKind.DECISION, error_text.message_of(error)) from error
    except Exception as error:
        if kind is ErrorKind.AGENT:
            raise _agent_failed(error) from error
        if isinstance(error, SimulationError):
            is_lost = isinstance(error, SimulatorLostError)
            kind = ErrorKind.SIMULATOR_LOST if is_lost else ErrorKind.SIMULATION
            raise StageFailedError(kind, str(error)) from error
        raise StageFailedError(kind, f"{type(error).__name__}: {error}") from error
    except (KeyboardInterrupt, EndedError):  # the user's, the driver's
        raise
    except BaseException as error:  # `sys.exit()` in an agent ends its stage, not the run
        if kind is not ErrorKind.AGENT:
            raise
        raise _agent_failed(error) from error


def _agent_failed(error: BaseException) -> StageFailedError:
    return StageFailedError(ErrorKind.AGENT, error_text.describe(error, caller="evonav.evaluation"))


def traceback_of(failure: StageFailedError) -> str:
    """Return the traceback of a failure; for an agent in its own process, that process's."""
    cause = failure.__cause__ or failure
    return (isinstance(cause, AgentFailedError) and cause.traceback) or error_text.traceback_of(cause)
