"""The simulated model's server, holding requests to OpenAI's published API."""

import base64
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Annotated, Any, Literal

from PIL import Image
from pydantic import BaseModel, ConfigDict, Field

from evonav.decision.vlm import mock_server as mock_vlm
from evonav.decision.vlm.mock_server import MockReply
from evonav.decision.vlm.mock_server import MockServer as Stub

KEY = "sk-test-0123456789abcdefghijklmnop"


class Closed(BaseModel):
    """The part of OpenAI's published API that is used; anything else is refused with 400."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class TextPart(Closed):
    type: Literal["text"]
    text: str = Field(min_length=1)


class ImageUrl(Closed):
    url: str
    detail: Literal["auto", "low", "high"] = "auto"


class ImagePart(Closed):
    type: Literal["image_url"]
    image_url: ImageUrl


class Message(Closed):
    role: Literal["system", "user", "assistant"]
    content: str | Annotated[list[TextPart | ImagePart], Field(min_length=1)]


class JsonSchema(Closed):
    name: str = Field(pattern="^[a-zA-Z0-9_-]{1,64}$")
    strict: bool = False
    content: dict[str, Any] = Field(alias="schema")


class ResponseFormat(Closed):
    type: Literal["json_schema"]
    json_schema: JsonSchema


class ChatRequest(Closed):
    model: str = Field(min_length=1)
    messages: list[Message] = Field(min_length=1)
    temperature: float = Field(1.0, ge=0.0, le=2.0)
    top_p: float = Field(1.0, ge=0.0, le=1.0)
    seed: int = 0
    max_tokens: int = Field(1, ge=1)
    max_completion_tokens: int = Field(1, ge=1)
    response_format: ResponseFormat | None = None


_STRICT_KEYWORDS = {
    "type", "properties", "required", "additionalProperties", "items", "enum", "const", "anyOf", "description", "title",
    "pattern", "format", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "multipleOf", "minItems",
    "maxItems",
}  # fmt: skip
"""What the documentation of structured outputs lists; other keywords of JSON Schema are refused."""


def check_strict(schema: dict[str, Any]) -> None:
    """Holds a schema to what strict mode takes: closed objects, all required, known keywords, few values."""
    unknown = schema.keys() - _STRICT_KEYWORDS
    assert not unknown, f"response_format: keywords {sorted(unknown)} are not supported"
    if schema.get("type") == "object":
        properties = schema["properties"]
        assert schema.get("additionalProperties") is False, "response_format: additionalProperties must be false"
        assert schema.get("required") == list(properties), "response_format: every property must be required"
        for part in properties.values():
            check_strict(part)
    if schema.get("type") == "array":
        check_strict(schema["items"])
    for part in schema.get("anyOf", []):
        check_strict(part)
    assert len(schema.get("enum", [])) <= 1000, "response_format: too many values"
    assert schema.get("enum") != [], "response_format: enum must not be empty"


def images_in(request: dict[str, Any]) -> list[Image.Image]:
    """Decoded, so that a broken image is an error."""
    images = []
    for message in request["messages"]:
        for part in message["content"] if isinstance(message["content"], list) else []:
            if part["type"] == "image_url":
                head, _, data = part["image_url"]["url"].partition(",")
                assert head == "data:image/png;base64", head
                image = Image.open(BytesIO(base64.b64decode(data, validate=True)))
                image.load()
                images.append(image)
    return images


def check_request(request: dict[str, Any]) -> None:
    """Raises unless a request is one that OpenAI's API would take."""
    ChatRequest.model_validate(request)
    images_in(request)
    if "response_format" in request:
        schema = request["response_format"]["json_schema"]
        assert not schema.get("strict") or schema["schema"]["type"] == "object"
        check_strict(schema["schema"])


@contextmanager
def serving(reply: Callable[[dict[str, Any]], MockReply]) -> Iterator[Stub]:
    """Serves `/v1/chat/completions`, and refuses what is not valid."""
    with mock_vlm.serving(Stub(reply, check_request)) as stub:
        yield stub
