"""Read the blocks of code in the pages of the documentation."""

import re
from collections.abc import Iterator
from pathlib import Path

from build_docs import ROOT

BLOCK = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    yield from BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def command_lines(page: Path) -> list[str]:
    found = []
    for language, text in blocks(page):
        if language not in ("", "bash", "console", "sh"):
            continue
        has_prompt = any(line.startswith("$ ") for line in text.splitlines())
        for raw in text.splitlines():
            if has_prompt and not raw.startswith("$ "):
                continue  # what a command prints
            line = re.split(r"\s+#\s", raw.removeprefix("$ "))[0].strip()
            if re.match(r"(evonav|make|pip|python|export|PYTHONPATH|\.venv)", line):
                found.append(line)
    return found


def python_texts(page: Path) -> list[str]:
    return [text for language, text in blocks(page) if language == "python"]
