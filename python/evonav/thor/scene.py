"""Hold the scene that actions read and change: a ProcTHOR house and its simulator."""

import copy
import json
from collections.abc import Callable
from itertools import count
from typing import Any, TypeVar, cast

from evonav.thor.actions.registry import ActionError
from evonav.world.appearance import Change, with_change
from evonav.world.camera import CameraView
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

Document = dict[str, Any]
"""A house as JSON."""

Derived = TypeVar("Derived")
_versions = count(1)


class Scene:
    """One house. `begin_edit` allows changes of it; the next use of `simulator` rebuilds the simulator."""

    def __init__(self, name: str = "Procedural") -> None:
        self.name = name
        self.house: Document | None = None
        self.config = SimulatorConfig()
        self.version = next(_versions)
        """Number that is unique to this scene and state."""
        self.disabled: dict[str, Document] = {}
        """Objects that were removed, by id."""
        self.appearance: tuple[Change, ...] = ()
        """Changes of the house's look, by `RandomizeMaterials` and the like."""
        self._simulator: EmbeddedSimulator | None = None
        self._derived: dict[Callable[[Scene], object], object] = {}

    def load(self, house: Document) -> None:
        """Replace the house.

        Raises:
            HouseError: The house is malformed; the present one stays.
        """
        simulator = self._built(house)
        self.house, self._simulator, self.disabled = house, simulator, {}
        self.mark_changed()

    def begin_edit(self) -> Document:
        """Return the house, to be changed in place."""
        if self.house is None:
            raise ActionError(f"scene {self.name} holds no house: call CreateHouse first")
        self._simulator = None
        self.mark_changed()
        return self.house

    def apply(self, delta_json: str) -> None:
        """Move objects by a `HouseDelta`; only these objects are rebuilt."""
        # The simulator must be another object, because derived data is cached by its identity.
        simulator = copy.copy(self.simulator)
        simulator.apply(delta_json)
        self.begin_edit()
        self.house, self._simulator = json.loads(simulator.house_json), simulator

    def randomize(self, change: Change) -> None:
        """Change the look of the house, on top of earlier changes."""
        self._show(with_change(self.appearance, change))

    def restore(self, *kinds: type[Change]) -> None:
        """Undo the changes of the look of some kinds."""
        self._show(tuple(change for change in self.appearance if not isinstance(change, kinds)))

    def _show(self, appearance: tuple[Change, ...]) -> None:
        # The simulator must be another object, because derived data is cached by its identity.
        simulator = copy.copy(self.simulator)
        simulator.set_appearance(appearance)
        self.appearance, self._simulator = appearance, simulator
        self.mark_changed()

    def mark_changed(self) -> None:
        """Record a change of the house, also one that does not change the simulator."""
        self.version = next(_versions)
        self._derived.clear()

    def derived(self, make: Callable[["Scene"], Derived]) -> Derived:
        """Return what a function makes of the scene; it is made once for each version of the scene."""
        if make not in self._derived:
            self._derived[make] = make(self)
        return cast("Derived", self._derived[make])

    def configure(self, config: SimulatorConfig) -> None:
        """Set the agent's camera and body."""
        if config != self.config:
            self.config, self._simulator = config, None
            self.mark_changed()

    def seen_from(self, camera: Pose) -> CameraView:
        """Return the view of the agent's camera from a pose."""
        return CameraView(camera, self.config.width_px, self.config.height_px, self.config.intrinsics.vertical_fov_rad)

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
        simulator.set_appearance(self.appearance, are_checked=True)
        return simulator
