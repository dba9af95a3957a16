"""Provide the colours and fonts of maps, light and dark, as CSS, and the SVG files that have them."""

import re
from importlib.resources import files

from markupsafe import Markup

from evonav.drawing.svg import escape


def map_css() -> Markup:
    """Return the style of maps on a page: custom properties, light and dark, then rules."""
    text = (files("evonav.drawing") / "map.css").read_text(encoding="utf-8")
    return Markup(text)  # noqa: S704 - our own file


def file_css(more: str = "") -> str:
    """Return the style of a file of its own: colours written out, since few programs know custom properties.

    Args:
        more: Further rules.
    """
    _, dark, rules = str(map_css()).split("/* --- */")
    return f"{light_css(more)}@media (prefers-color-scheme:dark){{{_inlined(rules + more, dark)}}}"


def light_css(more: str = "") -> str:
    """Return the colours of a light page written out, with further rules that may have custom properties, too."""
    light, _, rules = str(map_css()).split("/* --- */")
    return _inlined(rules + more, light + more)


def map_file(
    title: str, size_px: tuple[int, int], content: str, *, view_box: str = "", description: str = "", more_css: str = ""
) -> str:
    """Return a drawing as an SVG file of its own; `view_box` is the part that is shown, by default a unit a pixel."""
    width_px, height_px = size_px
    said = f"<desc>{escape(description)}</desc>" if description else ""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="{view_box or f"0 0 {width_px} {height_px}"}" '
        f'width="{width_px}" height="{height_px}" role="img"><title>{escape(title)}</title>{said}'
        f"<style>{file_css(more_css)}</style>{content}</svg>\n"
    )


def _inlined(rules: str, properties: str) -> str:
    """Return rules with every `var(--name)` replaced by its value."""
    values = dict(re.findall(r"--(\w+):(#\w+)", properties))
    return re.sub(r"var\(--(\w+)\)", lambda match: values[match[1]], rules)
