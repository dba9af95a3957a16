"""What each forgetting rule forgets, in the words of its source."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from cup_views import GONE, HIDDEN, UNDETECTED, a_cup, a_look, a_view
from walked_house import walked

import evonav
from evonav.errors import InvalidArgumentError
from evonav.memory import ObjectMap, forgetting
from evonav.memory.objects import ObjectUpdate, SeeThroughConfig
from evonav.sensors.observation import View

DAY_S = 86400.0
ALL_BUT_RESET = [name for name in forgetting.RULES if name != "reset"]


class Played:
    """A map with a rule, and what it has forgotten so far."""

    def __init__(self, name: str, *views: View, **options: object) -> None:
        self.rule = forgetting.make(name, **options)
        self.map = ObjectMap()
        self.removed: list[int] = []
        self.time_s = 0.0
        self.visit(0.0)
        self.see(*(views or (a_cup(), a_cup())))

    def visit(self, time_s: float) -> None:
        self.time_s = time_s
        self.removed += self.rule.begin_visit(self.map, time_s)

    def see(self, *views: View) -> "Played":
        for view in views:
            update = self.map.update(view)
            before = {entry.id for entry in self.map.entries}
            removed = self.rule.after_update(self.map, view, update, self.time_s)
            assert before - {entry.id for entry in self.map.entries} == set(removed)
            assert list(removed) == sorted(removed)
            self.removed += removed
            self.time_s += 0.5
        return self

    @property
    def has_cup(self) -> bool:
        return self.map.entry(1) is not None

    @property
    def p(self) -> float:
        p = self.rule.p_present(1)
        assert p is not None
        return p


def test_never_forgets_nothing() -> None:
    assert Played("never").see(*[GONE] * 30).removed == []


def test_reset_forgets_everything_at_each_visit_and_ids_go_on() -> None:
    played = Played("reset").see(GONE)
    assert played.removed == []
    played.visit(DAY_S)
    assert played.removed == [1]
    assert [entry.id for entry in played.see(a_cup()).map.entries] == [2]


def test_under_last_wins_one_look_counts_more_than_all_before() -> None:
    assert Played("last-wins", *[a_cup()] * 10).see(GONE).removed == [1]


@pytest.mark.parametrize(("num_empty", "has_cup"), [(8, True), (12, False)])
def test_under_last_wins_the_majority_of_what_is_shown_decides(num_empty: int, has_cup: bool) -> None:
    assert Played("last-wins").see(a_look(5.0, slice(20, 20 + num_empty))).has_cup is has_cup


def test_a_failed_look_deletes_the_entry() -> None:
    assert Played("failed-look", *[a_cup()] * 10).see(GONE).removed == [1]
    # A quarter of the surface is still there: this is no failed look, though the majority is empty.
    assert Played("failed-look").see(a_look(5.0, slice(20, 35))).has_cup


@pytest.mark.parametrize("name", ALL_BUT_RESET)
def test_an_occluded_place_is_not_forgotten(name: str) -> None:
    assert Played(name).see(*[HIDDEN] * 30).removed == []


@pytest.mark.parametrize("name", ALL_BUT_RESET)
def test_a_place_with_a_surface_is_not_forgotten_after_one_missing_detection(name: str) -> None:
    assert Played(name).see(UNDETECTED).removed == []


def test_under_see_through_the_old_points_are_gone_after_one_clear_look() -> None:
    played = Played("see-through")
    played.see(a_cup(col=0))  # the cup has moved to the left
    assert played.removed == [1]
    (entry,) = played.map.entries
    assert entry.label == "Cup"
    assert entry.centre_m[0] < -0.5


def test_under_see_through_only_the_points_that_are_seen_through_go() -> None:
    played = Played("see-through")
    before = played.map.points_m(1)
    played.see(a_look(5.0, slice(20, 26)))
    left = played.map.points_m(1)
    assert before is not None
    assert left is not None
    assert 0.7 * len(before) <= len(left) < len(before)
    assert left[:, 0].min() > before[:, 0].min()
    # The rest goes in another look: together they saw through enough.
    assert played.see(a_look(5.0, slice(26, 33))).removed == [1]


def test_a_new_detection_brings_the_points_back() -> None:
    played = Played("see-through").see(a_look(5.0, slice(20, 26)), a_cup())
    before = Played("never").map.points_m(1)
    after = played.map.points_m(1)
    assert before is not None
    assert after is not None
    assert len(after) == len(before)
    assert played.see(a_look(5.0, slice(20, 28))).has_cup


def test_under_ray_votes_one_look_does_not_delete_but_several_do() -> None:
    played = Played("ray-votes", *[a_cup()] * 4).see(GONE)
    assert played.has_cup
    assert played.see(GONE, GONE).removed == [1]


def test_under_ray_votes_rays_that_end_at_the_surface_vote_for_presence() -> None:
    present_first = Played("ray-votes", *[a_cup()] * 4)
    assert present_first.see(GONE, UNDETECTED, UNDETECTED, GONE).has_cup
    # Rays that end before the surface vote for nothing.
    assert present_first.see(*[HIDDEN] * 20).has_cup
    assert present_first.see(GONE).removed == [1]


def test_under_status_window_an_entry_is_updating_then_pending_then_dropped() -> None:
    played = Played("status-window", min_px=1.0).see(*[GONE] * 14)
    assert played.has_cup
    assert played.see(*[HIDDEN] * 20).has_cup  # no detection is expected
    assert played.see(GONE).removed == [1]


def test_under_status_window_a_detection_begins_a_new_window() -> None:
    assert Played("status-window", min_px=1.0).see(*[GONE] * 14, a_cup(), *[GONE] * 14).has_cup


def test_under_status_window_stable_anchors_stay() -> None:
    many = [a_cup()] * 8
    options = {"min_px": 1.0, "anchors": ("Cup",)}
    assert Played("status-window", *many, **options).see(*[GONE] * 40).has_cup
    assert Played("status-window", *many[1:], **options).see(*[GONE] * 40).removed == [1]


def test_under_status_window_an_object_of_few_pixels_is_not_expected() -> None:
    assert Played("status-window", min_px=5000.0).see(*[GONE] * 40).has_cup


@pytest.mark.parametrize(("num_gone", "has_cup"), [(8, True), (13, False)])
def test_under_share_deleted_an_entry_goes_with_most_of_its_points(num_gone: int, has_cup: bool) -> None:
    assert Played("share-deleted").see(a_look(5.0, slice(20, 20 + num_gone))).has_cup is has_cup


def test_share_deleted_notices_a_step_of_centimetres_and_see_through_does_not() -> None:
    view = a_view(a_cup().depth_m + np.float32(0.05))
    points = SeeThroughConfig(band_m=0.02, far_m=3.5, margin_px=0)
    assert Played("share-deleted", points=points).see(view).removed == [1]
    assert Played("see-through").see(view).has_cup


def test_under_bayes_p_falls_with_each_missing_detection_and_recovers_upon_detection() -> None:
    played = Played("bayes", a_cup())
    assert played.p == pytest.approx(0.9 / (0.9 + 0.05))
    certain = played.see(*[a_cup()] * 5).p
    assert certain == 0.99
    once = played.see(GONE).p
    assert once == pytest.approx(0.99 * 0.1 / (0.99 * 0.1 + 0.01 * 0.95))
    twice = played.see(GONE).p
    assert twice < once
    assert played.see(a_cup()).p > once
    assert played.see(HIDDEN).p == pytest.approx(played.p)
    assert played.see(GONE, GONE, GONE, GONE).removed == [1]
    assert played.rule.p_present(1) is None


def test_under_bayes_a_surface_at_the_place_makes_a_missing_detection_say_less() -> None:
    empty, full = Played("bayes", min_px=1.0).see(GONE), Played("bayes", min_px=1.0).see(UNDETECTED)
    assert empty.p < full.p < 0.99
    assert Played("bayes", min_px=5000.0).see(UNDETECTED).p == 0.99  # too small for a detection there


def test_under_bayes_p_decays_between_visits_and_time_alone_forgets_nothing() -> None:
    played = Played("bayes", a_cup(), a_cup())
    played.visit(30 * DAY_S)
    assert played.p == pytest.approx(0.99 / 2)
    played.visit(365 * DAY_S)
    assert played.has_cup
    assert played.p < 0.001
    assert played.see(a_cup()).p > 0.01
    steady = Played("bayes", half_life_s=None)
    steady.visit(365 * DAY_S)
    assert steady.p == 0.99


def test_states_follow_entries_that_are_merged_or_cleaned_up() -> None:
    played = Played("bayes", a_cup(), a_cup())
    rule, empty = played.rule, ObjectMap()
    rule.after_update(empty, HIDDEN, ObjectUpdate((), (), ((1, 7),)), 1.0)
    assert rule.p_present(1) is None
    assert rule.p_present(7) == 0.99
    rule.after_update(empty, HIDDEN, ObjectUpdate((), (7,), ()), 1.5)
    assert rule.p_present(7) is None


def test_a_typed_error_names_the_nearest_rule_and_option() -> None:
    with pytest.raises(InvalidArgumentError, match="no forgetting rule 'ray-vote': did you mean `ray-votes`"):
        forgetting.make("ray-vote")
    with pytest.raises(InvalidArgumentError, match="there are never, reset"):
        forgetting.make("x")
    with pytest.raises(InvalidArgumentError, match="`bayes` has no option 'min_px_': did you mean `min_px`"):
        forgetting.make("bayes", min_px_=3)
    with pytest.raises(InvalidArgumentError, match="it has none"):
        forgetting.make("never", window=3)
    assert all(rule.name == name for name, rule in forgetting.RULES.items())


@pytest.fixture(scope="module")
def static_tours() -> Sequence[Sequence[View]]:
    return [walked(evonav.Simulator(house), 4) for house in evonav.load_houses()[2:4]]


@pytest.mark.parametrize("name", ALL_BUT_RESET)
def test_no_rule_loses_an_object_of_a_static_house(name: str, static_tours: Sequence[Sequence[View]]) -> None:
    for views in static_tours:
        never, played = Played("never", *views), Played(name, *views)
        for visit in (1, 2):
            for one in (never, played):
                one.visit(visit * DAY_S)
                one.see(*views)
        held = {entry.id for entry in played.map.entries}
        lost = [entry for entry in never.map.entries if entry.id not in held]
        # An object may have two entries, of which one may go.
        twins = [(entry.label, other.label) for entry in lost for other in played.map.entries if _is_twin(entry, other)]
        assert len(twins) >= len(lost), lost


def _is_twin(entry: evonav._core.ObjectEntry, other: evonav._core.ObjectEntry) -> bool:
    return entry.label == other.label and math.dist(entry.centre_m, other.centre_m) < 0.3
