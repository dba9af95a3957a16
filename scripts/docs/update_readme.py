"""Writes the headline table of a run into the README: `python scripts/docs/update_readme.py out/demo`."""

import sys
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"
BEGIN = "<!-- results: written by `make readme` from `make demo` -->\n"
END = "<!-- end of results -->"


def headline(run: Path) -> str:
    """The first table of a run's `table.md`, without its heading."""
    return (run / "table.md").read_text(encoding="utf-8").split("\n\n")[1] + "\n"


def readme_results() -> str:
    """What the README says between its marks."""
    return README.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]


def main() -> None:
    """Renews the README."""
    before, _, rest = README.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    README.write_text(before + BEGIN + headline(Path(sys.argv[1])) + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
