from .agent import (
    Agent,
    AgentAction,
    EntryBelief,
    Move,
    NavigateTo,
    SensorConfig,
    Stop,
    ViewSchedule,
)
from .explanation import Explanation, FrontierBelief, MapBelief
from .registry import agent_descriptions, agent_factory

__all__ = [
    "Agent",
    "AgentAction",
    "EntryBelief",
    "Explanation",
    "FrontierBelief",
    "MapBelief",
    "Move",
    "NavigateTo",
    "SensorConfig",
    "Stop",
    "ViewSchedule",
    "agent_descriptions",
    "agent_factory",
]
