"""Check that the elements of an HTML page are nested correctly."""

from html.parser import HTMLParser

VOID = {"meta", "input", "br", "link", "img"}


class _Nesting(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), (tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, tag


def check_html(text: str) -> None:
    """Check that every element is closed in order."""
    parser = _Nesting()
    parser.feed(text)
    parser.close()
    assert parser.open == []
