"""The repository's English: `scripts/check_english.py` on every file."""

from collections.abc import Callable
from pathlib import Path

import check_english
import pytest


def test_the_repository_is_in_plain_english() -> None:
    found = check_english.problems(check_english.checked_files())
    lines = [f"{name}:{line}" for name, lines in found.items() for line in lines]
    assert not lines, "\n".join(lines)


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
        "# Such as are there.\n",
        'raise ValueError("it has none of our form")\n',
    ],
)
def test_stiff_english_in_python_is_found(check: Callable[[str, str], list[str]], text: str) -> None:
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


def test_stiff_english_in_rust_is_found(check: Callable[[str, str], list[str]]) -> None:
    assert len(check("lib.rs", "/// Of the house.\npub fn area() {}\n")) == 1
    assert len(check("lib.rs", "/// The area\npub fn area() {}\n")) == 1
    assert check("lib.rs", "/// The area of\n/// a house.\n///\n/// # Returns\npub fn area() {}\n") == []


def test_stiff_english_in_pages_is_found(check: Callable[[str, str], list[str]]) -> None:
    assert len(check("page.md", "It lists where it is to be had.\n")) == 1
