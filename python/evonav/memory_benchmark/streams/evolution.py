"""Make the houses of a stream's visits with the generator of tasks (paper, Algorithm 1, and its extensions)."""

from dataclasses import dataclass

from evonav._core import House
from evonav.errors import HouseError
from evonav.generation.pipeline import TaskRejectedError, generate_task
from evonav.memory_benchmark.streams.spec import Kind
from evonav.tasks.parameters import Extensions, GenerationParameters, Occurrence, Schedule

NUM_VISITS = 4
NUM_DAY_VISITS = 10
HOURS_BETWEEN_VISITS = 4.0
NUM_ATTEMPTS = 8
"""Tries to make a stream whose house changes before every visit; then the one with the most changed visits is taken."""
_COME_AND_GO = Occurrence(probability=1.0, max_count=4)


def parameters_of(kind: Kind) -> GenerationParameters | None:
    """Return the generator's parameters for a kind of stream; `None` for kinds in which nothing changes.

    The three modes of the paper have relative probabilities: one alone above 0 is always drawn.
    """
    if kind not in _MODES and kind not in _EXTENSIONS:
        return None
    salient, group, shuffle = _MODES.get(kind, (1.0, 0.0, 0.0))
    return GenerationParameters(
        num_stages=({"S5": NUM_DAY_VISITS, "S9": 2}.get(kind, NUM_VISITS),),
        evolve_probability=1.0 if kind in _MODES else 0.0,
        salient_object_probability=salient,
        retain_group_probability=group,
        full_shuffle_probability=shuffle,
        reference_image_px=64,
        reference_style="plain",
        reference_min_visible_px=1,
        extensions=_EXTENSIONS.get(kind, Extensions()),
    )


_MODES: dict[Kind, tuple[float, float, float]] = {
    "S1": (1.0, 0.0, 0.0),
    "S2": (0.0, 1.0, 0.0),
    "S3": (0.0, 0.0, 1.0),
    "S6": (1.0, 1.0, 0.0),
    "S8": (0.0, 1.0, 0.0),
    "S9": (1.0, 1.0, 0.0),
}
"""Relative probabilities of `SALIENT_OBJECT`, `RETAIN_GROUP` and `FULL_SHUFFLE`."""
_EXTENSIONS: dict[Kind, Extensions] = {
    "S4": Extensions(
        insertion=_COME_AND_GO,
        removal=_COME_AND_GO,
        doors=Occurrence(probability=1.0, max_count=2),
        openables=Occurrence(probability=1.0, max_count=3),
    ),
    "S5": Extensions(
        schedule=Schedule(num_persons=3, minutes_between_stages=round(60 * HOURS_BETWEEN_VISITS), tidiness=0.8)
    ),
    "S6": Extensions(insertion=_COME_AND_GO, removal=_COME_AND_GO),
    "S9": Extensions(insertion=_COME_AND_GO, removal=_COME_AND_GO),
}


@dataclass(frozen=True, slots=True)
class _Made:
    houses_json: tuple[str, ...]
    num_changed: int


def houses_of_visits(kind: Kind, house: House, seed: int, *, allow_unknown_assets: bool = False) -> tuple[str, ...]:
    """Return the house of every visit as JSON; of S9, the house before and after the change.

    Raises:
        HouseError: The generator refuses the house at every attempt; says why.
    """
    parameters = parameters_of(kind)
    if parameters is None:
        return (house.to_json(),)
    best, refused = None, ""
    for attempt in range(NUM_ATTEMPTS):
        try:
            task = generate_task(
                house, seed=seed, config=parameters, allow_unknown_assets=allow_unknown_assets, attempt=attempt
            )
        except TaskRejectedError as error:
            refused = str(error)
            continue
        evolutions = [stage.evolution for stage in task.oracle_stages[1:]]
        num_changed = sum(bool(one.relocated_ids or one.additions or one.removals) for one in evolutions)
        if best is None or num_changed > best.num_changed:
            best = _Made(task.houses_json, num_changed)
        # People are at home or not: days without changes belong to their schedule.
        if num_changed == len(evolutions) or (kind == "S5" and num_changed > 0):
            break
    if best is None:
        raise HouseError(f"house {house.name}: no stream of kind {kind}: {refused}")
    return best.houses_json
