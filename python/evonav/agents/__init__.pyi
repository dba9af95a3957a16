from .agent import (
    Agent,
    AgentAction,
    Belief,
    EntryBelief,
    ExplainingAgent,
    FrontierBelief,
    InspectableAgent,
    Move,
    NavigateTo,
    RoundDiagnostics,
    SensorConfig,
    Stop,
    ViewSchedule,
)
from .explanation import Explanation
from .registry import agent_descriptions, agent_factory

__all__ = [
    "Agent",
    "AgentAction",
    "Belief",
    "EntryBelief",
    "ExplainingAgent",
    "Explanation",
    "FrontierBelief",
    "InspectableAgent",
    "Move",
    "NavigateTo",
    "RoundDiagnostics",
    "SensorConfig",
    "Stop",
    "ViewSchedule",
    "agent_descriptions",
    "agent_factory",
]
