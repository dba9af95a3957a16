"""Agents that differ from evonav's own in one option."""

from functools import partial

from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.msgnav.agent import MsgNav, MsgNavConfig, navigator_config
from evonav.agents.navigator import WITH_FALLBACK
from evonav.agents.proactive.agent import Proactive
from evonav.agents.proactive.config import ChangePrior, ProactiveConfig
from evonav.agents.three_d_mem.agent import ThreeDMem, ThreeDMemConfig
from evonav.agents.unigoal.agent import UniGoal, UniGoalConfig
from evonav.agents.unigoal.graphs import GraphConfig

BLIND = ChangePrior(change=0.5, modes=(0.5, 0.5), moved=(0.25, 0.75), knows_rooms=False)
"""Knows nothing of the benchmark: the mean of Beta(1, 1), few or most objects move, all rooms alike."""
ORACLE_THETA = ChangePrior(
    change=0.5,
    modes=(0.5, 0.4, 0.1),
    moved=(0.26, 0.85, 0.87),
    visited_weight=3.0,
    repeated_weight=0.5,
    same_room=0.99,
)
"""Constants by which tasks are generated (paper, Tab. 5), and shares of objects that move.

The shares are those of docs/studies/task-statistics.md.
"""

three_d_mem_plus = partial(ThreeDMem, ThreeDMemConfig(navigator=WITH_FALLBACK))
"""3D-Mem with our fallback for frontiers, which its released code lacks."""
msgnav_plus = partial(MsgNav, MsgNavConfig(navigator=navigator_config(AS_THREE_D_MEM_PLUS)))
"""MSGNav with the same fallback."""
unigoal_as_published = partial(UniGoal, UniGoalConfig(graph=GraphConfig(mode="paper")))
"""UniGoal as published: captions are compared without numbers, and all mapped categories may be goals."""
proactive_blind = partial(Proactive, ProactiveConfig(prior=BLIND))
"""Belief-Weighted Search that knows nothing of how homes change."""
proactive_oracle_theta = partial(Proactive, ProactiveConfig(prior=ORACLE_THETA))
"""Belief-Weighted Search that knows by which probabilities homes change, not what changed."""
