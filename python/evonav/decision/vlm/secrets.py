"""Remove secrets from texts of others, such as a server that quotes the request's headers, in whatever form."""

import base64
import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

MIN_SECRET_CHARACTERS = 8
"""Shortest secret that is removed: local servers have keys such as `x`, a common letter in answers."""
MIN_PART_CHARACTERS = 12
"""Shortest beginning of a secret that is removed, as where a server cuts a text."""
REMOVED = "***"
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&apos;"}
_PERCENT = r"%(?:25)*"
_BACKSLASH = rf"(?:\\|{_PERCENT}5c)"
_BREAK = rf"(?:\s|{_BACKSLASH}+[rnt]|{_PERCENT}(?:09|0a|0d|20))*"
"""White space between two characters, also as an escape: long lines are wrapped."""


def without_secrets(text: str, secrets: Iterable[str]) -> str:
    """Return a text without secrets.

    They are found as they are, with any characters escaped as in JSON, URLs or HTML, in hexadecimal digits, in base64
    alone or within more, in any case, wrapped or cut at their end.

    Args:
        secrets: The secrets; those shorter than `MIN_SECRET_CHARACTERS` stay.
    """
    for secret in secrets:
        if len(secret) >= MIN_SECRET_CHARACTERS:
            for start, others in _forms(secret):
                text = _without(text, start, others)
    return text


def _without(text: str, start: re.Pattern[str], others: Sequence[re.Pattern[str]]) -> str:
    """Return a text without what begins with a pattern, and goes on with as many of the others as follow."""
    parts, end = [], 0
    while found := start.search(text, end):
        parts.append(text[end : found.start()])
        end = found.end()
        for other in others:
            following = other.match(text, end)
            if following is None:
                break
            end = following.end()
    return REMOVED.join([*parts, text[end:]])


@lru_cache(maxsize=64)
def _forms(secret: str) -> list[tuple[re.Pattern[str], list[re.Pattern[str]]]]:
    """Return patterns of a secret in all forms of writing: of its beginning, and of each character that follows."""
    data = secret.encode()
    texts = {secret, data.hex()}
    for num_before in range(3):  # base64 writes 3 bytes as 4 characters, so it depends on where the secret begins
        for encode in (base64.b64encode, base64.urlsafe_b64encode):
            text = encode(b"\0" * num_before + data).decode().rstrip("=")
            # Its first and last characters depend on what is before and behind.
            texts.add(text[-(-8 * num_before // 6) :][: (8 * len(data) - (-8 * num_before % 6)) // 6])
    forms = []
    for text in sorted(texts, key=len):
        start = _BREAK.join(map(_escaped, text[:MIN_PART_CHARACTERS]))
        others = [re.compile(_BREAK + _escaped(one), re.IGNORECASE) for one in text[MIN_PART_CHARACTERS:]]
        forms.append((re.compile(start, re.IGNORECASE), others))
    return forms


def _escaped(character: str) -> str:
    """Return a pattern of a character in any way of writing it; longer ones first, as `&amp;` before `&`."""
    code = ord(character)
    forms = [rf"&#0*{code};", rf"&#x0*{code:x};", rf"{_BACKSLASH}+[ux]0*{code:x}"]
    if character in _ENTITIES:
        forms.append(_ENTITIES[character])
    forms.append(f"{_BACKSLASH}*" + "".join(f"{_PERCENT}{byte:02x}" for byte in character.encode()))
    return f"(?:{'|'.join(forms)}|{_BACKSLASH}*{re.escape(character)})"
