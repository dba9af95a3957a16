"""Rules for what MSGNav asks: the same knowledge of words, geometry and rooms as all other rules.

They look at no image. They know an image by the labels that were recorded with it, and the surroundings of an agent
that has arrived by the points of the last rounds' detections; size, shape and colour are never judged.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from evonav.agents.msgnav.candidates import GraphChoice
from evonav.decision.candidates import ObjectCandidate, Point2
from evonav.decision.question import AnswerError
from evonav.decision.text.language import Goal, canonical, similarity
from evonav.decision.text.matcher import Matcher, gap_m
from evonav.decision.text.ranking import rank_entries

if TYPE_CHECKING:
    from evonav.agents.msgnav.questions import (
        ArrivalQuestion,
        FrontierImagesQuestion,
        GraphQuestion,
        SubgraphQuestion,
    )


def select(matcher: Matcher, question: "SubgraphQuestion") -> tuple[tuple[int, ...], str]:
    """Select the entries that the instruction mentions; then others, one a label, none beside a selected one.

    Raises:
        AnswerError: The graph is empty.
    """
    if not question.objects:
        raise AnswerError("invalid", "there is no object")
    goal = matcher.parsed(question.goal)
    candidates = [node.candidate for node in question.objects]
    chosen: list[int] = []
    labels: set[str] = set()
    covered: set[int] = set()
    for index in rank_entries(matcher, question.goal, candidates, question.position_m):
        node = question.objects[index]
        label = canonical(node.candidate.label)
        is_mentioned = matcher.label_score(goal, node.candidate.label) > 0.0
        if is_mentioned or (label not in labels and node.entry_id not in covered):
            chosen.append(node.entry_id)
            labels.add(label)
            covered.update(node.neighbour_ids)
    chosen = chosen[: question.max_ids]
    return tuple(chosen), f"of {len(question.objects)} objects those that have most to do with a {goal.noun}"


def choose(matcher: Matcher, question: "GraphQuestion") -> tuple[GraphChoice, str]:
    """Choose a fitting object that was not rejected; else one that only an image shows; else explore.

    With no frontier or hardly a round left, any object of the right category is chosen, or else one that the goal
    should be on or near.
    """
    goal, config = matcher.parsed(question.goal), matcher.config
    around = [node.candidate for node in question.objects]
    rejected_ids = {past.id for past in question.history if past.kind == "object"}
    left = [candidate for candidate in around if candidate.entry_id not in rejected_ids]
    named = [
        (matcher.relation_share(goal, candidate, around), -index)
        for index, candidate in enumerate(left)
        if matcher.names_goal(goal, candidate)
    ]
    is_last_chance = question.num_frontiers == 0 or question.max_rounds - question.round <= config.hurry_rounds
    best = max(named, default=None)
    fits = best is not None and best[0] >= config.min_relations
    if best is None or not fits:
        image = _unmapped(matcher, goal, question, around)
        if image is not None:
            return image, f"{image.category} seen, but not in the graph"
    if best is not None and (fits or is_last_chance):
        candidate = left[-best[1]]
        return GraphChoice("object", candidate.entry_id), f"{candidate.label}, {best[0]:.0%} of what is said fits"
    if question.num_frontiers == 0:
        scored = [(matcher.label_score(goal, candidate.label), -i) for i, candidate in enumerate(left)]
        score, index = max(scored, default=(0.0, 0))
        if score > 0.0:
            return GraphChoice("object", left[-index].entry_id), f"where the {goal.noun} should be"
    return GraphChoice("explore"), "relations do not hold" if named else "nothing remembered fits"


def _unmapped(
    matcher: Matcher, goal: Goal, question: "GraphQuestion", around: Sequence[ObjectCandidate]
) -> GraphChoice | None:
    """Choose the largest detection of the goal's category that belongs to no entry and lies at no known place."""
    known_m = [candidate.ground_m for candidate in around if matcher.names_goal(goal, candidate)]
    known_m += [past.place_m for past in question.history if past.place_m is not None]

    def is_known(place_m: Point2) -> bool:
        return any(math.dist(place_m, other_m) <= matcher.config.near_m for other_m in known_m)

    found = [
        (seen.area_px, -number, seen.label)
        for number, image in enumerate(question.images)
        for seen in image.seen
        if seen.entry_id is None
        and seen.centre_m is not None
        and similarity(goal.noun, seen.label) >= matcher.config.min_similarity
        and not is_known(seen.centre_m)
    ]
    if not found:
        return None
    _, number, label = max(found)
    return GraphChoice("image", -number, canonical(label))


def explore(matcher: Matcher, question: "FrontierImagesQuestion") -> tuple[int, str]:
    """Choose the cheapest frontier."""
    goal = matcher.parsed(question.goal)
    costs_m = [matcher.frontier_cost_m(goal, frontier, question.surroundings) for frontier in question.frontiers]
    index = min(range(len(costs_m)), key=lambda i: (costs_m[i], i))
    return index, f"costs {costs_m[index]:.1f} m"


def arrive(matcher: Matcher, question: "ArrivalQuestion") -> tuple[bool, str]:
    """Answer yes if the goal's category was seen at the place, and its relations hold among the objects seen.

    With no frontier or hardly a round left the category is enough.
    """
    goal, config = matcher.parsed(question.goal), matcher.config
    here = [
        seen
        for seen in question.seen
        if matcher.names_goal(goal, seen) and gap_m(seen, question.target) <= config.near_m
    ]
    if not here:
        return False, f"no {goal.noun} seen here"
    share = max(matcher.relation_share(goal, seen, question.seen) for seen in here)
    is_last_chance = question.num_frontiers == 0 or question.num_rounds_left <= config.hurry_rounds
    return share >= config.min_relations or is_last_chance, f"{goal.noun} seen here, {share:.0%} of what is said fits"
