"""A classifier tells sets apart that differ, says by what, and fails at sets that do not, whatever the mix of specs."""

import random
import sys

import pytest

from evonav.cli import main
from evonav.errors import InvalidArgumentError, StoreError
from evonav.generation import house_classifier
from evonav.generation.house_classifier import NUM_FEATURES, tell_apart
from evonav.generation.house_statistics import HouseSample

pytest.importorskip("sklearn", reason="scikit-learn (extra `houses`) is not installed")


def drawn(count: int, seed: int, *, share_of_large: float, sign: float = 1.0) -> list[HouseSample]:
    """Houses in which doors and windows go together if `sign` is 1, and against each other if it is -1."""
    stream = random.Random(seed)
    samples = []
    for _ in range(count):
        is_large = stream.random() < share_of_large
        doors = stream.gauss(0.0, 1.0)
        features = {
            "area m2": stream.gauss(100.0 if is_large else 30.0, 5.0),
            "doors": doors,
            "windows": sign * doors + stream.gauss(0.0, 0.5),
            **{f"number of {name}": float(stream.randrange(4)) for name in ("Bed", "Mug", "Sofa")},
        }
        samples.append(HouseSample("large" if is_large else "small", features))
    return samples


def test_another_mix_of_specs_is_not_told() -> None:
    found = tell_apart(drawn(500, 1, share_of_large=0.2), drawn(500, 2, share_of_large=0.8))
    assert found.num_houses < 250  # as many of each spec as the smaller set has
    assert found.interval[0] <= 0.5
    assert found.accuracy == pytest.approx(0.5, abs=0.08)


def test_what_goes_together_is_told_where_no_mean_differs() -> None:
    sets = drawn(300, 1, share_of_large=0.5), drawn(300, 2, share_of_large=0.5, sign=-1.0)
    found = tell_apart(*sets)
    assert found.interval[0] <= found.accuracy <= found.interval[1]
    assert found.interval[0] > 0.75
    assert list(found.uses)[:2] in (["doors", "windows"], ["windows", "doors"])
    assert min(found.uses["doors"], found.uses["windows"]) > 0.2 > found.uses["number of Bed"]
    assert tell_apart(*sets) == found


def test_features_are_those_of_no_category_and_the_most_usual_categories() -> None:
    houses = [{"rooms": 1.0} | {f"number of {i:03}": 1.0 for i in range(100 - number)} for number in range(40)]
    samples = [HouseSample("one", features) for features in houses]
    found = tell_apart(samples[:20], samples[20:])
    assert set(found.uses) == {"rooms", *(f"number of {i:03}" for i in range(NUM_FEATURES - 1))}


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    few = drawn(4, 1, share_of_large=0.0)
    with pytest.raises(InvalidArgumentError, match="4 houses of the same room specs"):
        tell_apart(few, few)
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)
    with pytest.raises(StoreError, match=r"scikit-learn .*pip install 'evonav\[houses\]'"):
        tell_apart(few, few)


def test_the_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(house_classifier, "MIN_HOUSES", 5)
    monkeypatch.setattr(
        sys, "argv", ["evonav", "houses", "stats", "bundled", "endless:7", "--limit", "40", "--classifier"]
    )
    with pytest.raises(SystemExit) as exit_:
        main()
    shown = capsys.readouterr().out
    assert not exit_.value.code
    assert "free floor m2" in shown
    assert "chance is 50%" in shown
    assert "houses of each set" in shown
