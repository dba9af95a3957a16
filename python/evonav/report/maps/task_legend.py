"""Draw the legend of a task's floor plans."""

from markupsafe import Markup

from evonav.report.maps.legend import legend_html
from evonav.report.maps.svg import arrow_head, star

_RECT = 'x="3" y="6" width="18" height="12" stroke-width="1.4"'


def _items(css: str) -> str:
    return f'<g class="{css}"><rect class="item" {_RECT}/></g>'


_ENTRIES = (
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
    ("start", '<circle class="start" cx="12" cy="12" r="6" stroke-width="3"/>', 24),
    ("reference trajectory", '<path class="trajectory" stroke-width="3" d="M2 12h26"/>', 30),
    (
        "reference pose and view",
        '<path class="cone" stroke-width="1" d="M12 20L3 9A13 13 0 0 1 21 9Z"/>'
        '<circle class="eye" cx="12" cy="20" r="3.4" stroke-width="1"/>',
        24,
    ),
    ("target", f'<path class="star" stroke-width="1.4" d="{star((12, 12), 10)}"/>', 24),
    ("where it stood in stage 1", f'<path class="star old" stroke-width="1.4" d="{star((12, 12), 10)}"/>', 24),
)


def task_legend() -> Markup:
    """Return the legend as HTML."""
    return legend_html(_ENTRIES)
