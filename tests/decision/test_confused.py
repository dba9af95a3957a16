"""Objects taken for the goal: others of its class, as often as the rules score them, and counted in the records."""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from bundled_run import bundled_run
from test_noisy import Letter

from evonav.agents.frontier_update.questions import ChooseQuestion
from evonav.agents.msgnav.memory import GraphChoice, GraphObject, PastChoice
from evonav.agents.msgnav.questions import GraphQuestion
from evonav.agents.three_d_mem.questions import SnapshotCandidate, SnapshotChoice, SnapshotQuestion
from evonav.component import Component
from evonav.decision.backends import appearance_match, text_match
from evonav.decision.candidates import Choice, FrontierCandidate, ObjectAppearance, ObjectCandidate
from evonav.decision.noisy import NoiseRates, Noisy
from evonav.decision.query import QuerySession
from evonav.decision.rules import AppearanceMatch, TextMatch
from evonav.decision.text.matcher import Matcher
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.run_settings import SettingError
from evonav.evaluation.run.settings import DecisionSettings
from evonav.submission.file import Submission
from evonav.submission.packed_setup import packed_setup
from evonav.tasks.language import COLOURS
from evonav.tasks.public import Goal

TEXT = "Find the mug on the desk next to the laptop."
GOAL = Goal(1, "Mug", TEXT, TEXT, TEXT, np.zeros((1, 1, 3), np.uint8))
SURE = NoiseRates(confused=1.0)


def thing(entry_id: int, label: str, x_m: float, y_m: float = 0.8) -> ObjectCandidate:
    return ObjectCandidate(entry_id, label, (x_m, y_m, 0.0), (0.2, 0.2, 0.2), 5)


def desk(entry_id: int, x_m: float) -> ObjectCandidate:
    return ObjectCandidate(entry_id, "Desk", (x_m, 0.35, 0.0), (1.0, 0.7, 1.0), 5)


AROUND = [desk(10, 0.0), thing(11, "Laptop", 0.3), desk(12, 20.0), thing(13, "Laptop", 30.0), desk(14, 40.0)]
RIGHT, ON_DESK, BY_LAPTOP = thing(1, "Mug", 0.0), thing(2, "Mug", 20.0), thing(3, "Mug", 30.0)
NOWHERE, SECOND = thing(4, "Mug", 60.0), thing(5, "Mug", 40.0)
FRONTIERS = [FrontierCandidate(1, (0.0, 5.0), 5.0), FrontierCandidate(2, (0.0, 2.0), 2.0)]


def choose(objects: list[ObjectCandidate], frontiers: list[FrontierCandidate] = FRONTIERS) -> ChooseQuestion:
    return ChooseQuestion(GOAL, (0.0, 0.0), objects, frontiers, [*AROUND, *objects], num_rounds_left=40)


def test_others_of_the_class_are_drawn_in_proportion_to_their_scores() -> None:
    # Half of what is said fits object 1, all of it object 4, nothing object 2; object 3 is no mug.
    question = choose([RIGHT, ON_DESK, NOWHERE, AROUND[1], thing(6, "Mug", 0.3)])
    model = Noisy(TextMatch(), SURE, 0)
    num = 6000
    counts = Counter(model.answer(question).answer for _ in range(num))
    assert set(counts) == {Choice("object", 1), Choice("object", 4)}
    assert abs(counts[Choice("object", 4)] / num - 2 / 3) < 4.5 * (2 / 9 / num) ** 0.5
    assert model.answer(question).text.splitlines()[1] == "A confusion on purpose (noise)."


def test_where_no_other_fits_at_all_each_is_as_likely() -> None:
    question = choose([RIGHT, NOWHERE, thing(7, "Mug", 70.0)])
    model = Noisy(TextMatch(), SURE, 0)
    counts = Counter(model.answer(question).answer.index for _ in range(2000))
    assert set(counts) == {1, 2}
    assert abs(counts[1] - 1000) < 4.5 * 500**0.5


def test_rules_that_look_draw_by_their_posterior() -> None:
    def mug(entry_id: int, shown_ids: set[int]) -> ObjectCandidate:
        seen = ObjectAppearance((1.0 / len(COLOURS),) * len(COLOURS), frozenset(shown_ids), 1.0)
        return replace(RIGHT, entry_id=entry_id, appearance=seen)

    question = choose([mug(1, {10, 11}), mug(2, {10}), mug(3, set())])
    model = AppearanceMatch()
    goal = model.matcher.parsed(GOAL)
    scores = model.matcher.scores(goal, question.objects, question.surroundings, 0.0)
    assert scores == sorted(scores, reverse=True)
    assert question.namesakes(Choice("object", 0), model.matcher) == [
        (Choice("object", 1), scores[1]),
        (Choice("object", 2), scores[2]),
    ]
    confused = Noisy(model, SURE, 0)
    counts = Counter(confused.answer(question).answer.index for _ in range(2000))
    share = scores[1] / (scores[1] + scores[2])
    assert 0.5 < share < 0.99
    assert abs(counts[1] / 2000 - share) < 4.5 * (share * (1 - share) / 2000) ** 0.5
    assert counts[1] + counts[2] == 2000


def test_the_only_one_of_its_class_is_not_seen_yet_and_exploring_stays() -> None:
    session = QuerySession(Noisy(TextMatch(), SURE, 0))
    # 1: the nearer frontier in place of the mug. 2: it was not going to an object.
    assert session.ask(choose([RIGHT, AROUND[1]])) == Choice("frontier", 1)
    assert session.counters == {"decisions": 1, "confused_unseen": 1}
    assert session.ask(choose([AROUND[1]])) == Choice("frontier", 1)
    assert session.ask(choose([RIGHT], [])) == Choice("object", 0)
    assert session.counters == {"decisions": 3, "confused_unseen": 1, "confused_kept": 2}
    assert session.ask(choose([NOWHERE])) == Choice("object", 0)  # the rule explores, the confused one does not
    assert session.counters["confused_objects"] == 1


def test_questions_without_objects_keep_their_answers() -> None:
    model = Noisy(_Rules(), SURE, 0)
    reply = model.answer(Letter())
    assert (reply.answer, reply.counter) == ("a", "confused_kept")
    assert model.counts == {"confused": 1}


class _Rules(TextMatch):
    """Answers letters too."""

    def answer(self, question, attempt=0):  # type: ignore[no-untyped-def]
        return TextMatch.answer(self, _Ruled(), attempt)


@dataclass(frozen=True)
class _Ruled(Letter):
    """A letter that a rule knows."""

    kind: ClassVar[str] = "ruled"

    def by_rule(self, matcher: Matcher) -> tuple[str, str]:
        return "a", "the first"


def test_an_object_of_several_snapshots_counts_once_and_is_never_its_own_look_alike() -> None:
    snapshots = [SnapshotCandidate(7, [RIGHT]), SnapshotCandidate(8, [RIGHT, ON_DESK]), SnapshotCandidate(9, [ON_DESK])]
    question = SnapshotQuestion(GOAL, (0.0, 0.0), snapshots, FRONTIERS, [*AROUND, RIGHT, ON_DESK], num_rounds_left=40)
    for place in (SnapshotChoice(0, 0), SnapshotChoice(1, 0)):
        assert question.namesakes(place, Matcher()) == [(SnapshotChoice(1, 1), 0.5)]
    assert [choice for choice, _ in question.namesakes(SnapshotChoice(2, 0), Matcher())] == [SnapshotChoice(0, 0)]
    assert question.exploring(SnapshotChoice(0, 0), Matcher()) == SnapshotChoice(None, 1)
    assert question.exploring(SnapshotChoice(None, 0), Matcher()) is None


def test_msgnav_does_not_confuse_the_goal_with_what_it_rejected() -> None:
    nodes = [GraphObject(one, "bedroom") for one in (RIGHT, ON_DESK, BY_LAPTOP, *AROUND)]
    past = [PastChoice(0, "object", 3)]
    question = GraphQuestion(GOAL, nodes, [], [], past, round=1, max_rounds=50, num_frontiers=1)
    assert question.namesakes(GraphChoice("object", 1), Matcher()) == [(GraphChoice("object", 2), 0.5)]
    assert question.exploring(GraphChoice("object", 1), Matcher()) == GraphChoice("explore")
    assert question.exploring(GraphChoice("explore"), Matcher()) is None


def test_only_models_with_rules_can_be_confused() -> None:
    assert isinstance(text_match(0, noise={"confused": 0.2}), Noisy)
    assert isinstance(appearance_match(0, noise={"confused": 0.2, "wrong": 0.2}), Noisy)
    DecisionSettings(kind="looks", noise={"confused": 0.2, "wrong": 0.2}).check()
    with pytest.raises(SettingError, match="confused needs the scores of rules"):
        DecisionSettings(kind="vlm", model="any", noise={"confused": 0.2}).check()
    with pytest.raises(InvalidArgumentError, match=r"noise confused = 0\.2: needs a model that scores"):
        Noisy(Silent(), NoiseRates(confused=0.2), 0)


def test_a_pack_says_how_often_its_model_was_confused() -> None:
    parts = {"decision": "evonav.decision.backends:text_match", "decision_options": {"noise": {"confused": 0.2}}}
    assert packed_setup(Submission.model_construct(config={"backend": parts})).decision == "text,confused=0.2"


class Silent(TextMatch):
    """Has no rules."""

    def __init__(self) -> None:
        super().__init__()
        self.matcher = None  # type: ignore[assignment]


@pytest.mark.slow
def test_a_run_counts_confusions(tmp_path: Path) -> None:
    noise = {"noise": {"confused": 0.5, "wrong": 0.1}}
    backend = Backend(decision=Component("evonav.decision.backends:text_match", noise))
    here = bundled_run(tmp_path, ["fu", "3d-mem", "unigoal"], backend)
    names = {name for record in here for name in record.trace[-1].counters if name.startswith("confused")}
    assert {"confused_objects", "confused_kept"} <= names <= {"confused_objects", "confused_unseen", "confused_kept"}
    unigoal = [record for record in here if record.agent == "unigoal"][-1].trace[-1].counters
    assert unigoal["confused_kept"] > 0
    assert "confused_objects" not in unigoal
