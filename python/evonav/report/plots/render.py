"""Render plots: as elements of pages, and as SVG, PNG and PDF files (extra `viz`)."""

import hashlib
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from markupsafe import Markup

from evonav.drawing.files import SUFFIXES, check_suffix
from evonav.drawing.svg import escape, title
from evonav.errors import StoreError
from evonav.parallel.folders import write_atomically
from evonav.report.plots.draw import TOOLTIP, draw, size_in
from evonav.report.plots.specs import GapPlot, Plot
from evonav.report.plots.style import RC, plot_css

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HINT = "Plots need: pip install 'evonav[viz]'"
EVEN_WIDTH_IN = 5.6
"""Smallest width of plots that share the rows of a page: about that at which a page shows them."""
_PX_PER_POINT = 96 / 72
_SKIPPED = frozenset(("metadata", "style", "clipPath"))
_DROPPED = frozenset(("font-family", "clip-path"))
_DECIMALS = re.compile(r"-?\d+\.\d{3,}")


def has_renderer() -> bool:
    """Return whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def plot_elements(plots: Sequence[Plot], *, are_even: bool = False) -> list[Markup]:
    """Return plots as `svg` elements for a page that has `plot_css()`.

    Args:
        are_even: Whether all plots have the width of the widest, and all of a kind the height of the highest, so that
            they fill the rows of a page.

    Returns:
        One element a plot, without styles of its own; where matplotlib is missing, a single line that says so.
    """
    if plots and not has_renderer():
        return [Markup('<p class="note">{}</p>').format(HINT)]
    sizes = _even_sizes(plots) if are_even else [size_in(plot) for plot in plots]
    return [Markup(_svg([plot], [size], columns=1, style="")) for plot, size in zip(plots, sizes, strict=True)]  # noqa: S704 - our own SVG


def _even_sizes(plots: Sequence[Plot]) -> list[tuple[float, float]]:
    sizes = [size_in(plot) for plot in plots]
    width_in = max([EVEN_WIDTH_IN, *(width for width, _ in sizes)])
    kinds = [isinstance(plot, GapPlot) for plot in plots]
    heights_in = {
        kind: max(height for one, (_, height) in zip(kinds, sizes, strict=True) if one is kind) for kind in kinds
    }
    return [(width_in, heights_in[kind]) for kind in kinds]


def check_plot(path: Path) -> None:
    """Check that a plot could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed.
    """
    check_suffix(path, *SUFFIXES)
    if not has_renderer():
        raise StoreError(f"{path}: matplotlib is not installed. {HINT}")


def write_plots(plots: Sequence[Plot], path: Path, *, columns: int = 1) -> Path:
    """Write plots as one file; the same plots give the same bytes.

    Args:
        path: `.svg`, `.png` or `.pdf` file; folders are made.
        columns: Number of plots side by side.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed, or the file cannot be written.
    """
    check_plot(path)
    suffix, sizes = path.suffix.lower(), list(map(size_in, plots))
    if suffix == ".svg":
        return write_atomically(path, _svg(plots, sizes, columns, f"<style>{plot_css()}</style>") + "\n")
    drawn = BytesIO()
    with _figure(plots, sizes, columns) as figure:
        # Without dates, the same plots are the same file.
        metadata = {"CreationDate": None} if suffix == ".pdf" else {}
        figure.savefig(drawn, format=suffix[1:], dpi=200, metadata=metadata)
    return write_atomically(path, drawn.getvalue())


@contextmanager
def _figure(plots: Sequence[Plot], sizes: Sequence[tuple[float, float]], columns: int) -> "Iterator[Figure]":
    """Draw plots row by row, in the style of the pages; `sizes` are their widths and heights in inches."""
    from matplotlib import style
    from matplotlib.figure import Figure

    rows = [sizes[i : i + columns] for i in range(0, len(sizes), columns)]
    widths = [max(row[j][0] for row in rows if j < len(row)) for j in range(min(columns, len(plots)))]
    heights = [max(height for _, height in row) for row in rows]
    # Names hold the ids of their marks apart: no two plots of a page have an id in common.
    salt = hashlib.sha256(repr(plots).encode("utf-8", "replace")).hexdigest()
    with style.context([RC, {"svg.hashsalt": salt}], after_reset=True), warnings.catch_warnings():
        # A page's own fonts have the letters that matplotlib's lacks.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure = Figure(figsize=(sum(widths), sum(heights)), layout="constrained")
        panels = figure.subfigures(len(rows), len(widths), False, width_ratios=widths, height_ratios=heights).flat
        for panel, plot in zip(panels, plots, strict=False):
            draw(panel, plot)
        yield figure


def _svg(plots: Sequence[Plot], sizes: Sequence[tuple[float, float]], columns: int, style: str) -> str:
    drawn = BytesIO()
    with _figure(plots, sizes, columns) as figure:
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    root = ElementTree.fromstring(drawn.getvalue())  # noqa: S314 - our own
    tooltips: list[str] = []
    content = "".join(_element(child, tooltips) for child in root)
    width = _PX_PER_POINT * float(root.attrib["viewBox"].split()[2])
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" viewBox="{root.attrib["viewBox"]}" width="{width:.0f}" '
        f'role="img" stroke-linejoin="round">{title("; ".join(plot.title for plot in plots))}'
        f"<desc>{escape('; '.join(tooltips))}</desc>{style}{content}</svg>"
    )


def _element(node: ElementTree.Element, tooltips: list[str]) -> str:
    """Return an element of matplotlib's SVG without styles, unused ids and surplus digits; ids become tooltips."""
    tag = node.tag.rpartition("}")[2]
    if tag in _SKIPPED:
        return ""
    mark = node.get("id", "")
    tooltip = ""
    if mark.startswith(TOOLTIP):
        tooltips.append(mark.removeprefix(TOOLTIP))
        tooltip = title(tooltips[-1])
    content = tooltip + "".join(_element(child, tooltips) for child in node)
    attributes = _attributes(node, keeps_id=tag == "path")
    if tag == "g" and not attributes and not tooltip:
        return content
    if tag == "defs" and not content:
        return ""
    if tag == "text":
        content = escape(node.text or "")
    return f"<{tag}{attributes}>{content}</{tag}>" if content else f"<{tag}{attributes}/>"


def _attributes(node: ElementTree.Element, *, keeps_id: bool) -> str:
    """Return attributes as text, with those of `style` among them: a page's policy forbids styles."""
    found: dict[str, str] = {}
    for name, value in node.attrib.items():
        key = name.rpartition("}")[2]
        if key == "style":
            parts = (part.partition(":") for part in value.split(";"))
            found |= {part.strip(): setting.strip() for part, _, setting in parts if part.strip()}
        elif key != "id" or keeps_id:
            found[key] = value
    shown = {name: value for name, value in found.items() if name not in _DROPPED and not value.startswith("rotate(-0")}
    numbers = {name: _DECIMALS.sub(_rounded, " ".join(value.split())) for name, value in shown.items()}
    return "".join(f' {name}="{escape(value)}"' for name, value in numbers.items())


def _rounded(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")
