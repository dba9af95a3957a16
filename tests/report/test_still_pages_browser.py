"""Pages of tasks, statistics, comparisons and controlled analyses in headless Chromium."""

import shutil
from pathlib import Path

import pytest
from browser import Chromium, needs_browser
from command_line import command
from made_up_analysis import ARMS, PAIRS, write_analysis
from made_up_run import WriteRun

from evonav.controlled.page import write_controlled_report
from evonav.tasks.listing import BUNDLED_TASKS

pytestmark = needs_browser

BROKEN = "[...document.images].filter(image => !image.complete || image.naturalWidth === 0).length"
SMUGGLED = '<script>document.title = "smuggled"</script><img src="https://example.org/x" onerror="document.title = 1">'


def pages_of(folder: Path, write_run: WriteRun) -> list[Path]:
    """One of every kind."""
    one = next(path for path in sorted(BUNDLED_TASKS.iterdir()) if path.is_dir())
    (folder / "tasks").mkdir(parents=True)
    shutil.copytree(one, folder / "tasks" / one.name)
    command("tasks", "show", folder / "tasks", "--out", folder / "gallery")
    command("tasks", "stats", folder / "tasks", "--out", folder / "statistics")
    command("compare", write_run(), "--out", folder / "compare.html")
    write_analysis(folder / "pairs", "pairs", ARMS, PAIRS)
    report = write_controlled_report(folder / "pairs")
    gallery = sorted((folder / "gallery").glob("*.html"))
    still = next((folder / "statistics").glob("*.html"))
    return [*gallery, still, folder / "compare.html", report, next(report.parent.glob("pairs/*.html"))]


@pytest.mark.slow
def test_pages_are_quiet_whole_and_let_nothing_in(tmp_path: Path, write_run: WriteRun) -> None:
    pages = pages_of(tmp_path / "pages", write_run)
    assert len(pages) == 6
    with Chromium(tmp_path / "profile") as browser:
        for page in pages:
            browser.events.clear()
            browser.open(page)
            assert browser.said() == [], page
            assert browser.run(BROKEN) == 0, page
            smuggling = page.with_name(f"smuggled-{page.name}")
            smuggling.write_text(page.read_text("utf-8").replace("<main>", f"<main>{SMUGGLED}", 1), "utf-8")
            browser.events.clear()
            browser.open(smuggling)
            assert browser.run("document.title") not in ("smuggled", "1"), page
            told = [event["params"]["entry"]["text"] for event in browser.said()]
            assert len(told) >= 3, page
            assert all("Content Security Policy" in text for text in told), told


def test_the_gallery_is_searched(tmp_path: Path, write_run: WriteRun) -> None:
    gallery = pages_of(tmp_path / "pages", write_run)[-6:-4]
    index = next(page for page in gallery if page.name == "index.html")
    search = """words => {
        const field = document.querySelector("input");
        field.value = words;
        field.dispatchEvent(new Event("input", {bubbles: true}));
        const num = document.querySelectorAll(".card:not([hidden])").length;
        return [document.querySelector("output").textContent, num];
    }"""
    with Chromium(tmp_path / "profile") as browser:
        browser.open(index)
        assert browser.run(f"({search})('bundled')") == ["1 task", 1]
        assert browser.run(f"({search})('no such task')") == ["0 of 1 task", 0]
