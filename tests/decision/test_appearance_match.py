"""The decision model that looks: what it weighs, when it believes an object, and what it ignores."""

from dataclasses import replace

import numpy as np
import pytest

from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.agents.frontier_update.questions import ChooseQuestion
from evonav.decision.appearance import AppearanceMatcher
from evonav.decision.backends import appearance_match
from evonav.decision.candidates import FrontierCandidate, ObjectAppearance, ObjectCandidate
from evonav.decision.question import Metered
from evonav.decision.rules import AppearanceMatch
from evonav.decision.text.language import parse_goal
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.settings import DecisionSettings
from evonav.tasks.language import COLOURS
from evonav.tasks.public import Goal


def appearance_of(colour: str = "grey", shown: tuple[int, ...] = (), known_share: float = 1.0) -> ObjectAppearance:
    return ObjectAppearance(tuple(float(word == colour) for word in COLOURS), frozenset(shown), known_share)


def mug(
    entry_id: int, x_m: float, seen: ObjectAppearance | None, size_m: float = 0.1, num_detections: int = 5
) -> ObjectCandidate:
    return ObjectCandidate(entry_id, "Mug", (x_m, 0.85, 0.0), (size_m,) * 3, num_detections, appearance=seen)


TABLE = ObjectCandidate(10, "DiningTable", (0.0, 0.4, 0.0), (1.5, 0.8, 1.0), 9, appearance=appearance_of("brown"))
TWO_MUGS = [mug(1, 0.0, appearance_of("red", (10,))), mug(2, 5.0, appearance_of("blue"))]


def odds(text: str, mugs: list[ObjectCandidate] | None = None, unseen_m2: float = 0.0) -> list[float]:
    """Return the probability of each mug."""
    mugs = mugs or TWO_MUGS
    return AppearanceMatcher().scores(parse_goal(f"Find the {text}."), mugs, [*mugs, TABLE], unseen_m2)


def test_a_colour_that_is_seen_tells_namesakes_apart() -> None:
    red, blue = odds("red mug")
    assert red > 0.9 > 0.1 > blue
    assert odds("blue mug") == pytest.approx([blue, red], abs=0.05)


def test_without_a_word_for_colour_or_form_all_namesakes_are_alike() -> None:
    assert odds("mug") == [0.5, 0.5]


def test_what_was_never_seen_in_colour_counts_as_any_other() -> None:
    assert odds("red mug", [mug(1, 0.0, None), mug(2, 5.0, None)]) == [0.5, 0.5]


def test_size_counts_three_to_one_at_most_and_only_after_three_sightings() -> None:
    small, large = odds("large mug", [mug(1, 0.0, appearance_of(), 0.03), mug(2, 5.0, appearance_of(), 0.5)])
    assert large / small == pytest.approx(9.0, rel=0.01)
    once = [mug(1, 0.0, appearance_of(), 0.03, num_detections=2), mug(2, 5.0, appearance_of(), 0.5, num_detections=2)]
    assert odds("large mug", once) == [0.5, 0.5]


def test_a_relation_counts_by_how_rare_it_is_among_namesakes() -> None:
    (on, off), (also_on, _, _) = (
        odds("mug on the dining table"),
        odds("mug on the dining table", [*TWO_MUGS, mug(3, 0.1, appearance_of("red", (10,)))]),
    )
    assert on == pytest.approx((0.95 / (1 / 3)) / (0.95 / (1 / 3) + 0.05 / (1 / 3)), abs=1e-6)
    assert on > 0.9 > off
    assert also_on < on


def second(text: str, known_share: float) -> float:
    """Return the probability of a mug that is far from the table, while another is on it."""
    return odds(text, [TWO_MUGS[0], mug(2, 5.0, appearance_of("red", (), known_share))])[1]


def test_surroundings_that_the_map_does_not_know_violate_no_relation() -> None:
    assert second("mug near the dining table", 0.6) > 2.0 * second("mug near the dining table", 0.8)


def test_what_an_object_stands_on_is_seen_with_it_whatever_the_map_knows() -> None:
    assert second("mug on the dining table", 0.0) == second("mug on the dining table", 1.0) < 0.1


def test_only_what_the_views_of_an_object_show_counts() -> None:
    hidden = replace(TWO_MUGS[0], appearance=appearance_of("red", shown=()))
    assert odds("mug on the dining table", [hidden, TWO_MUGS[1]]) == [0.5, 0.5]


def test_the_more_is_unseen_the_less_likely_is_an_object() -> None:
    shares = [odds("mug", unseen_m2=area)[0] for area in (0.0, 100.0, 1000.0)]
    assert shares == sorted(shares, reverse=True)
    assert sum(odds("mug", unseen_m2=100.0)) < 1.0


GOAL = Goal(1, "Mug", *("Find the red mug.",) * 3, np.zeros((1, 1, 3), np.uint8))


def ask(model: AppearanceMatch, unseen_m2: float, mugs: list[ObjectCandidate] | None = None) -> str:
    frontier = FrontierCandidate(1, (0.0, 1.0), 1.0)
    mugs = mugs or [mug(1, 0.0, appearance_of("grey"))]
    return model.answer(ChooseQuestion(GOAL, (0.0, 0.0), mugs, [frontier], mugs, 40, unseen_m2)).text


def test_it_explores_until_an_object_is_likely_enough() -> None:
    assert ask(AppearanceMatch(), 100.0).startswith("Frontier 0")
    assert ask(AppearanceMatch(), 1.0).startswith("Object 0\nMug, ")
    assert ask(AppearanceMatch(), 100.0, [mug(1, 0.0, appearance_of("red"))]).startswith("Object 0\nMug, 88% likely")


def test_it_does_not_explore_to_tell_apart_what_it_has_seen() -> None:
    alike = [mug(number, float(number), appearance_of("red")) for number in range(5)]
    assert max(odds("red mug", alike, unseen_m2=10.0)) < 0.25
    assert ask(AppearanceMatch(), 10.0, alike).startswith("Object 0")


@pytest.mark.parametrize(("second_m", "chosen"), [(5.0, "Frontier 0"), (3.0, "Frontier 1")])
def test_it_goes_on_to_a_frontier_unless_another_is_a_fifth_nearer(second_m: float, chosen: str) -> None:
    frontiers = [
        FrontierCandidate(1, (0.0, 6.0), 6.0, is_current=True),
        FrontierCandidate(2, (0.0, second_m), second_m),
    ]
    question = ChooseQuestion(GOAL, (0.0, 0.0), [], frontiers, [], 40, 0.0)
    assert AppearanceMatch().answer(question).text.startswith(chosen)


def test_eagerness_believes_earlier() -> None:
    area_m2 = 160.0
    assert ask(AppearanceMatch(eagerness=0.0), area_m2, [mug(1, 0.0, None)]).startswith("Frontier")
    assert ask(AppearanceMatch(eagerness=1.0), area_m2, [mug(1, 0.0, None)]).startswith("Object")


def test_mistakes_are_drawn_from_the_posterior_and_are_the_same_for_a_seed() -> None:
    def answers(mistakes: float, seed: int) -> list[str]:
        model = AppearanceMatch(mistakes=mistakes, seed=seed)
        return [ask(model, 0.0, TWO_MUGS).splitlines()[0] for _ in range(200)]

    first = answers(1.0, 0)
    assert first == answers(1.0, 0) != answers(1.0, 1)
    wrong = first.count("Object 1") / 200
    assert wrong == pytest.approx(
        AppearanceMatcher().scores(parse_goal("Find the red mug."), TWO_MUGS, [], 0.0)[1], abs=0.05
    )
    assert answers(3.0, 0).count("Object 1") > first.count("Object 1")
    assert set(answers(0.01, 0)) == {"Object 0"}


@pytest.mark.parametrize("options", [{"eagerness": -0.1}, {"eagerness": 2.0}, {"mistakes": -1.0}])
def test_numbers_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(InvalidArgumentError):
        appearance_match(0, **options)  # type: ignore[arg-type]


def test_agents_of_a_model_that_looks_see_colours_also_behind_wrappers() -> None:
    model = Metered(appearance_match(0, noise={"wrong": 0.1}))
    assert model.needs == {"colours"}
    assert FrontierUpdate(decision=model).sensors.needs_rgb


def test_its_name_and_options_are_in_the_header() -> None:
    component = DecisionSettings(kind="looks", mistakes=0.5).component(0, None)
    assert component.path == "evonav.decision.backends:appearance_match"
    assert component.options == {"eagerness": 0.0, "mistakes": 0.5}


def window_odds(text: str, *others: ObjectCandidate, known_share: float = 1.0) -> list[float]:
    """Return the probabilities of a mug whose views show what is beside it, and of one whose views show nothing."""
    mugs = [
        mug(1, 0.0, appearance_of("red", tuple(other.entry_id for other in others), known_share)),
        mug(2, 5.0, appearance_of("red", (), known_share)),
    ]
    return AppearanceMatcher().scores(parse_goal(f"Find the {text}."), mugs, [*mugs, *others], 0.0)


@pytest.mark.parametrize(
    ("text", "label"),
    [("mug near the window", "Window"), ("mug near the doorway", "Doorframe"), ("mug by a door", "Doorway")],
)
def test_doors_and_windows_count_where_the_views_of_an_object_show_them(text: str, label: str) -> None:
    beside = ObjectCandidate(11, label, (0.3, 1.5, 0.4), (1.0, 1.0, 0.1), 9)
    by_it, away = window_odds(text, beside)
    assert (by_it, away) == pytest.approx((0.75, 0.25))
    assert window_odds(text) == [0.5, 0.5], "an agent that remembers none cannot tell"
    assert window_odds(text, beside, known_share=0.5)[1] > away, "nor one that does not know the place"
