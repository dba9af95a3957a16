"""Tables fit the terminal, whatever its width."""

import pytest

from evonav.cli.display import counted_as, in_parts, show_tables
from evonav.report.tables.table import Table

WIDE = Table(
    "A wide table",
    ("agent", "", *(f"column {number}" for number in range(8))),
    tuple((agent, kind, *["12.3 [10.1, 14.5]"] * 8) for agent in ("fu", "ftu") for kind in ("recall", "precision")),
    notes=("A note of a whole sentence, which is not repeated, and not as narrow as the last part of the table.",),
    best=frozenset({(0, 9)}),
)


@pytest.mark.parametrize("width", [40, 80, 120, 300])
def test_a_wide_table_is_printed_in_parts_that_fit(monkeypatch, capsys, width):
    monkeypatch.setenv("COLUMNS", str(width))
    show_tables([WIDE])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= width
    assert sum(line.count("12.3 [10.1, 14.5]") for line in lines) == 32
    assert " ".join(" ".join(lines).split()).count("A note of a whole") == 1
    parts = in_parts(WIDE, width)
    assert len(parts) == {40: 8, 80: 4, 120: 2, 300: 1}[width]
    assert all(part.columns[:2] == ("agent", "") for part in parts)
    assert [name for part in parts for name in part.columns[2:]] == list(WIDE.columns[2:])
    assert parts[-1].best == {(0, len(parts[-1].columns) - 1)}


def test_numbers_have_their_noun():
    assert (counted_as(1, "agent"), counted_as(0, "agent"), counted_as(2, "agent")) == (
        "1 agent",
        "0 agents",
        "2 agents",
    )


def test_no_bracket_is_swallowed(capsys):
    show_tables([Table("evonav[viz]", ("an [agent]",), (("[bold]",),), ("[dim]",))])
    printed = capsys.readouterr().out
    assert all(text in printed for text in ("evonav[viz]", "an [agent]", "[bold]", "[dim]"))
