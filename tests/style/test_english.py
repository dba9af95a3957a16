"""The repository's English: `scripts/check_english.py` on every file, but for those that are not converted yet."""

from collections.abc import Callable
from pathlib import Path

import check_english
import pytest


@pytest.fixture(scope="module")
def found() -> dict[str, list[str]]:
    return check_english.problems(check_english.checked_files())


def test_converted_files_are_in_plain_english(found: dict[str, list[str]]) -> None:
    pending = set(check_english.pending_files())
    lines = [f"{name}:{line}" for name, lines in found.items() if name not in pending for line in lines]
    assert not lines, "\n".join(lines)


def test_the_list_of_pending_files_only_has_files_with_findings(found: dict[str, list[str]]) -> None:
    done = [name for name in check_english.pending_files() if name not in found]
    assert not done, f"run `python scripts/check_english.py --update` to remove: {', '.join(done)}"


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], list[str]]:
    monkeypatch.setattr(check_english, "ROOT", tmp_path)

    def of_file(name: str, text: str) -> list[str]:
        (tmp_path / name).write_text(text)
        return check_english.problems([tmp_path / name]).get(name, [])

    return of_file


@pytest.mark.parametrize(
    "text",
    [
        '"""Of the house."""\n',
        '"""What the agent sees."""\n',
        '"""A sentence that does not end"""\n',
        'def f() -> None:\n    """Returns nothing."""\n',
        'def f() -> bool:\n    """Whether it is open."""\n',
        'def f(a: int) -> None:\n    """Count.\n\n    Args:\n        a: Of the house.\n    """\n',
        'size_m = 1.0\n"""Of the house."""\n',
        "told = 1\n",
        "class StageWitness: ...\n",
        "def f(num_kept: int) -> None: ...\n",
        "words = []\n",
        "# Such as are there.\n",
        'raise ValueError("it has none of our form")\n',
    ],
)
def test_dialect_in_python_is_found(check: Callable[[str, str], list[str]], text: str) -> None:
    assert len(check("module.py", text)) == 1


def test_plain_python_has_no_findings(check: Callable[[str, str], list[str]]) -> None:
    text = '''"""Read houses."""

num_words = 3
"""Number of words in an instruction."""


class House:
    """A house."""

    @property
    def is_open(self) -> bool:
        """Whether the house is open."""

    def area(self, room: str) -> float:
        """Return the area of a room.

        Args:
            room: The room's id.
        """
'''
    assert check("module.py", text) == []


def test_a_bad_module_name_is_found(check: Callable[[str, str], list[str]]) -> None:
    assert len(check("witness.py", '"""Track objects."""\n')) == 1


def test_dialect_in_rust_is_found(check: Callable[[str, str], list[str]]) -> None:
    assert len(check("lib.rs", "/// Of the house.\npub fn area() {}\n")) == 1
    assert len(check("lib.rs", "/// The area\npub fn told() {}\n")) == 2
    assert check("lib.rs", "/// The area of\n/// a house.\n///\n/// # Returns\npub fn area() {}\n") == []


def test_dialect_in_pages_is_found(check: Callable[[str, str], list[str]]) -> None:
    assert len(check("page.md", "A run is gone on with.\n")) == 1
