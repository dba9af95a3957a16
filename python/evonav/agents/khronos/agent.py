"""Frontier-Update that hides objects of which rays say that they are gone: Khronos (Schmid et al., RSS 2024)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from evonav.agents.agent import EntryBelief
from evonav.agents.explanation import entry_belief
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.khronos.votes import KhronosVotes, VotesConfig
from evonav.agents.navigator import Navigator
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.sensors.observation import Observation


@dataclass(frozen=True, slots=True)
class KhronosConfig(FrontierUpdateConfig):
    """Frontier-Update's values, and Khronos' constants."""

    votes: VotesConfig = field(default_factory=VotesConfig)


class KhronosFrontierUpdate(FrontierUpdate):
    """Keeps an object that is voted absent with its dates, and believes in it again when it is detected again."""

    def __init__(self, config: KhronosConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._own = config or KhronosConfig()
        super().__init__(self._own, decision)

    def _new_navigator(self) -> Navigator:
        navigator = super()._new_navigator()
        self._votes = KhronosVotes(self._own.votes)
        navigator.observers.append(self._votes.see)
        return navigator

    def _after_look(self, observation: Observation) -> None:
        navigator = self._navigator
        self._votes.end_round(navigator.objects)
        if navigator.target is not None and self._votes.is_absent(navigator.target.entry_id):
            self._counters["absent_targets"] += 1
            navigator.target = None

    def _believed(self) -> Sequence[ObjectEntry]:
        return [entry for entry in super()._believed() if not self._votes.is_absent(entry.id)]

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the object memory, without what is absent now."""
        return [entry_belief(entry) for entry in self._believed()]

    def _round_counters(self) -> Mapping[str, int]:
        return {"absent_targets": 0, **super()._round_counters()}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        entry_ids = [entry.id for entry in self._navigator.objects.entries]
        dates = {"disappeared": self._votes.disappeared, "appeared": self._votes.appeared}
        found = {
            name: {str(one): date for one in entry_ids if (date := date_of(one)) is not None}
            for name, date_of in dates.items()
        }
        return {**super()._round_details(reason), **{name: those for name, those in found.items() if those}}
