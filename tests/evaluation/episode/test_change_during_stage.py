"""The house changes while an agent is under way: the record says what changed, when, and what it cost."""

import math

import pytest
from toy_change import changing_stage
from toy_episode import run
from toy_house import OBJECTS, stage_case

from evonav.agents.agent import EntryBelief, Move, NavigateTo, SensorConfig, Stop
from evonav.agents.explanation import Explanation
from evonav.evaluation.metrics.stage_metrics import metrics_of
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import StageRecord
from evonav.world.simulator import Action

CHAIR, CHAIR_AWAY = OBJECTS["Chair|1"][1], (7.4, 0.45, 2.4)
BESIDE_CHAIR, BESIDE_CHAIR_AWAY, DOORWAY = (2.0, 3.0), (6.5, 2.4), (4.0, 2.5)


class Walker:
    """Walks to places, one after another, and stops; it remembers the chair where it stood at first."""

    sensors = SensorConfig()

    def __init__(self, *places_m):
        self.places_m = list(places_m)
        self.seen = []
        self.is_waiting = False

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        self.left_m = list(self.places_m)

    def act(self, observation):
        self.seen.append(observation)
        if observation.has_arrived and self.left_m:
            self.left_m.pop(0)
        return NavigateTo(self.left_m[0]) if self.left_m else Stop("there")

    def explain(self):
        return Explanation(choice="none", chosen_entry=self.entries()[0], num_entries=1, objects=self.entries)

    def entries(self):
        return (EntryBelief(entry_id=1, label="Chair", centre_m=CHAIR, size_m=(0.5, 0.9, 0.5), num_detections=3),)


def test_the_target_moves_away_while_the_agent_walks():
    stay, gone = (
        run(Walker(BESIDE_CHAIR), stage)[0]
        for stage in (stage_case(1, "Chair|1"), changing_stage(1, "Chair|1", 1, {"Chair|1": CHAIR_AWAY}))
    )
    assert (stay.state.value, gone.state.value) == ("success", "failure")
    during = gone.during
    assert (during.round, during.at_round, during.skipped_ids) == (1, 1, ())
    assert during.is_target_relocated
    assert during.target_position_m == gone.target_m_at_end == CHAIR_AWAY
    assert [one.object_id for one in during.done] == ["Chair|1"]
    # L* and the start distance are those of the house in which the stage began; the end is judged by the house now.
    assert gone.reference_length_m == stay.reference_length_m
    assert gone.start_distance_m == stay.start_distance_m
    end = gone.terminal
    assert gone.terminal_distance_m == pytest.approx(math.dist((end.x_m, end.z_m), CHAIR_AWAY[::2]))
    assert during.path_before_m == pytest.approx(sum(map(length_m, gone.trace[:1])))
    assert during.reference_after_m > 4.0
    assert stay.during is None
    assert stay.during is None
    assert StageRecord.model_validate_json(gone.model_dump_json()) == gone


def test_an_agent_that_follows_the_target_succeeds_where_it_is_now():
    (record,) = run(Walker(BESIDE_CHAIR, BESIDE_CHAIR_AWAY), changing_stage(1, "Chair|1", 1, {"Chair|1": CHAIR_AWAY}))
    assert record.state.value == "success"
    assert record.spl == pytest.approx(record.reference_length_m / record.path_length_m)
    metrics = metrics_of(record)
    walked_m = record.path_length_m - record.during.path_before_m
    assert metrics.spl_after_change == pytest.approx(min(1.0, record.during.reference_after_m / walked_m))


def length_m(taken):
    return sum(math.dist(a, b) for a, b in zip(taken.path_m, taken.path_m[1:], strict=False))


def test_entries_are_judged_by_the_house_of_their_round():
    (record,) = run(Walker(BESIDE_CHAIR), changing_stage(1, "Chair|1", 1, {"Chair|1": CHAIR_AWAY}))
    assert [taken.chosen_entry.is_stale for taken in record.trace] == [False] + [True] * (record.num_rounds - 1)
    assert record.entries[0].is_stale
    assert record.num_forgotten == 0
    assert [moved.object_id for moved in record.moved_objects] == ["Chair|1"]


def test_an_object_that_would_touch_the_agent_stays_until_the_stage_is_over():
    """The chair would come to stand where the agent is after its first round; the can is free to move."""
    can_away = (7.0, 0.3, 1.5)
    moves = {"Chair|1": (1.0, 0.45, 2.6), "GarbageCan|1": can_away}
    stage = changing_stage(1, "Chair|1", 1, moves)
    first, second = run(Walker((1.0, 2.6), (1.5, 3.2)), stage, stage_case(2, "Bed|1", moves=moves, before=moves))
    during = first.during
    assert (during.at_round, during.skipped_ids) == (1, ("Chair|1",))
    assert not during.is_target_relocated
    assert during.target_position_m == CHAIR
    assert [one.object_id for one in during.done] == ["GarbageCan|1"]
    assert [one.object_id for one in during.left] == ["Chair|1"]
    assert [moved.object_id for moved in first.moved_objects] == ["GarbageCan|1"]
    # It moves once the stage is over, so it counts among what moved before the next.
    assert "Chair|1" in [moved.object_id for moved in second.moved_objects]


def test_a_stage_that_ends_before_the_change_is_scored_as_without_it():
    stage = changing_stage(1, "Chair|1", 40, {"Chair|1": CHAIR_AWAY})
    moved = stage_case(2, "Bed|1", moves={"Chair|1": CHAIR_AWAY}, before={"Chair|1": CHAIR_AWAY})
    first, second = run(Walker(BESIDE_CHAIR), stage, moved)
    assert first.state.value == "success"
    assert first.during.at_round is first.during.target_position_m is first.during.path_before_m is None
    assert first.target_m_at_end == CHAIR
    assert metrics_of(first).during == "unchanged_during"
    assert "Chair|1" in [one.object_id for one in second.moved_objects]


def test_an_agent_that_would_be_shut_in_keeps_everything_where_it_is():
    """The bed would close the doorway behind the agent."""
    moves = {"Bed|1": (4.0, 0.35, 2.5)}
    (record,) = run(Walker((5.5, 2.5), (6.0, 2.2)), changing_stage(1, "GarbageCan|1", 5, moves))
    assert record.during.at_round == 5
    assert record.during.skipped_ids == ("Bed|1",)
    assert record.during.done == ()


class Turner(Walker):
    """Turns on the spot, by single actions."""

    sensors = SensorConfig(motion="actions")

    def act(self, observation):
        self.seen.append(observation)
        return Stop("enough") if len(self.seen) > 30 else Move(Action.TURN_LEFT)


def test_a_round_is_ten_actions_to_an_agent_of_single_actions():
    agent = Turner()
    (record,) = run(agent, changing_stage(1, "Chair|1", 2, {"Chair|1": CHAIR_AWAY}))
    assert ProtocolConfig().step_of_round(2, agent.sensors) == 20
    assert record.during.at_round == 20


def test_an_agent_is_told_nothing_of_a_change_to_come():
    """Until the change, every observation is, to the bit, that of the house without one."""

    def views(stage):
        agent = Walker(BESIDE_CHAIR, DOORWAY)
        run(agent, stage)
        return agent.seen

    kept, changed = views(stage_case(1, "Chair|1")), views(changing_stage(1, "Chair|1", 2, {"Chair|1": CHAIR_AWAY}))
    for before, after in zip(kept[:2], changed[:2], strict=True):
        assert before.pose == after.pose
        assert before.num_rounds_left == after.num_rounds_left
        for one, other in zip(before.views, after.views, strict=True):
            assert (one.depth_m == other.depth_m).all()
            assert one.detections.labels == other.detections.labels
            assert (one.detections.masks == other.detections.masks).all()
            assert (one.occupancy.free == other.occupancy.free).all()
            assert (one.occupancy.blocked == other.occupancy.blocked).all()
    assert any((one.depth_m != other.depth_m).any() for one, other in zip(kept[2].views, changed[2].views, strict=True))
