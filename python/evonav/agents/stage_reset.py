"""Stage-Reset (paper, Sec. C.4): Frontier-Update that searches from scratch in every stage."""

from evonav.agents.frontier_update import FrontierUpdate
from evonav.agents.navigator import Navigator
from evonav.tasks.public import StageInput


class StageReset(FrontierUpdate):
    """Gains nothing from earlier stages, and loses nothing to stale entries."""

    def begin_stage(self, stage: StageInput) -> None:
        """Forgets entries, map, frontiers, views and ids; keeps the pose."""
        self._navigator = Navigator(self._task.map_frame, self.config.navigator)
        super().begin_stage(stage)
