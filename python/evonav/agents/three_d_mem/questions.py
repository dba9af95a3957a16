"""Questions of 3D-Mem (paper, Sec. C.3): the classes that matter, then a snapshot's object or a frontier to go to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, goal_prompt
from evonav.decision.question import AnswerError, ClosedQuestion, Question, first_line, lines_of
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.ranking import best_frontier, choose_candidate, rank_entries
from evonav.points import Point2
from evonav.tasks.public import Goal

_NONE = "none"


@dataclass(frozen=True, slots=True)
class SnapshotCandidate:
    """A stored view, and those of its objects whose class passed the prefilter."""

    view_id: int
    objects: Sequence[ObjectCandidate]
    """The objects, at least one; their crops are from this view."""
    image: Picture | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SnapshotChoice:
    """An object of a snapshot, or, without a snapshot, a frontier, by the question's indices."""

    snapshot: int | None
    index: int


@dataclass(frozen=True, slots=True)
class PrefilterQuestion(Question[tuple[str, ...]]):
    """Ask which classes of remembered objects may lead to the goal, the most useful first."""

    kind: ClassVar[str] = "prefilter"
    goal: Goal
    class_names: Sequence[str]
    """Classes of the objects in snapshots; each once, sorted."""
    max_classes: int = 10

    def prompt(self) -> Prompt:
        """Show the names. As in the original, the number of names that will be used is not stated."""
        return goal_prompt(
            self.goal,
            "The robot remembers objects of these classes:\n"
            + "\n".join(self.class_names)
            + "\nRank those that help to reach the goal: the goal's own class, and what is mostly found by it. Answer "
            "with names from the list only, one a line, the most useful first; leave out what does not help. If "
            f'nothing does, answer "{_NONE}".',
        )

    def parse(self, text: str) -> tuple[str, ...]:
        """Read names of the list, in any case; others are dropped, and so are names after the first `max_classes`.

        Raises:
            AnswerError: There is no line with a name of the list, nor one that says `none`.
        """
        known = {name.lower(): name for name in self.class_names}
        lines = [line.lower() for line in lines_of(text)]
        names = tuple(dict.fromkeys(known[line] for line in lines if line in known))[: self.max_classes]
        if not names and _NONE not in lines:
            raise AnswerError("invalid", f"no name of the list: {first_line(text)[:80]!r}", text)
        return names

    def answer_text(self, answer: tuple[str, ...]) -> str:
        """Return one name a line."""
        return "\n".join(answer) or _NONE

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of lines that are names of the list."""
        return {"type": "array", "items": {"type": "string", "enum": [*self.class_names, _NONE]}}

    def alternatives(self, answer: tuple[str, ...]) -> Sequence[tuple[str, ...]]:
        """Return the answer without its best name, and the names that it leaves out."""
        others = tuple(name for name in self.class_names if name not in answer)[: self.max_classes]
        return [names for names in dict.fromkeys((answer[1:], others)) if names != answer]

    def by_rule(self, matcher: Matcher) -> tuple[tuple[str, ...], str]:
        """Name the goal's own class, then what it should be on or near, then what its type of room has.

        Where the list holds none of them, none is named, and no snapshot is left: only frontiers are.
        """
        goal = matcher.parsed(self.goal)
        scores = {name: matcher.label_score(goal, name) for name in self.class_names if matcher.may_help(goal, name)}
        ranked = sorted(scores, key=lambda name: (-scores[name], name))
        return tuple(ranked[: self.max_classes]), f"{len(ranked)} of {len(self.class_names)} classes may help"


@dataclass(frozen=True, slots=True)
class SnapshotQuestion(ClosedQuestion[SnapshotChoice]):
    """Ask where to go next: to an object in one of the snapshots, or to one of the frontiers."""

    kind: ClassVar[str] = "choose_snapshot"
    goal: Goal
    position_m: Point2
    """`(x, z)` of the agent."""
    snapshots: Sequence[SnapshotCandidate]
    frontiers: Sequence[FrontierCandidate]
    surroundings: Sequence[ObjectCandidate]
    """Everything remembered: what the snapshots' images would show around their objects. Not part of the prompt."""
    num_rounds_left: int
    """Number of rounds that are left. Not part of the prompt."""
    unseen_m2: float = 0.0
    """Area that the map does not know, for rules that look. Not part of the prompt."""
    heading_view: Picture | None = field(default=None, compare=False, repr=False)

    def prompt(self) -> Prompt:
        """Show the heading view, each snapshot with its image and crops, each frontier with its image."""
        snapshots: list[tuple[str, Picture | None]] = []
        for index, snapshot in enumerate(self.snapshots):
            snapshots.append((f"Snapshot {index}:", snapshot.image))
            for number, candidate in enumerate(snapshot.objects):
                snapshots.append((f"Snapshot {index}, Object {number}: {candidate.label}", candidate.crop))
        return goal_prompt(
            self.goal,
            "The robot explores a home. Snapshots are views that it remembers, each with objects in it; frontiers are "
            "places from which it can see what it has not explored. Choose where it goes next: to an object in a "
            "snapshot that is the goal, or to a frontier behind which the goal may be.",
            ("What the robot sees ahead:", self.heading_view),
            *snapshots,
            *((f"Frontier {index}:", frontier.image) for index, frontier in enumerate(self.frontiers)),
            f"Snapshots: {len(self.snapshots)}, frontiers: {len(self.frontiers)}. Answer on the first "
            'line with exactly "Snapshot i, Object j" or "Frontier i", and give your reason on the next.',
        )

    def answer_text(self, answer: SnapshotChoice) -> str:
        """Return `Snapshot i, Object j` or `Frontier i`."""
        if answer.snapshot is None:
            return f"Frontier {answer.index}"
        return f"Snapshot {answer.snapshot}, Object {answer.index}"

    def choices(self) -> Sequence[SnapshotChoice]:
        """Return objects in the order of their snapshots, then frontiers."""
        return [
            *(
                SnapshotChoice(index, number)
                for index, snapshot in enumerate(self.snapshots)
                for number in range(len(snapshot.objects))
            ),
            *(SnapshotChoice(None, index) for index in range(len(self.frontiers))),
        ]

    def namesakes(self, answer: SnapshotChoice, matcher: Matcher) -> Sequence[tuple[SnapshotChoice, float]]:
        """Return the other objects with the goal's name, each in the first snapshot that has it."""
        goal = matcher.parsed(self.goal)
        chosen = None if answer.snapshot is None else self.snapshots[answer.snapshot].objects[answer.index]
        found: dict[int, tuple[SnapshotChoice, ObjectCandidate]] = {}
        for number, snapshot in enumerate(self.snapshots):
            for index, one in enumerate(snapshot.objects):
                if matcher.names_goal(goal, one):
                    found.setdefault(one.entry_id, (SnapshotChoice(number, index), one))
        named = [one for _, one in found.values()]
        scores = matcher.scores(goal, named, self.surroundings, self.unseen_m2)
        rated = zip(found.items(), scores, strict=True)
        chosen_id = None if chosen is None else chosen.entry_id
        return [(choice, score) for (entry_id, (choice, _)), score in rated if entry_id != chosen_id]

    def exploring(self, answer: SnapshotChoice, matcher: Matcher) -> SnapshotChoice | None:
        """Return the frontier that the rule would choose."""
        index = best_frontier(matcher, self.goal, self.frontiers, self.surroundings)
        return None if index is None or answer.snapshot is None else SnapshotChoice(None, index)

    def by_rule(self, matcher: Matcher) -> tuple[SnapshotChoice, str]:
        """Choose the object of the goal's kind that fits best, whether or not all that is said of it holds.

        The original asks for the final answer, and a model commits to the first plausible one. Else a frontier is
        chosen as Frontier-Update would; without frontiers, the first object that may help.
        """
        places = [choice for choice in self.choices() if choice.snapshot is not None]
        objects = [candidate for snapshot in self.snapshots for candidate in snapshot.objects]
        ranked = rank_entries(matcher, self.goal, objects, self.position_m)
        choice, reason = choose_candidate(
            matcher,
            self.goal,
            [objects[index] for index in ranked],
            self.frontiers,
            self.surroundings,
            num_rounds_left=self.num_rounds_left,
            unseen_m2=self.unseen_m2,
            is_final=True,
        )
        if choice.kind == "object":
            return places[ranked[choice.index]], reason
        return SnapshotChoice(None, choice.index), reason
