"""Provide what all pages share: escaping templates, a policy that forbids the network, bars of rates, packed parts."""

import base64
import hashlib
import zlib
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from evonav.counted import counted
from evonav.drawing.svg import clean
from evonav.report.tables.table import short_names
from evonav.statistics import Interval


def text_of(name: str) -> Markup:
    """Return a file of the package, which is trusted as it is."""
    text = (files("evonav.report") / "templates" / name).read_text(encoding="utf-8")
    return Markup(text)  # noqa: S704 - our own file


@cache
def page_environment() -> Environment:
    """Return the package's templates, each compiled once; text is escaped, and what no page may contain is replaced."""
    environment = Environment(
        loader=PackageLoader("evonav.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value,
    )
    environment.globals["counted"] = counted
    environment.filters["short_of"] = lambda agent, agents: short_names(agents).get(agent, agent)
    return environment


def page_text(
    template: str, css: Markup, js: Markup | None = None, *, has_drawings: bool = False, **values: object
) -> str:
    """Render a page with its style, its script and the policy that allows these alone.

    Args:
        has_drawings: Whether the page holds drawings, which carry styles of their own.
    """
    allowed = policy(None if has_drawings else (css,), () if js is None else (js,))
    return page_environment().get_template(template).render(css=css, js=js, policy=allowed, **values)


def policy(styles: tuple[str, ...] | None, scripts: tuple[str, ...] = ()) -> str:
    """Return the content security policy of a page: these styles and scripts, images in the page itself, nothing else.

    What a goal, a model or a task's name smuggles in can neither run nor load anything, even where it is not escaped.

    Args:
        styles: Contents of the page's `style` elements, and of pages that it embeds: they inherit its policy. `None`
            for any in the page itself, where drawings carry their own.
        scripts: Contents of the page's `script` elements that run.
    """
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {_hashes(scripts)}",
            "style-src 'unsafe-inline'" if styles is None else f"style-src {_hashes(styles)}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def picture_uri(svg: str) -> str:
    """Return a picture as the source of an `img`, in the page itself."""
    return f"data:image/svg+xml;base64,{base64.b64encode(clean(svg).encode()).decode()}"


def rate_bar(value: float | None, interval: Interval | None) -> Markup:
    """Draw a rate of 0 to 1 with its interval, on a scale of 0 to 100%; nothing without a rate."""
    if value is None:
        return Markup("")
    low, high = interval or (value, value)
    return Markup(
        '<svg class="bar" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">'
        '<rect class="track" width="100" height="10"/><rect class="value" width="{:.2f}" height="10"/>'
        '<path class="whisker" d="M{:.2f} 5H{:.2f}M{:.2f} 2V8M{:.2f} 2V8"/></svg>'
    ).format(100 * value, 100 * low, 100 * high, 100 * low, 100 * high)


def packed(text: str) -> Markup:
    """Return text as zlib in base64: a part of a page that is unpacked when it is looked at (`report.js`)."""
    return Markup(base64.b64encode(zlib.compress(text.encode(), 6)).decode())  # noqa: S704 - letters and digits


def _hashes(texts: tuple[str, ...]) -> str:
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts)
    return " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
