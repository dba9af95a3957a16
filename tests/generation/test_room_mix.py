import ast
from pathlib import Path

import numpy as np
import pytest

from evonav.errors import InvalidArgumentError
from evonav.tasks.statistics import PROCTHOR_10K_PLANS, reweight


def test_the_mix_is_eighteen_twenty_seconds_of_the_published_one() -> None:
    assert sum(weight for _, weight in PROCTHOR_10K_PLANS.values()) == 18
    mean = sum(rooms * weight for rooms, weight in PROCTHOR_10K_PLANS.values()) / 18
    assert mean == pytest.approx(4.72, abs=0.005)


def test_the_mix_is_the_published_generators() -> None:
    pytest.importorskip("procthor", reason="the published generator is not installed (docs/procthor.md)")
    from procthor.generation import room_specs  # pyright: ignore

    source = Path(room_specs.__file__).read_text()
    told: dict[str, tuple[int, int]] = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "RoomSpec":
            fields = {keyword.arg: keyword.value for keyword in node.keywords}
            leaves = sum(
                isinstance(inner, ast.Call) and getattr(inner.func, "id", "") == "LeafRoom" for inner in ast.walk(node)
            )
            told[ast.literal_eval(fields["room_spec_id"])] = (leaves, ast.literal_eval(fields["sampling_weight"]))
    assert {plan: entry for plan, entry in told.items() if entry[0] > 1} == PROCTHOR_10K_PLANS


def test_by_number_of_rooms_where_a_plan_is_unknown() -> None:
    """Two and four rooms are 4 and 5 of 18: weights 4/9 and 5/9 over three and one task."""
    found = reweight("procthor-10k", [2, 2, 2, 4, 1], [None] * 5)
    assert found.record.by == "number of rooms"
    assert found.record.covered_share == pytest.approx(9 / 18)
    assert found.weights == pytest.approx([4 / 9 / 3 * 4] * 3 + [5 / 9 * 4, 0])
    assert found.weights[:4].mean() == pytest.approx(1)
    assert found.task_strata[4] == -1


def test_by_plan_where_all_are_known_and_there() -> None:
    plans = ["bedroom-bathroom", "bedroom-bathroom", "kitchen-living-room", "4-room"]
    found = reweight("procthor-10k", [2, 2, 2, 4], plans)
    assert found.record.by == "room plan"
    assert found.weights == pytest.approx(np.array([1, 1, 2, 5]) / 9 * 4)
    # Without the other plan of two rooms its part would be lost: then two rooms stand for two rooms.
    assert reweight("procthor-10k", [2, 2, 4], [plans[0], plans[1], plans[3]]).record.by == "number of rooms"
    # A plan whose name does not fit its rooms is none.
    assert reweight("procthor-10k", [2, 2, 3, 4], plans).record.by == "number of rooms"


def test_the_mix_itself_is_left_as_it_is() -> None:
    rooms, plans = [], []
    for plan, (num_rooms, weight) in PROCTHOR_10K_PLANS.items():
        rooms += [num_rooms] * weight
        plans += [plan] * weight
    found = reweight("procthor-10k", rooms, plans)
    assert found.weights == pytest.approx(np.ones(18))
    assert found.record.covered_share == pytest.approx(1)


def test_unknown_mixes_and_houses_of_none_are_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="procthor-10k"):
        reweight("procthor-9k", [2], [None])
    with pytest.raises(InvalidArgumentError, match="as many rooms"):
        reweight("procthor-10k", [1, 9], [None, None])
