"""Frontier-Update with Khronos' votes: rays before and after an object say when it came and when it went."""

import pytest
from cup_views import GONE, HIDDEN, UNDETECTED, a_cup
from hypothesis import given
from hypothesis import strategies as st
from toy_episode import rounds_of, run
from toy_house import CHAIR_AWAY, stage_case

from evonav.agents.rivals.khronos import KhronosConfig, KhronosFrontierUpdate, KhronosVotes, change_of, rays_of
from evonav.memory import ObjectMap

CONFIG = KhronosConfig()


class Watched:
    """A map with votes, a view a round."""

    def __init__(self, *views):
        self.map, self.votes = ObjectMap(), KhronosVotes(CONFIG)
        for view in views:
            self.see(view)

    def see(self, *views):
        for view in views:
            self.votes.see(self.map, view, self.map.update(view))
        self.votes.end_round(self.map)
        return self


def test_rays_that_pass_through_an_object_say_that_it_is_gone():
    watched = Watched(a_cup(), a_cup(), GONE)
    assert watched.votes.disappeared(1) == 2
    assert watched.map.entry(1) is not None  # it is dated, not deleted


@pytest.mark.parametrize("view", [HIDDEN, UNDETECTED])
def test_rays_that_end_before_an_object_or_on_it_do_not(view):
    assert not Watched(a_cup(), *[view] * 8).votes.is_absent(1)


def test_an_object_that_is_observed_again_is_there_whatever_was_said():
    watched = Watched(a_cup(), GONE, GONE)
    assert watched.votes.is_absent(1)
    assert not watched.see(a_cup()).votes.is_absent(1)
    assert watched.see(GONE).votes.disappeared(1) == 4


def test_rays_from_before_an_object_was_seen_say_when_it_came():
    assert Watched(GONE, GONE, a_cup()).votes.appeared(1) == 1
    assert Watched(HIDDEN, HIDDEN, a_cup()).votes.appeared(1) is None
    assert Watched(UNDETECTED, a_cup()).votes.appeared(1) is None  # it was there, undetected


def test_rays_of_the_rounds_in_which_it_is_detected_do_not_count():
    watched = Watched()
    watched.see(a_cup(), GONE)  # two views of one round
    assert not watched.votes.is_absent(1)


def test_the_first_window_with_most_votes_for_absence_is_the_change():
    bins = {3: (90, 10), 4: (80, 20), 9: (10, 90), 10: (0, 100)}
    assert change_of(bins, CONFIG, forward=True) == 9
    assert change_of(bins, CONFIG, forward=False) == 10
    one_bad_look = {3: (10, 40), 4: (90, 0), 5: (90, 0)}
    assert change_of(one_bad_look, CONFIG, forward=True) is None  # the window of five rounds outvotes it
    assert change_of({}, CONFIG, forward=True) is None


@given(
    bins=st.dictionaries(st.integers(0, 15), st.tuples(st.integers(0, 50), st.integers(0, 50)), max_size=10),
    window=st.integers(1, 6),
    forward=st.booleans(),
)
def test_a_change_is_that_of_the_definition(bins, window, forward):
    config = KhronosConfig(window=window)
    is_absent = {}
    for start in bins:
        present = sum(bins.get(start + step, (0, 0))[0] for step in range(window))
        absent = sum(bins.get(start + step, (0, 0))[1] for step in range(window))
        is_absent[start] = absent > 0.6 * (present + absent)
    order = sorted(bins, reverse=not forward)
    assert change_of(bins, config, forward=forward) == next((one for one in order if is_absent[one]), None)


def test_a_thinned_view_has_the_same_rays():
    view = a_cup()
    rays = rays_of(view, 4)
    assert rays.depth_m.shape == (15, 15)
    assert (rays.depth_m == view.depth_m[2::4, 2::4]).all()
    assert rays.intrinsics.focal_px * 4 == pytest.approx(view.intrinsics.focal_px)
    assert rays_of(view, 7).depth_m.shape == (60, 60)  # 7 does not divide 60
    memory = ObjectMap()
    memory.update(view)
    for look in (GONE, UNDETECTED):
        (all_rays,), (few,) = (memory.depth_evidence([1], one) for one in (look, rays_of(look, 4)))
        assert few.see_through_share == pytest.approx(all_rays.see_through_share, abs=0.1)


def test_the_agent_does_not_go_to_what_is_voted_absent_and_keeps_it_with_its_date():
    stages = stage_case(1, "Chair|1"), stage_case(2, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT")
    agent = KhronosFrontierUpdate()
    records, rounds = rounds_of(agent, *stages)
    details = [diagnostics.details for stage, _, diagnostics, _ in rounds if stage == 2]
    gone = set().union(*(one.get("disappeared", {}) for one in details))
    assert gone
    kept = {str(entry.id) for entry in agent._navigator.objects.entries}
    assert gone & kept
    told = {str(entry.entry_id) for entry in agent.explain().entries()}
    assert not told & set(details[-1]["disappeared"])
    assert records[-1].state == "success"


def test_the_agent_finds_what_stays():
    assert all(record.state == "success" for record in run(KhronosFrontierUpdate(), stage_case(1, "GarbageCan|1")))
