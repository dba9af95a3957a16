"""Tables fit the terminal, whatever its width."""

import pytest

from evonav.cli.display import in_parts, show_tables
from evonav.counted import counted
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
    assert len(parts) == {40: 8, 80: 3, 120: 1, 300: 1}[width]
    if width == 120:  # all rows side by side
        (turned,) = parts
        assert turned.columns == ("", "fu recall", "fu precision", "ftu recall", "ftu precision")
        assert [row[0] for row in turned.rows] == list(WIDE.columns[2:])
        assert turned.best == {(7, 1)}
        return
    assert all(part.columns[:2] == ("agent", "") for part in parts)
    assert [name for part in parts for name in part.columns[2:]] == list(WIDE.columns[2:])
    assert parts[-1].best == {(0, len(parts[-1].columns) - 1)}


def test_every_part_tells_the_rows_apart():
    rows = tuple(
        (agent, decision, seed, *["12.3"] * 9) for agent in ("fu", "ftu") for decision in "xy" for seed in "01"
    )
    columns = ("Agent", "decision", "seed", *(f"column {number}" for number in range(9)))
    parts = in_parts(Table("Cells", columns, rows), 50)
    assert len(parts) > 1
    assert all([row[:3] for row in part.rows] == [row[:3] for row in rows] for part in parts)
    same = Table("Same", columns, (rows[0], rows[0]))
    assert all(part.columns[0] == "Agent" != part.columns[1] != "decision" for part in in_parts(same, 30)[1:])


def test_numbers_have_their_noun():
    shown = [counted(1, "house"), counted(0, "house"), counted(2, "entry"), counted(1000, "day")]
    assert shown == ["1 house", "0 houses", "2 entries", "1,000 days"]


def test_no_bracket_is_swallowed(capsys):
    show_tables([Table("evonav[viz]", ("an [agent]",), (("[bold]",),), ("[dim]",))])
    printed = capsys.readouterr().out
    assert all(text in printed for text in ("evonav[viz]", "an [agent]", "[bold]", "[dim]"))
