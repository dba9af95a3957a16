"""Builds the documentation's site from the repository's own pages: `make docs`.

    python scripts/docs/build_docs.py [--stage-only]

Pages link each other and files of the repository as they lie there; the site's source is a copy of them in the same
places, so that links hold in both. Zensical builds it; its configuration is a plain `mkdocs.yml`.
"""

import argparse
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "out" / "docs-source"
SITE = ROOT / "out" / "docs"
PAGES = (
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "benches/README.md",
    "examples/README.md",
    "docs/**/*.md",
)
# The README is the package's page on its index too, so its links into the repository are absolute.
_REPOSITORY = re.compile(r"https://(?:github\.com/evonav/evonav/blob|raw\.githubusercontent\.com/evonav/evonav)/main/")
_LINK = re.compile(r"(!?\[[^\]]*\])\(([^)#\s]+)(#[^)\s]*)?\)")
_ABSOLUTE = re.compile(r"[a-z]+:")


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stage-only", action="store_true", help="only copy the pages")
    asked = parser.parse_args()
    stage()
    if not asked.stage_only:
        shutil.rmtree(SITE, ignore_errors=True)
        zensical = Path(sys.executable).with_name("zensical")
        subprocess.run([zensical, "build", "--clean", "--strict"], cwd=ROOT, check=True)
        sys.stdout.write(f"{SITE / 'index.html'}\n")


def pages() -> list[Path]:
    """The pages of the site, relative to the repository."""
    return sorted(path.relative_to(ROOT) for pattern in PAGES for path in ROOT.glob(pattern))


def links(page: Path) -> Iterator[tuple[str, Path]]:
    """What a page links inside the repository: the words of the link, and the file relative to the repository."""
    text = re.sub(r"^```.*?^```", "", _text(page), flags=re.DOTALL | re.MULTILINE)
    for _, target, _ in _LINK.findall(text):
        if not _ABSOLUTE.match(target):
            yield target, (ROOT / page.parent / target).resolve().relative_to(ROOT)


def stage() -> None:
    """Copies pages and all that they link; the repository's README is the site's first page."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    known = set(pages())
    for page in known:
        for _, target in links(page):
            if target not in known and (ROOT / target).is_file():
                _copy(target)
        text = _text(page)
        name = page.with_name("index.md") if page == Path("README.md") else page
        (SOURCE / name).parent.mkdir(parents=True, exist_ok=True)
        (SOURCE / name).write_text(re.sub(r"\]\(\.\./README\.md", "](../index.md", text), encoding="utf-8")


def _text(page: Path) -> str:
    """Return a page with relative links into the repository."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return _REPOSITORY.sub("", text) if page == Path("README.md") else text


def _copy(path: Path) -> None:
    (SOURCE / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(ROOT / path, SOURCE / path)


if __name__ == "__main__":
    main()
