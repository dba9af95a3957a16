"""The pictures in prompts are those that the words speak of: on rendered views of a real house, compared by pixels."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scripted_model import Scripted

from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.frontier_update.questions import ChooseQuestion, VerifyQuestion
from evonav.decision.pictures import Picture
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend
from evonav.tasks.listing import BUNDLED_TASKS, task_file

TASK = "bundled-0086-0279d6-s0"
MARGIN_PX = 20
SAME = 6.0
"""Mean difference of two pictures of the same pixels, of which one was JPEG."""


class Recorder:
    """An agent that keeps every view, and what was asked when."""

    def __init__(self, agent, model):
        self.agent, self.model = agent, model
        self.sensors = agent.sensors
        self.views, self.asked = [], []

    def begin_task(self, task):
        self.agent.begin_task(task)

    def begin_stage(self, goal):
        self.agent.begin_stage(goal)

    def act(self, observation):
        self.views += observation.views
        before = len(self.model.questions)
        action = self.agent.act(observation)
        entries = {entry.id: entry for entry in self.agent._navigator.objects.entries}
        for question in self.model.questions[before:]:
            self.asked.append((question, len(self.views), len(observation.views), entries))
        return action


@cache
def recorded(verify_views="facing"):
    backend = Backend()
    case = backend.tasks.create(task_file(BUNDLED_TASKS / TASK).path)

    def answer(question):
        if question.kind == "verify":
            return "no"
        return "Object 0" if question.objects and len(question.surroundings) > 8 else "Frontier 0"

    model = Scripted(answer, needs_images=True)
    recorder = Recorder(FailThenUpdate(FailThenUpdateConfig(verify_views=verify_views), model), model)
    protocol = ProtocolConfig(max_rounds=14)
    episode = Episode(case, "ftu", recorder, backend.simulator.create(), backend.perception.create(), protocol, 0)
    assert next(iter(episode.run())).record.is_scored
    return recorder


def difference(a, b):
    return np.inf if a.shape != b.shape else float(np.abs(a.astype(float) - b.astype(float)).mean())


def padded_boxes(view, label):
    """Where a view shows something of a label, with the margin of crops."""
    for index, name in enumerate(view.detections.labels):
        rows, cols = np.nonzero(view.detections.masks == index)
        if name == label:
            top, left = max(0, rows.min() - MARGIN_PX), max(0, cols.min() - MARGIN_PX)
            yield view.rgb[top : rows.max() + 1 + MARGIN_PX, left : cols.max() + 1 + MARGIN_PX]


def of(recorder, kind):
    found = [asked for asked in recorder.asked if isinstance(asked[0], kind)]
    assert found
    return found


def test_the_heading_view_is_the_last_one_seen():
    recorder = recorded()
    for question, num_views, _, _ in of(recorder, ChooseQuestion):
        shares = [difference(question.heading_view.pixels, view.rgb) for view in recorder.views[:num_views]]
        assert shares[-1] < SAME


@pytest.mark.slow
def test_a_crop_shows_the_object_and_a_view_is_where_it_was_last_seen():
    recorder = recorded()
    num = 0
    for question, num_views, _, entries in of(recorder, ChooseQuestion):
        for candidate in question.objects:
            crops = [crop for view in recorder.views[:num_views] for crop in padded_boxes(view, candidate.label)]
            assert min(difference(candidate.crop.pixels, crop) for crop in crops) < SAME, candidate.label
            # The object memory counts views by itself, from 1; a clean-up may have merged entries since.
            entry = entries.get(candidate.entry_id)
            if entry is not None and entry.label == candidate.label:
                last = recorder.views[entry.last_seen_view - 1]
                assert difference(candidate.view.pixels, last.rgb) < SAME, candidate.label
                num += 1
    assert num > 20


def test_a_frontier_is_shown_by_a_view_towards_it():
    recorder = recorded()
    for question, num_views, _, _ in of(recorder, ChooseQuestion):
        for frontier in question.frontiers:
            shown = [view for view in recorder.views[:num_views] if difference(frontier.image.pixels, view.rgb) < SAME]
            assert shown
            off_axis = []
            for view in shown:
                x_m, z_m = frontier.position_m[0] - view.pose.x_m, frontier.position_m[1] - view.pose.z_m
                turn_rad = np.arctan2(x_m, z_m) - view.pose.yaw_rad
                off_axis.append(abs(np.arctan2(np.sin(turn_rad), np.cos(turn_rad))))
            assert min(off_axis) < np.pi / 4 + 0.2  # within the view, or hardly outside


@pytest.mark.parametrize("views", ["facing", "all"])
def test_verification_shows_the_stored_crop_and_the_views_of_the_arrival(views):
    recorder = recorded(views)
    for question, num_views, num_now, _ in of(recorder, VerifyQuestion):
        now = recorder.views[num_views - num_now : num_views]
        expected = now if views == "all" else now[-1:]
        assert len(question.views) == len(expected)
        for shown, view in zip(question.views, expected, strict=True):
            assert difference(shown.pixels, view.rgb) < SAME
        seen = recorder.views[:num_views]
        crops = [crop for view in seen for crop in padded_boxes(view, question.entry.label)]
        assert min(difference(question.entry.crop.pixels, crop) for crop in crops) < SAME


def test_prompts_put_each_picture_under_its_title():
    recorder = recorded()
    question = of(recorder, ChooseQuestion)[-1][0]
    parts = question.prompt().turns[0].parts
    titled = {}
    for before, part in pairwise(parts):
        if isinstance(part, Picture):
            assert isinstance(before, str)
            titled[before.splitlines()[-1]] = part
    assert titled["What the robot sees ahead:"] is question.heading_view
    for index, candidate in enumerate(question.objects):
        assert titled[f"Object {index}: {candidate.label}"] is candidate.crop
        assert titled[f"The view in which object {index} was last seen:"] is candidate.view
    for index, frontier in enumerate(question.frontiers):
        assert titled[f"Frontier {index}: {frontier.travel_m:.1f} m away"] is frontier.image
