"""`import evonav` offers exactly the names of the front door, each explained by an example that runs."""

import doctest
import inspect
import warnings
from enum import Enum
from pathlib import Path

import pytest

import evonav

NAMES = {
    "do": ("evaluate", "generate_tasks", "check_agent", "check_memory", "load_run", "load_tasks", "load_houses"),
    "write an agent": (
        "Agent",
        "Explanation",
        "PlaceBelief",
        "SensorConfig",
        "TaskInfo",
        "Goal",
        "Observation",
        "Move",
        "NavigateTo",
        "Stop",
    ),
    "remember": ("OccupancyMap", "ObjectMap"),
    "simulate": ("House", "Simulator", "Pose", "Action"),
    "rest": ("Run", "EvonavError", "__version__"),
}
ALL = sorted(name for names in NAMES.values() for name in names)
SIGNATURES = Path(__file__).with_name("signatures.txt")


def test_the_names_are_those_of_the_front_door() -> None:
    assert len(ALL) == 26
    assert sorted(evonav.__all__) == sorted(dir(evonav)) == ALL


@pytest.mark.parametrize("name", [name for name in ALL if name != "__version__"])
def test_the_example_of_a_docstring_runs(name: str) -> None:
    text = inspect.getdoc(getattr(evonav, name))
    assert text is not None
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert test.examples, f"evonav.{name} has no example"
    written: list[str] = []
    result = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS).run(test, out=written.append)
    assert result.failed == 0, "".join(written)


def test_a_change_of_a_public_signature_is_seen() -> None:
    """After a change on purpose, write the new text to `signatures.txt`."""
    assert "\n".join(_signatures()) + "\n" == SIGNATURES.read_text()


def _signatures() -> list[str]:
    """Return one line for each public function, class, method and property, without types."""
    lines = []
    for name in ALL:
        found = getattr(evonav, name)
        if isinstance(found, str):
            lines.append(name)
        elif not isinstance(found, type):
            lines.append(f"{name}{_plain(found)}")
        else:
            takes_nothing = issubclass(found, Enum | Exception) or found is evonav.Agent
            lines.append(f"class {name}{'' if takes_nothing else _plain(found)}")
            lines += [f"    {line}" for line in _members(found)]
    return lines


def _members(found: type) -> list[str]:
    """Return the public attributes that the class defines or describes."""
    names = {name for name in vars(found) if not name.startswith("_")}
    lines = []
    for name in sorted(names | set(getattr(found, "__annotations__", ()))):
        member = inspect.getattr_static(found, name, None)
        member = getattr(member, "__func__", member)
        lines.append(f"{name}{_plain(member)}" if callable(member) else name)
    return [line for line in lines if not line.startswith("_")]


def _plain(found: object) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        signature = inspect.signature(found)  # type: ignore[arg-type]
    plain = [parameter.replace(annotation=inspect.Parameter.empty) for parameter in signature.parameters.values()]
    return str(inspect.Signature(plain))
