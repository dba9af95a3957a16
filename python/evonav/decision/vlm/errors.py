"""What can go wrong between a question and its answer."""

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
"""`unusable` is an answer that the asker cannot use though it is one; `not_recorded` a question that a replay lacks."""


LASTING: frozenset[VlmFailure] = frozenset({"unauthorized", "bad_request", "not_recorded", "over_budget"})
"""The next question would meet them as well."""


class VlmError(DecisionError):
    """A model gave no usable answer."""

    def __init__(self, kind: VlmFailure, message: str) -> None:
        super().__init__(f"{kind}: {message}")
        self.kind: VlmFailure = kind
        self.message = message
