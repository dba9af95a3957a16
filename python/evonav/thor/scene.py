"""Hold the scene that actions read and change: a ProcTHOR house and its simulator."""

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
    """One house. `begin_edit` allows changes of it; the next use of `simulator` rebuilds the simulator."""

    def __init__(self, name: str = "Procedural") -> None:
        self.name = name
        self.house: Document | None = None
        self.config = SimulatorConfig()
        self.version = next(_versions)
        """Number that is unique to this scene and state; everything derived from the house is cached under it."""
        self.disabled: dict[str, Document] = {}
        """Objects that were removed, by id."""
        self._simulator: EmbeddedSimulator | None = None

    def load(self, house: Document) -> None:
        """Replace the house.

        Raises:
            HouseError: The house is malformed; the present one stays.
        """
        simulator = self._built(house)
        self.house, self._simulator, self.disabled = house, simulator, {}
        self.version = next(_versions)

    def begin_edit(self) -> Document:
        """Return the house, to be changed in place."""
        if self.house is None:
            raise ActionError(f"scene {self.name} holds no house: call CreateHouse first")
        self._simulator = None
        self.version = next(_versions)
        return self.house

    def apply(self, delta_json: str) -> None:
        """Move objects by a `HouseDelta`; only these objects are rebuilt."""
        # The simulator must be another object, because derived data is cached by its identity.
        simulator = copy.copy(self.simulator)
        simulator.apply(delta_json)
        self.begin_edit()
        self.house, self._simulator = json.loads(simulator.house_json), simulator

    def mark_receptacles_changed(self) -> None:
        """Record that objects stand on other receptacles than before, without a change of the simulator."""
        self.version = next(_versions)

    def configure(self, config: SimulatorConfig) -> None:
        """Set the agent's camera and body."""
        if config != self.config:
            self.config, self._simulator = config, None
            self.version = next(_versions)

    @property
    def simulator(self) -> EmbeddedSimulator:
        """The simulator of the house in its present version."""
        if self.house is None:
            raise ActionError(f"scene {self.name} holds no house: call CreateHouse first")
        if self._simulator is None:
            self._simulator = self._built(self.house)
        return self._simulator

    def _built(self, house: Document) -> EmbeddedSimulator:
        simulator = EmbeddedSimulator(self.config, allow_unknown_assets=True)
        simulator.reset(json.dumps(house), name=self.name)
        return simulator
