"""Check that the repository's docstrings and pages are in plain English.

    python scripts/check_english.py [PATH ...]

What is checked:

- The first line of a docstring, of an attribute's documentation and of a parameter's description is a sentence, an
  imperative or a noun phrase that ends with a period. It does not begin with a preposition or a question word.
- Functions' docstrings are imperative (ruff's D401).
- Text, comments and pages have none of the phrases in `PHRASES`.
"""

import argparse
import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
CHECKED = ("python/evonav/**/*.py", "python/evonav/**/*.pyi", "rust/*/src/**/*.rs", "docs/**/*.md", "*.md")
EXEMPT = ("CHANGELOG.md",)

PHRASES = tuple(
    re.compile(phrase, re.IGNORECASE)
    for phrase in (
        r"\bsuch as (are|is|were|was)\b",
        r"\b(was|were|is|are|been) told of\b",
        r"\bnone of our\b",
        r"\brather too (much|many)\b",
        r"\bis what it was\b",
        r"\bworth what\b",
        r"\bunless told\b",
        r"\bto be had\b",
        r"\bbut for (the|those|a|an|what|one|some|its|their)\b",
        r"\banew\b",
        r"^(who|whoever) [a-z]+s\b[^?]*$",
    )
)
"""Phrases that a reader has to translate: write `except for`, `again`, `available`, and say who does what."""
_OPENERS = frozenset(
    """
    about after among around as at before behind below beneath beside between beyond by during for from in inside into
    of off on onto out outside over past per since through till to toward towards under until up upon via with
    within without
    how that what when where wherever which who whom whose why
    likewise so thus
    """.split()
)
# Nor does the docstring of a function begin with one of these, unless it is a property.
_FUNCTION_OPENERS = _OPENERS | frozenset("whether all another both each every none nothing one there those".split())
_PROPERTIES = frozenset(("property", "cached_property", "setter", "getter"))
_RUST_DOC = re.compile(r"^\s*//[/!](?!/) ?(.*)$")
_ENTRY = re.compile(r"^\s+\*{0,2}\w+(?: \([^)]*\))?: +(\S.*)$")


def findings(path: Path) -> Iterator[str]:
    """Yield what is wrong in a file, as `LINE: message`."""
    text = path.read_text(encoding="utf-8")
    if path.suffix in (".py", ".pyi"):
        yield from _python_findings(text)
    elif path.suffix == ".rs":
        yield from _rust_findings(text)
    else:
        yield from _phrase_findings(enumerate(text.splitlines(), 1))


def _python_findings(text: str) -> Iterator[str]:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _docstring_findings(node)
    yield from _phrase_findings(_prose_of_python(text))


def _docstring_findings(node: ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[str]:
    docstring = _string_of(node.body[0]) if node.body else None
    if docstring is not None:
        line = node.body[0].lineno
        openers = _FUNCTION_OPENERS if _is_plain_function(node) else _OPENERS
        yield from _opening_findings(line, docstring, openers=openers)
        for number, text in enumerate(docstring.splitlines()[1:], line + 1):
            entry = _ENTRY.match(text)
            if entry is not None:
                yield from _opener_findings(number, entry[1])
    for assigned, follower in zip(node.body, node.body[1:], strict=False):
        documented = _string_of(follower) if isinstance(assigned, ast.Assign | ast.AnnAssign) else None
        if documented is not None:
            yield from _opening_findings(follower.lineno, documented)


def _is_plain_function(node: ast.AST) -> bool:
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return False
    return not any(ast.unparse(decorator).split(".")[-1] in _PROPERTIES for decorator in node.decorator_list)


def _string_of(statement: ast.stmt) -> str | None:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        value = statement.value.value
        return value if isinstance(value, str) else None
    return None


def _prose_of_python(text: str) -> Iterator[tuple[int, str]]:
    """Yield the lines of comments and strings; a phrase over two lines is not seen."""
    prose = {tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in prose:
            yield from enumerate(token.string.splitlines(), token.start[0])


def _rust_findings(text: str) -> Iterator[str]:
    lines = text.splitlines()
    previous = False
    for number, line in enumerate(lines, 1):
        doc = _RUST_DOC.match(line)
        if doc is not None and not previous:
            yield from _opening_findings(number, doc[1], lines[number:])
        previous = doc is not None
    yield from _phrase_findings((number, line) for number, line in enumerate(lines, 1) if "//" in line or '"' in line)


def _opening_findings(
    line: int, text: str, following: Iterable[str] = (), *, openers: frozenset[str] = _OPENERS
) -> Iterator[str]:
    """Check a documentation's first line; in Rust, a first sentence may go on in `following` lines."""
    first = next(iter(text.strip().splitlines()), "")
    yield from _opener_findings(line, first, openers)
    for more in following:
        doc = _RUST_DOC.match(more)
        if doc is None or not doc[1].strip():
            break
        first = doc[1].rstrip()
    if not first.endswith((".", ".)", ":", "```")):
        yield f"{line}: the first line does not end with a period: {first!r}"


def _opener_findings(line: int, text: str, openers: frozenset[str] = _OPENERS) -> Iterator[str]:
    opener = text.split(" ", 1)[0].rstrip(",.:;").lower()
    if opener in openers:
        yield f"{line}: a fragment, write a sentence, an imperative or a noun phrase: {text!r}"


def _phrase_findings(lines: Iterable[tuple[int, str]]) -> Iterator[str]:
    for number, line in lines:
        for phrase in PHRASES:
            found = phrase.search(line)
            if found is not None:
                yield f"{number}: {found[0]!r}: say it plainly"


def mood_findings(paths: list[Path]) -> dict[Path, list[str]]:
    """Return ruff's findings of functions whose docstrings are not imperative, by file."""
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "D401", "--exit-zero"]
    command += ["--config", "lint.pydocstyle.convention='google'", "--output-format", "concise"]
    python = [str(path) for path in paths if path.suffix in (".py", ".pyi")]
    found: dict[Path, list[str]] = {}
    if python:
        answer = subprocess.run([*command, *python], check=True, capture_output=True, text=True, cwd=ROOT).stdout
        for line in answer.splitlines():
            match = re.match(r"(.+?):(\d+):\d+: D401 .*mood: (.*)$", line)
            if match is not None:
                found.setdefault(ROOT / match[1], []).append(f"{match[2]}: not imperative: {match[3]}")
    return found


def checked_files() -> list[Path]:
    """List the files that the rules hold for."""
    found = {path for pattern in CHECKED for path in ROOT.glob(pattern)}
    return sorted(path for path in found if path.name not in EXEMPT)


def problems(paths: list[Path]) -> dict[str, list[str]]:
    """Return the findings of each file that has any, by its path in the repository."""
    imperative = mood_findings(paths)
    found = {path.relative_to(ROOT).as_posix(): [*findings(path), *imperative.get(path, [])] for path in paths}
    return {name: lines for name, lines in found.items() if lines}


def main() -> None:
    """Print the findings of the given files, or of all; exit with 1 if there are any."""
    parser = argparse.ArgumentParser(description="Check docstrings and pages for plain English.")
    parser.add_argument("paths", nargs="*", type=Path, help="files or folders; default: all")
    wanted = [path.resolve() for path in parser.parse_args().paths]
    files = checked_files()
    if wanted:
        files = [path for path in files if any(path == place or place in path.parents for place in wanted)]
    found = problems(files)
    for name, lines in found.items():
        for line in lines:
            print(f"{name}:{line}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
