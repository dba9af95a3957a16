"""Rules that decide what an object map forgets, each from a published system."""

from evonav.memory.forgetting.bayes import Bayes
from evonav.memory.forgetting.one_view import FailedLook, LastWins, Never, Reset
from evonav.memory.forgetting.points import SeeThrough, ShareDeleted
from evonav.memory.forgetting.registry import RULES, check_name, make
from evonav.memory.forgetting.rule import ForgettingRule
from evonav.memory.forgetting.votes import RayVotes, StatusWindow

__all__ = [
    "RULES",
    "Bayes",
    "FailedLook",
    "ForgettingRule",
    "LastWins",
    "Never",
    "RayVotes",
    "Reset",
    "SeeThrough",
    "ShareDeleted",
    "StatusWindow",
    "check_name",
    "make",
]
