"""Generate tasks in several arms that differ in one thing alone (paper, Sec. 4.3; docs/controlled.md).

`pairs`: two goals are drawn in the house as it is. The reference trajectory goes to the second stage's goal, then to
the first stage's; there the house stays as it was (`fixed`) or evolves for certain (`evolved`), and the second stage's
goal is to be found. As a task that is three stages: two in which the agent looks on, and the one that counts, whose
goal is that of stage 1 in the same words and image.

`rates`: a task as any other, its goals drawn in the house as it is, once for each probability of evolution. The draws
of whether a transition evolves are nested: what evolves at 0.25 does so at 0.5, too.
"""

import dataclasses
from collections import Counter
from collections.abc import Sequence

from evonav.controlled.layout import Arm, ControlledOptions
from evonav.generation.pipeline import TaskRejectedError, generate_task
from evonav.generation.result import GivenStage
from evonav.house import House
from evonav.tasks.dataset import RejectReason
from evonav.tasks.manifest import Control, Task
from evonav.tasks.parameters import GenerationParameters

NUM_ATTEMPTS = 8
"""Draws of goals and changes before a house is given up."""
_ANEW: tuple[RejectReason, ...] = ("no_valid_goal", "not_evolved")
"""Reasons of an arm that another draw may do without."""


def generate_arms(house: House, options: ControlledOptions, *, seed: int) -> dict[str, Task]:
    """Generate a task in every arm, by the arm's name.

    Where a goal cannot be one in some arm, or the house does not evolve where it must, goals and changes are drawn
    again for all arms: no arm is chosen for what became of another.

    Raises:
        TaskRejectedError: The house does not allow it; the message says why.
        HouseError: An asset is unknown, unless allowed.
    """
    failed: list[TaskRejectedError] = []
    for attempt in range(NUM_ATTEMPTS):
        goals = _draw_goals(house, options, seed, attempt)
        try:
            return {arm.name: _arm(house, options, seed, attempt, arm, goals) for arm in options.arms}
        except TaskRejectedError as error:
            if error.reason not in _ANEW:
                raise
            failed.append(error)
    counts = Counter(error.reason for error in failed)
    reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(counts.items()))
    last = failed[-1]
    raise TaskRejectedError(house.name, last.reason, last.stage, f"{NUM_ATTEMPTS} draws: {reasons}; the last: {last}")


def _draw_goals(house: House, options: ControlledOptions, seed: int, attempt: int) -> tuple[str, ...]:
    """Draw the goals of a house that does not evolve."""
    parameters = options.parameters.model_copy(update={"evolve_probability": 0.0})
    given: tuple[GivenStage, ...] = ()
    if options.kind == "pairs":
        # What evolves is outside of the room where the trajectory ends, so the other goal must be, too.
        parameters = parameters.model_copy(update={"previous_goal_room_multiplier": 0.0})
        given = (GivenStage(), GivenStage())
    task = _task(house, options, seed, attempt, parameters, given)
    return tuple(stage.target.id for stage in task.oracle_stages)


def _arm(house: House, options: ControlledOptions, seed: int, attempt: int, arm: Arm, goals: Sequence[str]) -> Task:
    is_pair = options.kind == "pairs"
    parameters = options.parameters.model_copy(update={"evolve_probability": arm.evolve_probability})
    given = [GivenStage(goal_id=goal) for goal in goals]
    shown = tuple(range(1, len(goals) + 1))
    guided: tuple[int, ...] = ()
    if is_pair:
        given = [
            GivenStage(goal_id=goals[0]),
            GivenStage(goal_id=goals[1], is_evolved=False),
            GivenStage(goal_id=goals[0], is_evolved=arm.evolve_probability == 1.0),
        ]
        shown, guided = (1, 2, 1), (1, 2)
    task = _task(house, options, seed, attempt, parameters, given)
    if is_pair and arm.evolve_probability == 1.0 and task.oracle(3).evolution.outcome != "evolved":
        detail = f"{task.oracle(3).evolution.outcome} ({task.oracle(3).evolution.failure})"
        raise TaskRejectedError(house.name, "not_evolved", 3, detail)
    control = Control(arm=arm.name, attempt=attempt, guided_stages=guided, shown_goals=shown)
    task = dataclasses.replace(
        task,
        header=task.header.model_copy(update={"control": control}),
        public_stages=tuple(
            task.public_stages[other - 1].model_copy(update={"stage": k}) for k, other in enumerate(shown, start=1)
        ),
        reference_images=tuple(task.reference_images[other - 1] for other in shown),
    )
    return task.with_checksums()


def _task(
    house: House,
    options: ControlledOptions,
    seed: int,
    attempt: int,
    parameters: GenerationParameters,
    given: Sequence[GivenStage],
) -> Task:
    return generate_task(
        house,
        seed=seed,
        config=parameters,
        dataset=f"controlled-{options.kind}",
        allow_unknown_assets=options.allow_unknown_assets,
        given=given,
        attempt=attempt,
    )
