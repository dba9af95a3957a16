"""The page of perceptions in headless Chromium: quiet, whole, and as wide as the window."""

from dataclasses import replace
from pathlib import Path

import pytest
from browser import Chromium, needs_browser

from evonav.component import Component
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.perception.shorthand import GROUND_TRUTH
from evonav.perception_benchmark.benchmark import PerceptionSpec, TourConfig, measure
from evonav.perception_benchmark.page import write_perception_report
from evonav.tasks.listing import BUNDLED_TASKS, task_files

pytestmark = needs_browser

SMUGGLED = '<img src="https://example.org/x" onerror="document.title = 1">'


class Smuggling(GroundTruthPerception):
    """Half of its labels are no words."""

    def perceive(self, frames):
        found = super().perceive(frames)
        for i, percept in enumerate(found):
            labels = tuple(label if j % 2 else SMUGGLED for j, label in enumerate(percept.detections.labels))
            found[i] = replace(percept, detections=replace(percept.detections, labels=labels))
        return found


def smuggling():
    return Smuggling()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("perceptions")
    specs = [
        PerceptionSpec("gt", Component(GROUND_TRUTH)),
        PerceptionSpec(f"mine:{SMUGGLED}", Component(f"{__name__}:smuggling")),
    ]
    measure(specs, task_files(BUNDLED_TASKS, 2), out, config=TourConfig(6, 1), num_workers=0)
    return write_perception_report(out)[0]


def test_the_page_is_quiet_and_whole(page: Path, tmp_path: Path) -> None:
    with Chromium(tmp_path / "profile") as browser:
        browser.open(page)
        assert browser.said() == []
        assert browser.run("document.querySelectorAll('details').forEach(one => one.open = true)") is None
        assert browser.run("Promise.all([...document.images].map(one => one.decode())).then(() => true)")
        assert browser.run("[...document.images].every(one => one.naturalWidth === 606)")
        assert browser.run("document.images.length") == 4
        assert browser.run("document.querySelectorAll('svg.plot').length") == 9
        assert browser.run("document.querySelector('h1').textContent").startswith("EvoNav-Bench")
        assert browser.run("document.title") != "1"
        assert browser.run("document.documentElement.scrollWidth <= window.innerWidth"), "only tables scroll sideways"
        assert SMUGGLED in browser.run("document.body.textContent")
        assert browser.said() == []
