"""Links of the documentation lead somewhere, its menu is whole, and what it names is there."""

import importlib
import json
import re
from collections import Counter
from pathlib import Path

import pytest
from build_docs import ROOT, links, pages
from doc_blocks import blocks

STUDIES = Path("docs/studies")
"""Pages for researchers, linked from their own list."""


@pytest.mark.parametrize("page", pages(), ids=str)
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    for words, target in links(page):
        assert (ROOT / target).exists(), f"{page}: {words}"


def test_every_page_for_users_is_in_the_menu_once() -> None:
    _, _, navigation = (ROOT / "mkdocs.yml").read_text().partition("\nnav:\n")
    listed = Counter(re.findall(r": (\S+[.]md)$", navigation, re.MULTILINE))
    assert set(listed.values()) == {1}
    menu = {Path("README.md") if name == "index.md" else Path(name) for name in listed}
    studies = {page for page in pages() if page.parent == STUDIES} - menu
    assert menu | studies == set(pages())
    assert studies <= {target for _, target in links(STUDIES / "README.md")}


def test_api_pages_name_modules_that_exist() -> None:
    named = [name for page in pages() for name in re.findall(r"^::: (\S+)", (ROOT / page).read_text(), re.MULTILINE)]
    assert len(named) > 20
    for name in named:
        importlib.import_module(name)


def test_bundled_json_of_pages_is_json() -> None:
    for page in pages():
        for language, text in blocks(page):
            if language == "json":
                json.loads(text)
