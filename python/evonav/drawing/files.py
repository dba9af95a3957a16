"""Write SVG drawings as files: as they are, or as PNG and PDF for papers and slides (extra `viz`)."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from evonav.component import optional_module
from evonav.errors import InvalidArgumentError
from evonav.parallel.folders import write_atomically

SUFFIXES = (".svg", ".png", ".pdf")
ZOOM = 3
"""Dots of a PNG to a unit of the drawing, 96 of which are an inch."""
FONT = "DejaVu Sans"
"""A font that matplotlib brings along, for machines without the usual ones."""
_PAGE = b"""#set document(date: none)
#set page(width: auto, height: auto, margin: 0pt)
#image(bytes(sys.inputs.svg), format: "svg")
"""
"""A page as large as the drawing on it, in typst's language."""


def check_picture(path: Path) -> None:
    """Check that a picture could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: The library for its format is not installed.
    """
    suffix = check_suffix(path, *SUFFIXES)
    if suffix == ".png":
        resvg()
    elif suffix == ".pdf":
        _typst()


def check_suffix(path: Path, *suffixes: str) -> str:
    """Return a file's suffix in small letters.

    Raises:
        InvalidArgumentError: It is none of `suffixes`.
    """
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise InvalidArgumentError(f"argument `path` is {str(path)!r}, expected a file {', '.join(suffixes)}")
    return suffix


def write_picture(svg: str, path: Path) -> Path:
    """Write a drawing; a PDF is one page as large as the drawing, with lines and text as vectors.

    Args:
        svg: The drawing, as an SVG document.
        path: `.svg`, `.png` or `.pdf` file; folders are made.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: The library for its format is not installed, or the file cannot be written.
    """
    check_picture(path)
    suffix = path.suffix.lower()
    data = svg.encode() if suffix == ".svg" else png_of(svg, zoom=ZOOM) if suffix == ".png" else _pdf(svg)
    return write_atomically(path, data)


def png_of(svg: str, *, zoom: float = 1.0, background: str | None = "#ffffff", has_system_fonts: bool = True) -> bytes:
    """Return a drawing as a PNG.

    Args:
        svg: The drawing, as an SVG document.
        zoom: Dots to a unit of the drawing.
        background: Colour below the drawing; `None`: transparent.
        has_system_fonts: Whether to look for the machine's fonts too, which may take longer than the drawing.

    Raises:
        StoreError: resvg is not installed.
    """
    folders = _font_folders()
    families = dict.fromkeys(("font_family", "serif_family", "sans_serif_family"), FONT)
    fonts: dict[str, Any] = {"font_dirs": folders, **families} if folders else {}
    # Without a folder of our own, the machine's fonts are the only ones.
    skips_system = bool(folders) and not has_system_fonts
    draw = resvg().svg_to_bytes
    return bytes(draw(svg_string=svg, zoom=zoom, background=background, skip_system_fonts=skips_system, **fonts))


def _pdf(svg: str) -> bytes:
    # Without a date, the same drawing is the same file.
    return bytes(_typst().compile(_PAGE, format="pdf", sys_inputs={"svg": svg}, font_paths=_font_folders()))


def _font_folders() -> list[str]:
    """Return the folder of matplotlib's fonts, where it is installed."""
    plots = find_spec("matplotlib")
    if plots is None or plots.origin is None:
        return []
    return [str(Path(plots.origin).parent / "mpl-data" / "fonts" / "ttf")]


def resvg() -> Any:  # noqa: ANN401 - a module
    """Return the library that converts drawings to PNG.

    Raises:
        StoreError: It is not installed.
    """
    return optional_module("resvg_py", "pictures as PNG need resvg", "'evonav[viz]'")


def _typst() -> Any:  # noqa: ANN401 - a module
    return optional_module("typst", "pictures as PDF need typst", "'evonav[viz]'")
