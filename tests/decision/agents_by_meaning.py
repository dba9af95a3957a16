"""Agents that rank what they remember by meaning."""

from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig, StageReset, StageResetConfig
from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig


def fu(decision=None):
    return FrontierUpdate(FrontierUpdateConfig(ranking="text"), decision)


def ftu(decision=None):
    return FailThenUpdate(FailThenUpdateConfig(ranking="text"), decision)


def stage_reset(decision=None):
    return StageReset(StageResetConfig(ranking="text"), decision)
