"""Colours, fonts and CSS of all plots: the look of the pages, on light and dark ones."""

from markupsafe import Markup

INK, SOFT, GRID, PAPER = "#1f2530", "#667085", "#e2e5ea", "#ffffff"
COLOURS = ("#2f66cb", "#c2410c", "#15803d", "#7c3aed", "#a16207", "#0e7490")
"""Colours of series, in order."""
PALE, BAND, REFERENCE = "#9db9ec", "#fdeadb", "#c2410c"
_DARK = {
    INK: "#e6e9ef",
    SOFT: "#98a1b3",
    GRID: "#2a2f38",
    PAPER: "#14171c",
    PALE: "#2f4a80",
    BAND: "#3a2a1c",
    **dict(zip(COLOURS, ("#5f95f5", "#f08a4b", "#3fb56d", "#a78bfa", "#d0a030", "#38b2cf"), strict=True)),
}
"""Colours on dark pages, by the colour on light ones."""

RC = {
    "axes.axisbelow": True,
    "axes.edgecolor": SOFT,
    "axes.facecolor": "none",
    "axes.labelcolor": SOFT,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.h_pad": 0.08,
    "figure.constrained_layout.w_pad": 0.1,
    "figure.facecolor": PAPER,
    "font.size": 9,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "lines.linewidth": 1.5,
    "lines.markeredgewidth": 0,
    "lines.markersize": 5,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "text.color": INK,
    "text.parse_math": False,
    "xtick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.color": SOFT,
    "ytick.labelcolor": INK,
}
"""Settings of matplotlib; no name is read as a formula."""


def plot_css() -> Markup:
    """Return the style of all plots of a page.

    Colours of a plot are attributes of its elements, which any rule of CSS overrides: on a dark page each colour is
    replaced by its counterpart.
    """
    dark = "".join(
        f'.plot [{what}="{light}"]{{{what}:{colour}}}' for light, colour in _DARK.items() for what in ("fill", "stroke")
    )
    family = "ui-sans-serif,system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif"
    light = f".plot{{font-family:{family};max-width:100%;height:auto}}"
    return Markup(f"{light}@media (prefers-color-scheme:dark){{{dark}}}")  # noqa: S704 - our own
