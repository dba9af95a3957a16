"""Agents that rank what they remember by meaning."""

from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.frontier_update.stage_reset import StageReset, StageResetConfig


def fu(decision=None):
    return FrontierUpdate(FrontierUpdateConfig(ranking="text"), decision)


def ftu(decision=None):
    return FailThenUpdate(FailThenUpdateConfig(ranking="text"), decision)


def stage_reset(decision=None):
    return StageReset(StageResetConfig(ranking="text"), decision)
