"""Errors between a question and its answer."""

from typing import Literal

from evonav.errors import DecisionError

VlmFailure = Literal[
    "refusal",
    "truncated",
    "empty",
    "malformed",
    "oversized",
    "unusable",
    "rate_limited",
    "server",
    "timeout",
    "connection",
    "unauthorized",
    "bad_request",
    "not_recorded",
    "over_budget",
]
"""Kinds of failures. `unusable`: an answer that the asking program rejects; `not_recorded`: a replay lacks it."""


LASTING: frozenset[VlmFailure] = frozenset({"unauthorized", "bad_request", "not_recorded", "over_budget"})
"""Failures that the next question would meet as well."""


class VlmError(DecisionError):
    """A model gave no usable answer."""

    def __init__(self, kind: VlmFailure, message: str) -> None:
        super().__init__(f"{kind}: {message}")
        self.kind: VlmFailure = kind
        self.message = message
