from .prompts import Picture, Prompt
from .query import QueryLogEntry, QuerySession
from .question import AnswerError, ClosedQuestion, DecisionModel, Question, Reply, YesNoQuestion, first_line
from .text.matcher import Matcher

__all__ = [
    "AnswerError",
    "ClosedQuestion",
    "DecisionModel",
    "Matcher",
    "Picture",
    "Prompt",
    "QueryLogEntry",
    "QuerySession",
    "Question",
    "Reply",
    "YesNoQuestion",
    "first_line",
]
