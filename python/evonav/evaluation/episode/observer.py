"""Who looks on at an episode, what hosts its agent, and whose fault it is when a stage cannot go on."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from evonav.agents import error_text
from evonav.errors import DecisionError, SimulationError, SimulatorLostError
from evonav.evaluation.episode.errors import AgentFailedError
from evonav.evaluation.records.schema import ErrorKind, RoundRecord
from evonav.sensors.observation import Observation
from evonav.world.simulator import Simulator


class EpisodeObserver(Protocol):
    """Looks on as an episode runs (`evonav.replay.replay`); nothing of it reaches agent or record.

    What it raises as `AgentFailedError` fails the stage as if the agent had.
    """

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        """A stage's house is loaded; the agent was not told yet."""
        ...

    def round_begins(self, observation: Observation) -> None:
        """What the agent is about to be given."""
        ...

    def round_ends(self, record: RoundRecord) -> None:
        """The agent has acted, and its action was carried out."""
        ...


LOSSES = (ErrorKind.CRASH, ErrorKind.TIMEOUT)
"""Failures that end the agent's process, and its memory with it."""


class StageFailedError(Exception):
    """A stage that cannot go on; carries whose fault it is."""

    def __init__(self, kind: ErrorKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind


@contextmanager
def attribute_errors(kind: ErrorKind) -> Iterator[None]:
    """Turns what is raised inside into a stage failure of `kind`; errors that name their own cause keep it."""
    try:
        yield
    except StageFailedError:
        raise
    except AgentFailedError as error:
        raise StageFailedError(error.kind, str(error)) from error
    except DecisionError as error:
        raise StageFailedError(ErrorKind.DECISION, error_text.clean(str(error))) from error
    except Exception as error:
        if kind is ErrorKind.AGENT:
            raise StageFailedError(kind, error_text.describe(error, caller="evonav.evaluation")) from error
        if isinstance(error, SimulationError):
            is_lost = isinstance(error, SimulatorLostError)
            kind = ErrorKind.SIMULATOR_LOST if is_lost else ErrorKind.SIMULATION
            raise StageFailedError(kind, str(error)) from error
        raise StageFailedError(kind, f"{type(error).__name__}: {error}") from error


def traceback_of(failure: StageFailedError) -> str:
    """Where it came from; of an agent in a process of its own, in that."""
    cause = failure.__cause__ or failure
    return (isinstance(cause, AgentFailedError) and cause.traceback) or error_text.traceback_of(cause)
