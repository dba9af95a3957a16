"""Stage-Reset (paper, Sec. C.4): Frontier-Update that searches from scratch in every stage."""

from evonav.agents.frontier_update import FrontierUpdate
from evonav.tasks.public import StageInput


class StageReset(FrontierUpdate):
    """Gains nothing from earlier stages, and loses nothing to stale entries."""

    def begin_stage(self, stage: StageInput) -> None:
        """Forgets entries, map, frontiers and ids; keeps the pose."""
        assert self._task is not None, "begin_task comes first"
        self._forget(self._task)
        super().begin_stage(stage)
