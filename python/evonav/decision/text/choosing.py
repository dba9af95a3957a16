"""Choose by rule between remembered objects and frontiers."""

from collections.abc import Sequence

from evonav.decision.candidates import Choice, FrontierCandidate, ObjectCandidate
from evonav.decision.question import AnswerError
from evonav.decision.text.matcher import Matcher
from evonav.tasks.public import StageInput


def choose_candidate(
    matcher: Matcher,
    stage: StageInput,
    objects: Sequence[ObjectCandidate],
    frontiers: Sequence[FrontierCandidate],
    surroundings: Sequence[ObjectCandidate],
    *,
    num_rounds_left: int,
) -> tuple[Choice, str]:
    """Choose an object that the instruction fits; else a frontier; else what the goal should be on or near.

    Args:
        matcher: Reads the goal.
        stage: The stage whose goal is searched.
        objects: Remembered objects, the best first.
        frontiers: Frontiers that can be explored.
        surroundings: Everything remembered.
        num_rounds_left: Number of decision rounds that are left in the stage.

    Returns:
        The choice and the reason for it.

    Raises:
        AnswerError: No object has to do with the goal, and there is no frontier.
    """
    goal = matcher.parsed(stage)
    config = matcher.config
    named = [
        (matcher.relation_share(goal, candidate, surroundings), index)
        for index, candidate in enumerate(objects)
        if matcher.names_goal(goal, candidate)
    ]
    if named:
        share, index = max(named, key=lambda pair: (pair[0], -pair[1]))
        is_last_chance = not frontiers or num_rounds_left <= config.hurry_rounds
        if share >= config.min_relations or is_last_chance:
            return Choice("object", index), f"{objects[index].label}, {share:.0%} of what is said fits"
    if frontiers:
        index = min(range(len(frontiers)), key=lambda i: (matcher.frontier_cost_m(goal, frontiers[i], surroundings), i))
        return Choice("frontier", index), "relations do not hold" if named else "nothing remembered fits"
    for index, candidate in enumerate(objects):
        if matcher.label_score(goal, candidate.label) > 0.0:
            return Choice("object", index), f"{candidate.label} is where the {goal.noun} should be"
    raise AnswerError("invalid", "nothing to go to")
