"""Belief-Weighted Search with other expectations of changes."""

from evonav.agents.proactive.agent import Proactive
from evonav.agents.proactive.config import ProactiveConfig
from evonav.decision.question import DecisionModel


class ProactiveBlind(Proactive):
    """Belief-Weighted Search that knows nothing of how homes change."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ProactiveConfig(prior="blind"), decision)


class ProactiveOracleTheta(Proactive):
    """Belief-Weighted Search that knows by which probabilities homes change, not what changed."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ProactiveConfig(prior="oracle-theta"), decision)
