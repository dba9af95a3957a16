"""Agents that differ from evonav's own in one option."""

from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.msgnav.agent import MsgNav, MsgNavConfig, navigator_config
from evonav.agents.navigator import NavigatorConfig
from evonav.agents.proactive.agent import Proactive
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.three_d_mem.agent import ThreeDMem, ThreeDMemConfig
from evonav.agents.unigoal.agent import UniGoal, UniGoalConfig
from evonav.agents.unigoal.graphs import GraphConfig
from evonav.decision.question import DecisionModel


class ThreeDMemPlus(ThreeDMem):
    """3D-Mem with our fallback for frontiers, which its released code lacks."""

    def __init__(self, config: ThreeDMemConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ThreeDMemConfig(navigator=NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS)), decision)


class MsgNavPlus(MsgNav):
    """MSGNav with our fallback for frontiers, which its released code lacks."""

    def __init__(self, config: MsgNavConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or MsgNavConfig(navigator=navigator_config(AS_THREE_D_MEM_PLUS)), decision)


class UniGoalAsPublished(UniGoal):
    """UniGoal as published: captions are compared without numbers, and all mapped categories may be goals."""

    def __init__(self, config: UniGoalConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or UniGoalConfig(graph=GraphConfig(mode="paper")), decision)


class ProactiveBlind(Proactive):
    """Belief-Weighted Search that knows nothing of how homes change."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ProactiveConfig(prior="blind"), decision)


class ProactiveOracleTheta(Proactive):
    """Belief-Weighted Search that knows by which probabilities homes change, not what changed."""

    def __init__(self, config: ProactiveConfig | None = None, decision: DecisionModel | None = None) -> None:
        super().__init__(config or ProactiveConfig(prior="oracle-theta"), decision)
