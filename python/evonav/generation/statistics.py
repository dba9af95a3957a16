"""What a set of tasks is like, in the paper's own measures (Sec. 3.2, its figure of statistics)."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import median

from evonav.tasks.manifest import Task


@dataclass(frozen=True)
class TaskStatistics:
    """Counts over tasks; shares are properties."""

    num_tasks: int = 0
    num_stages: Counter[int] = field(default_factory=Counter)
    """Tasks by number of stages."""
    num_evolutions: Counter[int] = field(default_factory=Counter)
    """Tasks by number of evolved transitions."""
    outcomes: Counter[str] = field(default_factory=Counter)
    """Transitions by outcome."""
    modes: Counter[str] = field(default_factory=Counter)
    """Evolved transitions by mode."""
    num_relocated: dict[str, list[int]] = field(default_factory=dict)
    """Objects relocated at each evolved transition, by mode."""
    num_unmoved: int = 0
    """Objects that were to move and found no place."""
    num_later_goals: int = 0
    """Goals of stages after the first."""
    num_relocated_goals: int = 0
    """Of these, relocated at some time before."""
    num_evolved_goals: int = 0
    """Goals of stages whose house has just changed."""
    num_goals_in_changed_room: int = 0
    num_goals_just_relocated: int = 0
    num_repeated_rooms: int = 0
    """Evolutions of the room that evolved at the transition before, which evolved too."""
    num_consecutive_evolutions: int = 0
    relocated_ratios: tuple[float, ...] = ()
    """Per task, share of the house's objects relocated at some time."""
    rejected_goals: Counter[str] = field(default_factory=Counter)

    @property
    def share_evolved_transitions(self) -> float:
        """The paper: about 0.5 (49.4% static)."""
        return self.outcomes["evolved"] / max(1, sum(self.outcomes.values()))

    @property
    def share_relocated_goals(self) -> float:
        """The paper: 0.379 (of goals after stage 1)."""
        return self.num_relocated_goals / max(1, self.num_later_goals)

    @property
    def median_relocated_ratio(self) -> float:
        """The paper: between 0.1 and 0.2."""
        return median(self.relocated_ratios) if self.relocated_ratios else 0.0


def statistics_of(tasks: Iterable[Task]) -> TaskStatistics:
    """Counts a set of tasks."""
    counts: Counter[str] = Counter()
    num_stages: Counter[int] = Counter()
    num_evolutions: Counter[int] = Counter()
    outcomes: Counter[str] = Counter()
    modes: Counter[str] = Counter()
    rejected: Counter[str] = Counter()
    num_relocated: dict[str, list[int]] = {}
    ratios: list[float] = []
    for task in tasks:
        num_stages[task.num_stages] += 1
        evolutions = [stage.evolution for stage in task.oracle_stages]
        num_evolutions[sum(evolution.outcome == "evolved" for evolution in evolutions)] += 1
        ratios.append(len(task.oracle_stages[-1].ever_relocated_ids) / task.header.house.num_objects)
        rejected.update(rejection.reason for stage in task.oracle_stages for rejection in stage.rejections)
        previous_room = None
        for stage in task.oracle_stages[1:]:
            evolution, target = stage.evolution, stage.target
            outcomes[evolution.outcome] += 1
            counts["later"] += 1
            counts["relocated"] += target.is_relocated_ever
            counts["unmoved"] += len(evolution.unmoved_ids)
            if evolution.outcome == "evolved" and evolution.mode is not None:
                modes[evolution.mode] += 1
                num_relocated.setdefault(evolution.mode, []).append(len(evolution.relocated_ids))
                counts["evolved"] += 1
                counts["in room"] += target.room_id == evolution.room_id
                counts["just"] += target.is_relocated_now
                counts["consecutive"] += previous_room is not None
                counts["repeated"] += previous_room == evolution.room_id
            previous_room = evolution.room_id if evolution.outcome == "evolved" else None
    return TaskStatistics(
        num_tasks=len(ratios),
        num_stages=num_stages,
        num_evolutions=num_evolutions,
        outcomes=outcomes,
        modes=modes,
        num_relocated=num_relocated,
        num_unmoved=counts["unmoved"],
        num_later_goals=counts["later"],
        num_relocated_goals=counts["relocated"],
        num_evolved_goals=counts["evolved"],
        num_goals_in_changed_room=counts["in room"],
        num_goals_just_relocated=counts["just"],
        num_repeated_rooms=counts["repeated"],
        num_consecutive_evolutions=counts["consecutive"],
        relocated_ratios=tuple(ratios),
        rejected_goals=rejected,
    )
