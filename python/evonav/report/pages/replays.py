"""List the pages of replayed episodes that stand beside a run, so that the run's page can link to them or hold them.

`evonav view` writes the pages and this list; a report only reads them.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.drawing.style import map_css
from evonav.report.pages.template import text_of

LIST_NAME = "pages.json"


@dataclass(frozen=True, slots=True)
class ListedPage:
    """A replayed episode's page, as the list names it."""

    agent: str
    task_id: str
    href: str
    stages: list[list[Any]]
    """Number, state and outcome in words."""
    differs: bool
    records_sha256: str
    """Digest of the records that the page shows."""
    code: str
    """Digest of the page's own style and script."""

    @property
    def is_current(self) -> bool:
        """Whether this version of evonav would write the same page."""
        return self.code == page_code()


def listed_pages(view_dir: Path) -> list[ListedPage]:
    """Return the listed pages that are there; none if the list cannot be read or is of another version."""
    try:
        rows = json.loads((view_dir / LIST_NAME).read_text(encoding="utf-8"))
        pages = [ListedPage(**row) for row in rows]
        # Names from a file: only those of this folder.
        return [page for page in pages if page.stages and page.href in {path.name for path in view_dir.iterdir()}]
    except (OSError, ValueError, TypeError):
        return []


def viewer_css() -> Markup:
    """Return the style of an episode's page."""
    return text_of("report.css") + map_css() + text_of("viewer.css")


def page_code() -> str:
    """Return a digest of the style, the script and the templates of an episode's page."""
    others = "".join(map(text_of, ("viewer.js", "page.html.j2", "viewer.html.j2")))
    return hashlib.sha256((viewer_css() + others).encode()).hexdigest()
