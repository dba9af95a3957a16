"""Questions that an agent's process sends to the evaluator, which asks the model."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, Turn
from evonav.decision.vlm.relay import Known, read_request, request_bytes
from evonav.errors import InvalidArgumentError

DRAWS = np.random.default_rng(0)
NARROW, WIDE = (Picture(DRAWS.integers(0, 256, shape, np.uint8)) for shape in ((5, 2, 3), (3, 9, 3)))


def jpeg_of(pixels: np.ndarray) -> bytes:
    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=90)
    return buffer.getvalue()


FILE = Picture(jpeg_of(DRAWS.integers(0, 256, (30, 40, 3), np.uint8)))
PLAIN = Prompt((Turn("system", ("Be brief.",)), Turn("user", (NARROW, "or", FILE, WIDE, NARROW))))
AS_JSON = Prompt((*PLAIN.turns, Turn("user", (WIDE, "as JSON", FILE))), {"type": "object"})
MESSAGE = request_bytes((AS_JSON, PLAIN), 3, 1)


def parts_of(prompt: Prompt) -> list[tuple[str, list[str]]]:
    return [(turn.role, [part if isinstance(part, str) else part.name for part in turn.parts]) for turn in prompt.turns]


def test_a_request_is_read_as_it_was_asked_and_holds_each_image_once() -> None:
    prompts, attempt, otherwise = read_request(MESSAGE)
    assert (attempt, otherwise) == (3, 1)
    assert [parts_of(prompt) for prompt in prompts] == [parts_of(AS_JSON), parts_of(PLAIN)]
    assert [prompt.schema for prompt in prompts] == [{"type": "object"}, None]
    for picture in (NARROW, WIDE):
        assert MESSAGE.count(picture.pixels.tobytes()) == 1
    ends = MESSAGE.index(b"\n")
    assert MESSAGE.count(FILE.source) == 1
    assert len(MESSAGE) - ends - 1 == NARROW.pixels.size + WIDE.pixels.size + len(FILE.source)


def test_a_file_is_the_picture_of_its_pixels() -> None:
    pixels = np.asarray(Image.open(BytesIO(FILE.source)).convert("RGB"))
    assert np.array_equal(FILE.pixels, pixels)
    assert (FILE.size_px, FILE.name, FILE.data_url) == ((40, 30), Picture(pixels).name, Picture(pixels).data_url)


def test_pictures_of_the_last_question_that_shows_any_are_known_to_the_next() -> None:
    known: Known = {}
    first, *_ = read_request(MESSAGE, known)
    read_request(request_bytes((Prompt.of("no picture"),), 0, 0), known)
    ((second,), *_) = read_request(request_bytes((Prompt.of(FILE, Picture(WIDE.pixels[::-1]), NARROW),), 0, 0), known)
    by_name = {picture.name: picture for prompt in first for picture in prompt.pictures}
    assert [by_name.get(picture.name) is picture for picture in second.pictures] == [True, False, True]
    assert set(known.values()) == set(second.pictures)


def test_an_image_has_the_name_of_its_shape_and_values() -> None:
    """Cached answers of earlier versions are found by it."""
    assert (
        Picture(np.arange(18, dtype=np.uint8).reshape(2, 3, 3)).name
        == "sha256:94a5bd13d7c5730ed5f8823b6732195951913e631b969b1bae95f7b37c6f03fb"
    )


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        (b'"attempt":3', b'"attempt":-1', "attempt = -1: Input should be greater than or equal to 0"),
        (b'"otherwise":1', b'"otherwise":2', "otherwise = 2: of 2 prompts"),
        (b"[5,2]", b"[5,3]", f"images: expected {126 + len(FILE.source)} bytes, got {111 + len(FILE.source)}"),
        (b"[5,2]", b"[0,2]", "images.0.0 = 0: Input should be greater than or equal to 1"),
        (b'[0,"or",', b'[3,"or",', "parts: image 3 of 3"),
        (b'[0,"or",', b'[-1,"or",', "parts: image -1 of 3"),
        (b"\xff\xd8\xff", b"\xff\xd7\xff", "jpeg: no image"),
        (b'["user"', b'["evaluator"', "prompts.0.0.1.0 = 'evaluator': Input should be"),
        (b"\n", b"", "Invalid JSON"),
    ],
)
def test_a_malformed_request_is_one_error(old: bytes, new: bytes, error: str) -> None:
    message = MESSAGE.replace(old, new, 1)
    assert message != MESSAGE
    with pytest.raises(InvalidArgumentError) as raised:
        read_request(message)
    assert error in str(raised.value)
