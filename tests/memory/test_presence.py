"""Whether a remembered object is still at its place, from what the present depth image shows there."""

from dataclasses import replace

import numpy as np
import pytest
from cup_views import UNDETECTED, a_cup, a_look

from evonav.errors import InvalidArgumentError
from evonav.memory import ObjectMap
from evonav.memory.presence import DepthEvidence, EvidenceConfig, Presence, judge_presence
from evonav.sensors.observation import View


def remembered() -> ObjectMap:
    """A map with one entry, a mug 2.0 to 2.3 m ahead."""
    entries = ObjectMap()
    entries.update(a_cup("Mug"))
    return entries


def verdict(view: View, *, is_detected: bool = False) -> Presence:
    (evidence,) = remembered().depth_evidence([1], view)
    return judge_presence(evidence, is_detected=is_detected)


def test_an_entry_whose_place_is_seen_through_is_gone() -> None:
    assert verdict(a_look(5.0)) is Presence.NO


def test_an_entry_behind_an_open_door_is_hidden_and_not_gone() -> None:
    assert verdict(a_look(0.8)) is Presence.UNKNOWN
    (evidence,) = remembered().depth_evidence([1], a_look(0.8))
    assert evidence == DepthEvidence(num_occluded=256)


def test_an_entry_that_is_half_hidden_and_half_seen_through_is_not_judged() -> None:
    half_hidden = a_look(5.0)
    half_hidden.depth_m[:, :30] = 0.8
    assert verdict(half_hidden) is Presence.UNKNOWN


def test_a_surface_at_the_place_is_the_entry_though_nothing_is_detected() -> None:
    assert verdict(UNDETECTED) is Presence.YES
    assert verdict(a_look(0.8, slice(20, 33))) is Presence.YES  # two thirds of it are hidden


def test_a_detection_of_the_label_counts_more_than_depth() -> None:
    assert verdict(a_look(5.0), is_detected=True) is Presence.YES


@pytest.mark.parametrize("depth_m", [0.0, np.inf])
def test_pixels_without_a_depth_say_nothing(depth_m: float) -> None:
    assert verdict(a_look(depth_m)) is Presence.UNKNOWN


@pytest.mark.parametrize(("num_seen_through", "presence"), [(15, Presence.UNKNOWN), (16, Presence.NO)])
def test_fewer_than_16_points_in_view_do_not_tell_that_an_entry_is_gone(
    num_seen_through: int, presence: Presence
) -> None:
    evidence = DepthEvidence(num_see_through=num_seen_through, num_out_of_view=200)
    assert judge_presence(evidence, is_detected=False) is presence


def test_the_shares_must_exceed_their_thresholds() -> None:
    assert judge_presence(DepthEvidence(60, 0, 40, 0), is_detected=False) is Presence.UNKNOWN
    assert judge_presence(DepthEvidence(61, 0, 39, 0), is_detected=False) is Presence.NO
    assert judge_presence(DepthEvidence(80, 20, 0, 0), is_detected=False) is Presence.NO
    assert judge_presence(DepthEvidence(79, 21, 0, 0), is_detected=False) is Presence.YES
    assert judge_presence(DepthEvidence(), is_detected=False) is Presence.UNKNOWN


def test_many_entries_are_compared_in_one_call_and_the_map_stays_as_it_is() -> None:
    entries = remembered()
    entries.update(a_cup("Bowl", col=35))
    before = [entry.num_detections for entry in entries.entries]
    both = entries.depth_evidence([2, 1], UNDETECTED)
    assert [found.supported_share for found in both] == [0.0, 1.0]
    assert entries.depth_evidence([], a_look(1.0)) == []
    assert [entry.num_detections for entry in entries.entries] == before
    few = entries.depth_evidence([1], a_look(5.0), EvidenceConfig(max_points=20))
    assert few == [DepthEvidence(num_see_through=20)]


def test_what_does_not_fit_is_named() -> None:
    entries, view = remembered(), a_look(2.0)
    with pytest.raises(InvalidArgumentError, match="entry_id"):
        entries.depth_evidence([1, 7], view)
    with pytest.raises(InvalidArgumentError, match="depth_m"):
        entries.depth_evidence([1], replace(view, depth_m=np.full((60, 60), np.nan, np.float32)))
    with pytest.raises(TypeError, match="depth_m"):
        entries.depth_evidence([1], replace(view, depth_m=np.ones((60, 60))))
    with pytest.raises(InvalidArgumentError, match="max_points"):
        entries.depth_evidence([1], view, EvidenceConfig(max_points=0))
