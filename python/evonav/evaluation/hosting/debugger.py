"""Open Python's debugger where an agent raises, for agents under development."""

import pdb
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from evonav.agents.agent import AgentAction
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.agent import LocalAgent
from evonav.tasks.public import Goal, TaskInfo


def check_terminal() -> None:
    """Check that a debugger can be used here; `InvalidArgumentError` if input or output is no terminal."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise InvalidArgumentError(
            "--pdb needs a terminal to type in; without one, --fail-fast prints the traceback of the first error"
        )


@contextmanager
def post_mortem() -> Iterator[None]:
    """Open the debugger at the line that raised, then let the exception pass."""
    try:
        yield
    except Exception as error:
        traceback.print_exc()
        print("the agent raised: look around, then leave with `q`", file=sys.stderr)
        pdb.post_mortem(error.__traceback__)
        raise


class DebuggedAgent(LocalAgent):
    """An agent in the evaluator's own process whose exceptions open the debugger."""

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        with post_mortem():
            super().begin_task(task)

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal."""
        with post_mortem():
            super().begin_stage(goal)

    def act(self) -> AgentAction:
        """Decide what to do in one decision round."""
        with post_mortem():
            return super().act()
