"""Agents that go by the sentence, the reference image, or both: what they are asked, and what the rules make of it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bundled_run import bundled_run

from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.agents.frontier_update.questions import ChooseQuestion
from evonav.agents.unigoal.agent import UniGoal
from evonav.component import Component
from evonav.decision.appearance import PICTURE_CONSTANT, PICTURE_RANGE, AppearanceMatcher, goal_layout, picture_ratio
from evonav.decision.backends import appearance_match, counting, custom, vlm
from evonav.decision.candidates import ObjectAppearance, ObjectCandidate
from evonav.decision.goal_input import GoalInput, PictureGoal, goal_as_given
from evonav.decision.prompts import Picture, goal_prompt
from evonav.decision.question import Metered, Question, Reply
from evonav.decision.rules import AppearanceMatch, TextMatch
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.run_settings import SettingError
from evonav.evaluation.run.settings import DecisionSettings
from evonav.memory.colours import Layout, layouts
from evonav.submission.file import Submission
from evonav.submission.packed_setup import packed_setup
from evonav.tasks.language import COLOURS
from evonav.tasks.public import Goal, TaskInfo

SENTENCE = "Please navigate to the red mug on the desk."
IMAGE = np.full((60, 60, 3), (150, 20, 20), np.uint8)
GOAL = Goal(1, "Mug", SENTENCE, SENTENCE, SENTENCE, IMAGE)
GREY = np.full((60, 60, 3), 120, np.uint8)


def test_the_image_leaves_no_more_of_the_sentence_than_the_category() -> None:
    assert goal_as_given(GOAL, "text") is GOAL
    image, both = goal_as_given(GOAL, "image"), goal_as_given(GOAL, "both")
    assert isinstance(image, PictureGoal)
    assert {image.basic_instruction, image.appearance_instruction, image.unified_instruction} == {
        "Please navigate to the mug."
    }
    assert isinstance(both, PictureGoal)
    assert both.unified_instruction == SENTENCE
    assert image.reference_image is both.reference_image is IMAGE
    assert (image.stage, image.category) == (1, "Mug")


@pytest.mark.parametrize(
    ("goal_input", "first"),
    [("image", "Goal of the robot: Please navigate to the mug."), ("both", f"Goal of the robot: {SENTENCE}")],
)
def test_prompts_show_the_picture_right_after_the_goal(goal_input: GoalInput, first: str) -> None:
    prompt = goal_prompt(goal_as_given(GOAL, goal_input), "Where?", ("Ahead:", Picture(GREY)))
    assert prompt.text == f"{first}\nThis picture shows it, in the middle:\n<image>\nWhere?\nAhead:\n<image>"
    assert [picture.pixels is pixels for picture, pixels in zip(prompt.pictures, (IMAGE, GREY), strict=True)] == [
        True
    ] * 2
    assert isinstance(prompt.parts[1], Picture)


def test_prompts_of_the_sentence_show_no_picture() -> None:
    assert goal_prompt(GOAL, "Where?").text == f"Goal of the robot: {SENTENCE}\nWhere?"


def mug(entry_id: int, layout: Layout | None) -> ObjectCandidate:
    seen = ObjectAppearance((1.0 / len(COLOURS),) * len(COLOURS), frozenset(), 1.0, layout)
    return ObjectCandidate(entry_id, "Mug", (float(entry_id), 0.8, 0.0), (0.1, 0.1, 0.1), 5, appearance=seen)


def around(image: np.ndarray) -> Layout:
    return layouts(image, [(30.0, 30.0)])[0]


def test_an_object_seen_amid_the_pictures_colours_is_likelier() -> None:
    mugs = [mug(1, around(GREY)), mug(2, around(IMAGE)), mug(3, None)]
    matcher = AppearanceMatcher()
    parsed = matcher.parsed(goal_as_given(GOAL, "image"))
    assert (parsed.noun, parsed.relations, parsed.adjectives) == ("mug", (), ())
    other, same, unseen = matcher.scores(parsed, mugs, mugs, 0.0)
    assert same / unseen == pytest.approx(min(np.exp(PICTURE_CONSTANT), PICTURE_RANGE[1]))
    assert other / unseen == pytest.approx(PICTURE_RANGE[0])
    # The sentence counts as before, and with both it counts beside the picture.
    assert matcher.scores(matcher.parsed(GOAL), mugs, mugs, 0.0) == pytest.approx([1 / 3] * 3)
    assert matcher.parsed(goal_as_given(GOAL, "both")).adjectives == ("red",)


def test_a_ratio_falls_with_each_distance_and_is_bounded() -> None:
    pictured = Layout((1.0, 0.0), (1.0, 0.0))
    mixed = (0.95, 0.05)
    near, whole = (picture_ratio(pictured, one) for one in (Layout(mixed, (1.0, 0.0)), Layout((1.0, 0.0), mixed)))
    same, apart = (picture_ratio(pictured, one) for one in (pictured, Layout((0.0, 1.0), (0.0, 1.0))))
    assert PICTURE_RANGE[0] == apart < whole < near < same <= PICTURE_RANGE[1]


def test_the_picture_of_a_new_stage_replaces_the_last() -> None:
    matcher = AppearanceMatcher()
    first, second = goal_as_given(GOAL, "image"), goal_as_given(replace(GOAL, reference_image=GREY), "image")
    for goal in (first, second, first):
        assert matcher.parsed(goal).picture == goal_layout(goal)


def test_rankings_use_no_feature_of_the_sentence_where_the_image_counts() -> None:
    mugs = [mug(0, None), replace(mug(1, None), label="Desk")]
    features = np.eye(2, dtype=np.float32)
    entries = [SimpleNamespace(id=n, label=one.label, feature=features[n]) for n, one in enumerate(mugs)]
    seen = SimpleNamespace(goal_feature=entries[1].feature, pose=SimpleNamespace(x_m=0.0, z_m=0.0))

    def first(goal_input: GoalInput) -> str:
        agent = FrontierUpdate(decision=AppearanceMatch(goal_input=goal_input))
        agent._goal = goal_as_given(GOAL, goal_input)
        return agent._ranked(entries, mugs, seen)[0].label  # type: ignore[arg-type]

    assert (first("text"), first("both"), first("image")) == ("Desk", "Desk", "Mug")


class Recorder(AppearanceMatch):
    """Looks, and keeps what it was asked."""

    asked: list[Question[Any]] = []  # noqa: RUF012 - read by the test

    def __init__(self) -> None:
        super().__init__(goal_input="image")

    def answer(self, question: Question[Any], attempt: int = 0) -> Reply[Any]:
        self.asked.append(question)
        return super().answer(question, attempt)


@pytest.mark.slow
def test_whole_stages_go_by_the_picture_alone(tmp_path: Path) -> None:
    Recorder.asked.clear()
    recorder = Component("evonav.decision.backends:custom", {"path": f"{__name__}:Recorder"})
    bundled_run(tmp_path, ["fu", "3d-mem"], Backend(decision=recorder))
    assert Recorder.asked
    assert all(isinstance(question.goal, PictureGoal) for question in Recorder.asked)
    assert not any(" on " in question.goal.unified_instruction for question in Recorder.asked)
    choices = [question for question in Recorder.asked if isinstance(question, ChooseQuestion)]
    seen = [one.appearance for question in choices for one in question.objects if one.appearance is not None]
    assert seen
    assert all(one.layout is not None for one in seen)


def test_memory_keeps_no_layouts_where_the_sentence_counts() -> None:
    info = TaskInfo("t", 1, 5, SimpleNamespace(rows=20, cols=20, cell_m=0.1, corner_m=(0.0, 0.0)), 0)  # type: ignore[arg-type]
    for goal_input, keeps in (("text", False), ("image", True), ("both", True)):
        agent = FrontierUpdate(decision=Metered(appearance_match(0, goal_input=goal_input, noise={"wrong": 0.1})))
        agent.begin_task(info)
        assert agent._navigator.views._keeps_layouts is keeps, goal_input


@pytest.mark.parametrize(("goal_input", "source"), [("text", "text"), ("image", "image"), ("both", "text")])
def test_unigoal_makes_its_graph_of_the_image_or_of_the_sentence(goal_input: GoalInput, source: str) -> None:
    agent = UniGoal(decision=AppearanceMatch(goal_input=goal_input))
    agent.begin_task(TaskInfo("t", 1, 5, None, 0))  # type: ignore[arg-type]
    assert agent._graphs.config.goal_input == source


def test_runs_are_identified_by_it_and_older_ones_mean_the_sentence() -> None:
    assert "goal_input" not in DecisionSettings(kind="looks").identity(0)
    assert "goal_input" not in DecisionSettings(kind="vlm", model="any").identity(0)
    assert DecisionSettings(kind="looks", goal_input="image").identity(0)["goal_input"] == "image"
    assert DecisionSettings(kind="vlm", model="any", goal_input="both").identity(0)["goal_input"] == "both"
    assert DecisionSettings(kind="my:Model", goal_input="both").identity(0)["goal_input"] == "both"
    parts = {"decision": "evonav.decision.backends:appearance_match", "decision_options": {"goal_input": "image"}}
    assert packed_setup(Submission.model_construct(config={"backend": parts})).decision == "looks,goal_input=image"


def test_models_that_see_nothing_refuse_pictures(tmp_path: Path) -> None:
    for settings in (
        DecisionSettings(goal_input="image"),
        DecisionSettings(kind="vlm", model="any", images=False, goal_input="both"),
    ):
        with pytest.raises(SettingError, match="needs looks, or vlm with images"):
            settings.check()
    DecisionSettings(kind="vlm", model="any", goal_input="image").check()
    with pytest.raises(InvalidArgumentError, match="goal_input = 'image': needs a model that sees images"):
        vlm(0, model="any", images=False, goal_input="image")
    with pytest.raises(InvalidArgumentError, match="expected one of text, image, both"):
        appearance_match(0, goal_input="picture")  # type: ignore[arg-type]
    with pytest.raises(InvalidArgumentError, match="says itself what it goes by"):
        custom(0, path=f"{__name__}:Recorder", goal_input="image")
    assert vlm(0, model="any", goal_input="image").goal_input == "image"
    ledger = str(tmp_path / "spending.sqlite")
    assert counting(0, model="any", ledger=ledger, goal_input="both").goal_input == "both"
    assert TextMatch().goal_input == "text"
