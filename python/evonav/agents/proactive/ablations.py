"""Belief-Weighted Search without one of its parts, for the ablation in `examples/sweeps/proactive-ablation.toml`."""

from evonav.agents.proactive.agent import Proactive
from evonav.agents.proactive.config import ProactiveConfig
from evonav.decision.question import DecisionModel


def without_text(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `uses_text=False`: goal text as evidence of change."""
    return Proactive(ProactiveConfig(uses_text=False), decision)


def without_identity(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `checks_identity=False`: stops at other instances."""
    return Proactive(ProactiveConfig(checks_identity=False), decision)


def without_see_through(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `sees_through=False`: evidence on the way."""
    return Proactive(ProactiveConfig(sees_through=False), decision)


def without_rooms(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `uses_rooms=False`: evidence shared inside a room."""
    return Proactive(ProactiveConfig(uses_rooms=False), decision)


def without_explaining_away(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `explains_away=False`: trust restored elsewhere."""
    return Proactive(ProactiveConfig(explains_away=False), decision)


def without_in_room_mass(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `searches_rooms=False`: the room outlives the pose."""
    return Proactive(ProactiveConfig(searches_rooms=False), decision)


def without_hazard(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `expects_change=False`: doubt before evidence."""
    return Proactive(ProactiveConfig(expects_change=False), decision)


def without_anchors(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `uses_anchors=False`: search near what the text names."""
    return Proactive(ProactiveConfig(uses_anchors=False), decision)


def without_room_prior(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `weighs_rooms=False`: exploration by type of room."""
    return Proactive(ProactiveConfig(weighs_rooms=False), decision)


def without_sectors(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `gates_sectors=False`: calibration."""
    return Proactive(ProactiveConfig(gates_sectors=False), decision)


def without_reserve(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `keeps_reserve=False`: stages that run out of rounds."""
    return Proactive(ProactiveConfig(keeps_reserve=False), decision)


def without_hysteresis(decision: DecisionModel | None = None) -> Proactive:
    """Make the agent with `keeps_choice=False`: ways back and forth."""
    return Proactive(ProactiveConfig(keeps_choice=False), decision)
