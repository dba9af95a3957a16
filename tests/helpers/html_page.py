"""Read an HTML page for tests: its elements must nest, and its ids must differ."""

from html.parser import HTMLParser
from pathlib import Path

Attributes = dict[str, str | None]
VOID = {"meta", "input", "br", "link", "img"}


class HtmlPage(HTMLParser):
    """A page's elements, ids, addresses and text."""

    def __init__(self, page: Path | str) -> None:
        super().__init__()
        self._open: list[str] = []
        self.elements: list[tuple[str, Attributes]] = []
        self.texts: list[str] = []
        self.feed(page if isinstance(page, str) else page.read_text(encoding="utf-8"))
        self.close()
        assert self._open == []
        self.ids = self.values("id")
        assert len(self.ids) == len(set(self.ids))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(attrs) == len(dict(attrs)), (tag, attrs)
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def count(self, tag: str, css: str) -> int:
        return len(self.all(tag, css))

    def all(self, tag: str, css: str) -> list[Attributes]:
        return [attrs for name, attrs in self.elements if name == tag and css in (attrs.get("class") or "").split()]

    def values(self, *names: str) -> list[str]:
        """Values of attributes of these names, in order; empty ones are left out."""
        return [value for _, attrs in self.elements for name in names if (value := attrs.get(name))]
