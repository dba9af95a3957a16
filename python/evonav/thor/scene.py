"""The scene that actions read and change: a ProcTHOR house, and the simulator of it as it now is."""

import copy
import json
from itertools import count
from typing import Any

from evonav.thor.actions.registry import ActionError
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

Document = dict[str, Any]
"""A house as JSON."""

_versions = count(1)


class Scene:
    """One house. After `begin_edit` it may be changed; the next use of `simulator` builds that anew."""

    def __init__(self, name: str = "Procedural") -> None:
        self.name = name
        self.house: Document | None = None
        self.config = SimulatorConfig()
        self.version = next(_versions)
        """Another after every change, and in every scene; what is derived from the house is kept under it."""
        self.disabled: dict[str, Document] = {}
        """Objects that were taken out, by id."""
        self._simulator: EmbeddedSimulator | None = None

    def load(self, house: Document) -> None:
        """Replaces the house.

        Raises:
            HouseError: It is malformed; the house at hand stays.
        """
        simulator = self._built(house)
        self.house, self._simulator, self.disabled = house, simulator, {}
        self.version = next(_versions)

    def begin_edit(self) -> Document:
        """The house, to be changed in place."""
        if self.house is None:
            raise ActionError(f"scene {self.name} holds no house: call CreateHouse first")
        self._simulator = None
        self.version = next(_versions)
        return self.house

    def apply(self, delta_json: str) -> None:
        """Moves objects as a `HouseDelta` says; only they are built again."""
        # Another simulator: what was derived from this one is known by it.
        simulator = copy.copy(self.simulator)
        simulator.apply(delta_json)
        self.begin_edit()
        self.house, self._simulator = json.loads(simulator.house_json), simulator

    def note_relations(self) -> None:
        """Says that what stands on what in the house has changed, and nothing that the simulator shows."""
        self.version = next(_versions)

    def configure(self, config: SimulatorConfig) -> None:
        """Sets the agent's camera and body."""
        if config != self.config:
            self.config, self._simulator = config, None
            self.version = next(_versions)

    @property
    def simulator(self) -> EmbeddedSimulator:
        """Of the house as it now is."""
        if self.house is None:
            raise ActionError(f"scene {self.name} holds no house: call CreateHouse first")
        if self._simulator is None:
            self._simulator = self._built(self.house)
        return self._simulator

    def _built(self, house: Document) -> EmbeddedSimulator:
        simulator = EmbeddedSimulator(self.config, allow_unknown_assets=True)
        simulator.reset(json.dumps(house), name=self.name)
        return simulator
