"""Drawings as PNG and PDF."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evonav.drawing.files import ZOOM, write_picture
from evonav.errors import InvalidArgumentError, StoreError

SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 20" width="40" height="20">'
    "<style>.a{fill:#cc0000}</style>"
    '<rect class="a" x="20" width="20" height="20"/><text x="1" y="14" font-size="14">ab</text></svg>'
)


def test_a_png_is_the_drawing(tmp_path: Path) -> None:
    pytest.importorskip("resvg_py", reason="resvg is not installed")
    with Image.open(write_picture(SVG, tmp_path / "new" / "x.png")) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape == (20 * ZOOM, 40 * ZOOM, 3)
    left, right = pixels[:, : 19 * ZOOM], pixels[:, 21 * ZOOM :]
    assert (right == (0xCC, 0, 0)).all()
    assert (left[0] == 255).all()
    assert 0.02 < (left < 128).any(axis=2).mean() < 0.6  # letters are drawn, on white


def test_a_pdf_is_one_page_of_vectors_in_the_drawings_size(tmp_path: Path) -> None:
    pytest.importorskip("typst", reason="typst is not installed")
    data = write_picture(SVG, tmp_path / "x.PDF").read_bytes()
    assert data.startswith(b"%PDF-")
    assert b"/Subtype/Image" not in data  # a picture's dictionary is never compressed
    assert write_picture(SVG, tmp_path / "y.pdf").read_bytes() == data
    (box,) = re.findall(rb"/MediaBox ?\[ ?([\d. ]+?) ?\]", data)
    # 96 units an inch in the drawing, 72 points an inch on the page.
    assert [float(value) for value in box.split()] == pytest.approx([0, 0, 40 * 0.75, 20 * 0.75])


def test_what_cannot_be_written_is_told_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidArgumentError, match=r"x\.jpg.*\.svg, \.png, \.pdf"):
        write_picture(SVG, tmp_path / "x.jpg")
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match=re.escape(str(tmp_path / "file" / "x.svg"))):
        write_picture(SVG, tmp_path / "file" / "x.svg")
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    monkeypatch.setitem(sys.modules, "typst", None)
    for suffix in ("png", "pdf"):
        with pytest.raises(StoreError, match=r"pip install 'evonav\[viz\]'"):
            write_picture(SVG, tmp_path / f"x.{suffix}")
    assert write_picture(SVG, tmp_path / "x.svg").read_text("utf-8") == SVG
