"""Plots: every value has its mark where it belongs, in every format; pages need no style of a plot's own."""

import re
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest

from evonav.errors import InvalidArgumentError, StoreError
from evonav.report.plots import render
from evonav.report.plots.render import HINT, plot_elements, write_plots
from evonav.report.plots.specs import (
    BarPlot,
    ConfusionPlot,
    ConfusionRow,
    CurvePlot,
    Dot,
    Gap,
    GapPlot,
    GroupPlot,
    Line,
    Plot,
    ScatterPlot,
    Series,
)
from evonav.report.plots.style import plot_css

SVG = "{http://www.w3.org/2000/svg}"
GROUPS = GroupPlot(
    "SR by stratum",
    ("first\nn = 9", "moved\nn = 8"),
    (
        Series("fu", (90.0, 20.0), ((80.0, 95.0), None)),
        Series("_a<b>&$x$", (None, 60.0), (None, (50.0, 70.0))),
    ),
    "SR, %",
)
CURVES = CurvePlot(
    "SR by noise",
    (
        Line("fu", ((0.0, 60.0), (20.0, 30.0)), ((50.0, 70.0), None)),
        Line("ftu", ((0.0, 60.0), (20.0, 31.0)), (None, None)),
    ),
    "wrong, %",
    "SR, %",
)
GAPS = GapPlot("a less b", (Gap("x", "n = 3", 12.0, (-3.0, 27.0)), Gap("y", "", -1.0, None, True)), "left", "right")
BARS = BarPlot(
    "Evolutions",
    ("0", "1"),
    (Series("these tasks", (40.0, 60.0), ((30.0, 50.0), None)), Series("reweighted", (50.0, 50.0), (None, None))),
    x_label="number",
    references=(45.0, None),
    band=(1, 1),
    band_label="the median",
    notes=("a note",),
)
CONFUSIONS = ConfusionPlot("labels", ("right", "nothing", "Mug"), (ConfusionRow("Cup", 9, (0.7, 0.0, 0.3)),))
ALL: tuple[Plot, ...] = (GROUPS, CURVES, GAPS, BARS, CONFUSIONS)

needs_matplotlib = pytest.mark.skipif(not render.has_renderer(), reason="evonav[viz] is not installed")


def element(plot: Plot) -> ElementTree.Element:
    (drawn,) = plot_elements([plot])
    return ElementTree.fromstring(drawn)


def marks(root: ElementTree.Element) -> dict[str, tuple[float, float]]:
    """Places of dots, by tooltip; y grows downwards."""
    places = {}
    for node in root.iter(f"{SVG}g"):
        use = node.find(f".//{SVG}use")
        words = node.findtext(f"{SVG}title")
        if words is not None and use is not None:
            places[words] = (float(use.get("x", "")), float(use.get("y", "")))
    return places


def texts(root: ElementTree.Element) -> list[str]:
    return [node.text or "" for node in root.iter(f"{SVG}text")]


@needs_matplotlib
def test_a_group_plot_has_a_mark_for_every_value_where_it_belongs() -> None:
    root = element(GROUPS)
    found = marks(root)
    assert list(found) == [
        "fu, first, n = 9: 90.0 [80.0, 95.0]",
        "fu, moved, n = 8: 20.0",
        "_a<b>&$x$, moved, n = 8: 60.0 [50.0, 70.0]",
    ]
    (x0, y0), (x1, y1), (x2, y2) = found.values()
    assert x0 < x1 < x2
    assert y0 < y2 < y1  # up is more
    # Names are text as it is: no formula, and none left out.
    assert {"SR by stratum", "SR, %", "first", "n = 9", "fu", "\u200b_a<b>&$x$"} <= set(texts(root))


@needs_matplotlib
def test_a_curve_plot_draws_every_point() -> None:
    found = marks(element(CURVES))
    assert list(found) == ["fu: 60.0 at 0", "fu: 30.0 at 20", "ftu: 60.0 at 0", "ftu: 31.0 at 20"]
    (x0, y0), (x1, y1), (x2, y2), (_, y3) = found.values()
    assert x0 < x2 < x1  # a hair apart
    assert y0 == y2 < y3 < y1


@needs_matplotlib
def test_places_that_are_no_numbers_are_named() -> None:
    names = ("gt", "<b>", "poor")
    line = Line("fu", ((0.0, 60.0), (1.0, 40.0), (2.0, 20.0)))
    found = texts(element(CurvePlot("SR", (line,), "perception", "SR, %", names)))
    assert [text for text in found if text in names] == list(names)
    assert "1" not in found


@needs_matplotlib
def test_differences_are_drawn_around_zero() -> None:
    root = element(GAPS)
    (x, _), (y, _) = marks(root).values()
    assert y < x
    assert list(marks(root)) == ["x: +12.0 [-3.0, +27.0]", "y: -1.0"]
    assert {"← left", "right →", "n = 3", "0", "+10"} <= set(texts(root))
    assert marks(element(GapPlot("", (Gap("equal", "", 0.0, None),), "", ""))) != {}


@needs_matplotlib
def test_bars_stand_beside_what_was_published() -> None:
    root = element(BARS)
    titles = [node.text for node in root.iter(f"{SVG}title")][1:]
    assert titles == [
        "0, these tasks: 40.0% [30.0, 50.0]",
        "1, these tasks: 60.0%",
        "0, reweighted: 50.0%",
        "1, reweighted: 50.0%",
        "0, the paper: 45.0%",
    ]
    found = texts(root)
    assert {"a note", "number"} <= set(found)
    assert [text for text in found if text.startswith("the")] == ["these tasks", "the median", "the paper"]


@needs_matplotlib
def test_a_confusion_plot_names_its_columns_and_shares() -> None:
    found = texts(element(CONFUSIONS))
    assert {"right", "nothing", "Mug", "Cup (9)", "70", "30"} <= set(found)


@needs_matplotlib
def test_an_element_says_what_it_shows_and_brings_no_style() -> None:
    page = "".join(plot_elements(ALL))
    assert not re.search(r"\sstyle=|<style|font-family|http(?!://www\.w3\.org/2000/svg)", page)
    ids = re.findall(r'\sid="([^"]+)"', page)
    assert Counter(ids).most_common(1)[0][1] == 1
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)
    for plot, drawn in zip(ALL, plot_elements(ALL), strict=True):
        root = ElementTree.fromstring(drawn)
        assert root.get("role") == "img"
        assert root[0].text == plot.title
        assert root.findtext(f"{SVG}desc")
    # Every colour has its counterpart on dark pages.
    colours = set(re.findall(r'(?:fill|stroke)="(#\w+)"', page))
    assert {colour for colour in colours if f'[fill="{colour}"]' not in plot_css()} == set()


@needs_matplotlib
@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
def test_the_same_plots_are_the_same_file(tmp_path: Path, suffix: str) -> None:
    starts = {".svg": b"<svg", ".png": b"\x89PNG", ".pdf": b"%PDF"}
    data = write_plots(ALL, tmp_path / f"new/a{suffix}", columns=2).read_bytes()
    assert data.startswith(starts[suffix])
    assert write_plots(ALL, tmp_path / f"b{suffix}", columns=2).read_bytes() == data


@needs_matplotlib
def test_letters_that_the_font_lacks_are_no_warning() -> None:
    plot = CurvePlot("\u4e2d \x00", (Line("\u4e2d", ((0.0, 1.0),)), Line("b", ((0.0, 2.0),))), "", "")
    assert "\u4e2d \ufffd" in texts(element(plot))


def test_without_matplotlib_a_page_has_one_line_in_place_of_plots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render, "find_spec", lambda name: None)
    (line,) = plot_elements(ALL)
    assert line.unescape() == f'<p class="note">{HINT}</p>'
    assert plot_elements([]) == []
    with pytest.raises(StoreError, match=re.escape(HINT)):
        write_plots(ALL, tmp_path / "x.svg")


def test_a_file_of_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgumentError, match=r"x\.gif.*expected a file \.svg, \.png, \.pdf"):
        write_plots(ALL, tmp_path / "x.gif")


def test_dots_lie_by_two_numbers_and_those_beyond_the_axis_are_open(tmp_path: Path) -> None:
    dots = (
        Dot("never", 5.0, None, 1000.0, "1,000 bytes", (4.0, 6.0)),
        Dot("bayes", 50.0, 2.0, 4000.0, "4,000 bytes", (40.0, 60.0), (1.0, 3.0)),
        Dot("list", 500.0, 2.0),
    )
    plot = ScatterPlot("Latency and staleness", dots, "ms", "frames", "not reached")
    (element,) = plot_elements([plot])
    for text in ("never: 5.0, not reached, 1,000 bytes", "bayes: 50.0, 2.0, 4,000 bytes", "open: not reached", "100"):
        assert text in element, text
    assert "mathdefault" not in element
    file = write_plots([plot], tmp_path / "plot.svg")
    assert file.read_text().count("open: not reached") == 1
    (closed,) = plot_elements([ScatterPlot("t", dots[1:], "ms", "frames", "not reached")])
    assert "open" not in closed
