"""docs/decision.md says what there is: every question, every option, every fault."""

import inspect
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

from evonav import agents
from evonav.cli.options.settings import FLAGS, setting_keys
from evonav.decision.noisy import NoiseRates
from evonav.decision.question import Question
from evonav.decision.vlm.decision import FAULTS
from evonav.decision.vlm.errors import LASTING

TEXT = (Path(__file__).parents[2] / "docs" / "decision.md").read_text(encoding="utf-8")


def kinds() -> dict[str, str]:
    """Kinds of all questions, by class."""
    found = {}
    for module in walk_packages(agents.__path__, f"{agents.__name__}."):
        for name, kind in inspect.getmembers(import_module(module.name), inspect.isclass):
            if issubclass(kind, Question) and not inspect.isabstract(kind):
                found[name] = kind.kind
    return found


def test_every_question_has_a_kind_of_its_own_and_a_row() -> None:
    found = kinds()
    assert len(found) >= 18
    assert len(set(found.values())) == len(found)
    for kind in found.values():
        assert f"| `{kind}` |" in TEXT, kind


def test_options_and_noise_are_told_of() -> None:
    for key in setting_keys(("decision.", "prices", "max_cost")):
        assert FLAGS.get(key, key) in TEXT, key
    for rate in NoiseRates.model_fields:
        assert f"{rate}=" in TEXT, rate


def test_every_failure_of_a_model_has_a_consequence() -> None:
    from typing import get_args

    from evonav.decision.vlm.errors import VlmFailure

    assert set(FAULTS) | LASTING == set(get_args(VlmFailure))
    assert not set(FAULTS) & LASTING
