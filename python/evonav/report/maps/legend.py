"""Draw the legends of maps, with the same code as their marks."""

from collections.abc import Iterable

from markupsafe import Markup

from evonav.drawing.svg import arrow_head, escape, join, star

Entry = tuple[str, str, int]
"""A mark's meaning, its drawing in a box 24 px high, and the width of the box in pixels."""

ENTRIES: tuple[Entry, ...] = (
    (
        "path, from first round to last",
        '<g class="path" stroke-width="5">'
        + "".join(f'<path class="t{i}" d="M{4 + 5 * i} 12h5"/>' for i in range(10))
        + f'<g class="t6"><path class="head" d="{arrow_head((38, 12), (1, 0), 12)}"/></g></g>',
        58,
    ),
    ("start", '<circle class="start" cx="12" cy="12" r="6" stroke-width="3"/>', 24),
    (
        "end, success",
        '<g class="end ok" stroke-width="2.4"><circle cx="12" cy="12" r="8"/><path d="M8 12.4L11 15.2L16 9.2"/></g>',
        24,
    ),
    (
        "end, no success",
        '<g class="end bad" stroke-width="2.4"><circle cx="12" cy="12" r="8"/><path d="M9 9l6 6m0-6l-6 6"/></g>',
        24,
    ),
    ("target", f'<path class="star" stroke-width="1.4" d="{star((12, 12), 10)}"/>', 24),
    ("where it stood in stage 1", f'<path class="star old" stroke-width="1.4" d="{star((12, 12), 10)}"/>', 24),
    (
        "success radius",
        '<circle class="ring dash" cx="12" cy="12" r="9" stroke-width="1.6"/>',
        24,
    ),
    (
        "object moved before this stage",
        '<g class="ghost"><rect class="item dash" x="2" y="6" width="12" height="12" stroke-width="1.4"/>'
        "</g>"
        '<g class="moved"><rect class="item" x="40" y="6" width="12" height="12" stroke-width="1.4"/></g>'
        '<g class="arrow" stroke-width="2"><path d="M10 12h22"/>'
        f'<path class="head" d="{arrow_head((40, 12), (1, 0), 9)}"/></g>',
        56,
    ),
    (
        "stale entry of the goal's category",
        '<g class="stale" stroke-width="1.8"><g class="goal">'
        '<rect class="dash" x="4" y="4" width="16" height="16"/>'
        '<path d="M9 9l6 6m0-6l-6 6"/></g></g>',
        24,
    ),
    (
        "stale entry the agent went to",
        '<g class="stale" stroke-width="1.8"><g class="visited"><rect x="4" y="4" width="16" height="16"/>'
        '<path d="M9 9l6 6m0-6l-6 6"/></g></g>',
        24,
    ),
    (
        "other stale entry",
        '<g class="stale" stroke-width="1.8"><g class="weak">'
        '<rect class="dash" x="7" y="7" width="10" height="10"/>'
        "</g></g>",
        24,
    ),
)
_RECT = 'x="3" y="6" width="18" height="12" stroke-width="1.4"'


def _items(css: str) -> str:
    return f'<g class="{css}"><rect class="item" {_RECT}/></g>'


def entries_of(*meanings: str) -> tuple[Entry, ...]:
    """Return the entries of a run's legend with these meanings."""
    return tuple(entry for entry in ENTRIES if entry[0] in meanings)


TASK_ENTRIES: tuple[Entry, ...] = (
    ("room that changed", f'<rect class="tint" {_RECT}/>', 24),
    ("transition room", f'<rect class="between" {_RECT}/>', 24),
    ("moved, or about to", _items("moved"), 24),
    (
        "from where to where",
        '<g class="ghost"><rect class="item dash" x="2" y="6" width="12" height="12" '
        'stroke-width="1.4"/></g><g class="arrow" stroke-width="2"><path d="M10 12h14"/>'
        f'<path class="head" d="{arrow_head((34, 12), (1, 0), 9)}"/></g>',
        38,
    ),
    ("found no place", _items("unmoved"), 24),
    ("came", _items("new"), 24),
    ("went", _items("gone"), 24),
    ("opened, closed or switched", _items("opened"), 24),
    ("asset group", '<g class="groups" stroke-width="4"><path d="M4 6h16v12h-16z"/></g>', 24),
    *entries_of("start"),
    ("reference trajectory", '<path class="trajectory" stroke-width="3" d="M2 12h26"/>', 30),
    (
        "reference pose and view",
        '<path class="cone" stroke-width="1" d="M12 20L3 9A13 13 0 0 1 21 9Z"/>'
        '<circle class="eye" cx="12" cy="20" r="3.4" stroke-width="1"/>',
        24,
    ),
    *entries_of("target", "where it stood in stage 1"),
)
"""Entries of the legend of a task's floor plans."""


def legend(entries: Iterable[Entry] = ENTRIES) -> Markup:
    """Return marks and their meanings as HTML, by default those of a run's maps."""
    items = [
        Markup(
            '<span class="key"><svg class="map" width="{}" height="24" viewBox="0 0 {} 24" aria-hidden="true">'
        ).format(width, width)
        + Markup(drawing)  # noqa: S704 - our own SVG
        + Markup("</svg>{}</span>").format(meaning)
        for meaning, drawing, width in entries
    ]
    return Markup("").join(items)


def legend_row(width_px: int) -> tuple[str, int]:
    """Return the legend as SVG, broken into lines of `width_px`, and its height in pixels."""
    parts = []
    x = y = 0.0
    for meaning, drawing, icon_px in ENTRIES:
        item_px = icon_px + 6 + 6.3 * len(meaning) + 18
        if x > 0 and x + item_px > width_px:
            x, y = 0.0, y + 26
        label = f'<text class="quiet" x="{icon_px + 6}" y="16">{escape(meaning)}</text>'
        parts.append(f'<g transform="translate({x:.0f} {y:.0f})">{drawing}{label}</g>')
        x += item_px
    return join(parts), round(y + 26)
