from importlib import import_module

import pytest

from evonav.evaluation.records.former_paths import CURRENT_PATHS, with_current_paths


@pytest.mark.parametrize("path", sorted(set(CURRENT_PATHS.values())))
def test_current_paths_can_be_imported(path):
    module, _, name = path.partition(":")
    assert callable(getattr(import_module(module), name))
    assert path not in CURRENT_PATHS, "a current path is no former one"


def test_former_paths_are_replaced_wherever_they_stand_in_a_header():
    old, new = "evonav.evaluation.backend:ground_truth", "evonav.perception.ground_truth:GroundTruthPerception"
    header = {"backend": {"perception": old, "simulator": "mine:make"}, "list": [old, 1, None], "seed": 0}
    assert with_current_paths(header) == {
        "backend": {"perception": new, "simulator": "mine:make"},
        "list": [new, 1, None],
        "seed": 0,
    }
