"""Our own SVG drawings as files: as they are, or as PNG and PDF for papers and slides (extra `viz`)."""

from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from evonav.errors import InvalidArgumentError, StoreError
from evonav.parallel.folders import write_atomically

SUFFIXES = (".svg", ".png", ".pdf")
ZOOM = 3
"""Dots of a PNG or PDF to a unit of the drawing, 96 of which are an inch."""


def check_picture(path: Path) -> None:
    """Whether a picture could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: What draws it is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidArgumentError(f"argument `path` is {str(path)!r}, expected a file {', '.join(SUFFIXES)}")
    if suffix != ".svg":
        _resvg()


def write_picture(svg: str, path: Path) -> Path:
    """Writes a drawing; a PDF is a page as large as the drawing that holds it at 288 dots an inch.

    Args:
        svg: The drawing, whole.
        path: `.svg`, `.png` or `.pdf` file; folders are made.

    Returns:
        `path`.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: What draws it is not installed, or the file cannot be written.
    """
    check_picture(path)
    suffix = path.suffix.lower()
    data = svg.encode() if suffix == ".svg" else _png(svg)
    if suffix == ".pdf":
        buffer = BytesIO()
        with Image.open(BytesIO(data)) as picture:
            picture.convert("RGB").save(buffer, "PDF", resolution=96.0 * ZOOM, quality=95)
        data = buffer.getvalue()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    write_atomically(path, data)
    return path


def _png(svg: str) -> bytes:
    fonts: dict[str, Any] = {}
    if (plots := find_spec("matplotlib")) is not None and plots.origin is not None:
        # Where the machine has no fonts, or not those that resvg takes for the usual ones, words would be missing.
        fonts = {
            "font_dirs": [str(Path(plots.origin).parent / "mpl-data" / "fonts" / "ttf")],
            **dict.fromkeys(("font_family", "serif_family", "sans_serif_family"), "DejaVu Sans"),
            "monospace_family": "DejaVu Sans Mono",
        }
    return bytes(_resvg().svg_to_bytes(svg_string=svg, zoom=ZOOM, background="#ffffff", **fonts))


def _resvg() -> Any:  # noqa: ANN401 - resvg is not there for the type checker
    try:
        import resvg_py
    except ImportError as error:
        raise StoreError(f"pictures as PNG and PDF need resvg ({error}): pip install 'evonav[viz]'") from error
    return resvg_py
