"""Agents that depart from the originals in one point each, for docs/studies/departures.md.

evonav evaluate --agent msgnav,scripts/studies/departing_agents.py:msgnav_looking_on_arrival --tasks TASKS --out out/run
"""

from evonav.agents.msgnav.agent import MsgNav, MsgNavConfig
from evonav.agents.unigoal.agent import UniGoal, UniGoalConfig
from evonav.agents.unigoal.graphs import GraphConfig
from evonav.decision.question import DecisionModel


def msgnav_looking_on_arrival(decision: DecisionModel | None = None) -> MsgNav:
    """Return a MSGNav that verifies with what it sees from the place where it arrived, too."""
    return MsgNav(MsgNavConfig(looks_on_arrival=True), decision)


def unigoal_that_may_decline(decision: DecisionModel | None = None) -> UniGoal:
    """Return a UniGoal that goes to no object if none of its six categories is the goal's."""
    return UniGoal(UniGoalConfig(graph=GraphConfig(may_decline=True)), decision)
