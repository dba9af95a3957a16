"""Follow the house of a stage: its target, the way there, and its change during the stage (docs/extensions.md)."""

import json
from typing import Any

from evonav.agents.agent import AgentAction, Move, NavigateTo, SensorConfig
from evonav.errors import SimulationError
from evonav.evaluation.episode import motion
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import ChangeDuringStage
from evonav.points import Point2, Point3
from evonav.world.embedded import core_of
from evonav.world.pose import Pose
from evonav.world.simulator import Simulator, SimulatorConfig


class StageHouse:
    """The house of a stage as it is now, in the simulator. It holds oracle data."""

    def __init__(self, spec: EpisodeSpec, stage: int, simulator: Simulator, protocol: ProtocolConfig) -> None:
        """Prepare a stage (1-based) of a task; `load` comes next."""
        self._spec = spec
        self._number = stage
        self._stage = spec.stages[stage - 1]
        self._simulator = simulator
        self._protocol = protocol
        self.planner = motion.Planner(simulator)
        self.target_m: Point3 = self._stage.target.position_m
        """The target's present position."""
        self._target_room_id = self._stage.target.room_id
        self.during: ChangeDuringStage | None = None if self._stage.change is None else self._stage.change.record
        """The record of the change during the stage, so far."""

    def load(self, requested: Pose) -> Pose:
        """Load the house as the stage begins; return the agent's effective pose."""
        return self._simulator.reset(self._stage.house_json, requested)

    def is_in_room(self, pose: Pose, room_id: str | None) -> bool:
        """Return whether a pose is in a room; never in `None`."""
        return room_id is not None and self._spec.parsed_house(self._number).room_of(pose.x_m, pose.z_m) == room_id

    def path_to_target_m(self) -> list[Point2]:
        """Return the planner's path from the agent to the target; empty if there is none."""
        x_m, _, z_m = self.target_m
        house = self._spec.parsed_house(self._number)  # the rooms stay the same when the house changes
        path_m = self.planner.path_m((x_m, z_m))
        return self.planner.into_room_m(path_m, (x_m, z_m), house, self._target_room_id)

    def carry_out(self, action: AgentAction, sensors: SensorConfig) -> motion.Motion:
        """Carry out an agent's answer."""
        if isinstance(action, NavigateTo):
            return motion.navigate(
                self._simulator,
                self.planner,
                action,
                spacing_m=self._protocol.waypoint_m,
                max_travel_m=sensors.max_travel_m,
            )
        if isinstance(action, Move):
            return motion.move(self._simulator, action)
        return motion.stay(self._simulator)

    def is_change_due(self, number: int, sensors: SensorConfig) -> bool:
        """Return whether the house changes before the views of a round of the agent, from 0."""
        return self.during is not None and number == self._protocol.step_of_round(self.during.round, sensors)

    def change(self, number: int, path_before_m: float) -> ChangeDuringStage:
        """Change the house around the agent, which keeps its pose.

        Args:
            number: The round, from 0, before whose views it changes.
            path_before_m: Length of the agent's path so far.

        Raises:
            SimulationError: The agent cannot stand where it stood, even if nothing changes.
        """
        change, target_id = self._stage.change, self._stage.target.object_id
        assert change is not None  # `is_change_due` was true
        pose = self._simulator.pose
        house_json, skipped = change_around(
            self._stage.house_json, change.delta_json, self._simulator.config, pose, target_id
        )
        if not _is_same(self._simulator.reset(house_json, pose), pose):
            # Another simulator's bodies may be a little wider.
            skipped = changed_ids(change.delta_json)
            if not _is_same(self._simulator.reset(self._stage.house_json, pose), pose):
                raise SimulationError(f"the house changes in round {number}, and the agent no longer fits at {pose}")
        self.planner = motion.Planner(self._simulator)
        if target_id not in skipped:
            self.target_m = x_m, _, z_m = change.target_position_m
            room_id = self._spec.parsed_house(self._number).room_of(x_m, z_m)
            self._target_room_id = room_id or self._target_room_id
        left_m = self.path_to_target_m()
        done = change.record.model_copy(update={"at_round": number, "skipped_ids": skipped})
        self.during = done.model_copy(
            update={
                "change": done.change.model_copy(
                    update={"is_agent_in_room": self.is_in_room(pose, done.change.room_id)}
                ),
                "target_position_m": self.target_m,
                "is_target_relocated": any(one.object_id == target_id for one in done.done),
                "path_before_m": path_before_m,
                "reference_after_m": motion.polyline_length_m(left_m) if left_m else None,
            }
        )
        return self.during


def _is_same(one: Pose, other: Pose) -> bool:
    """Return whether two poses are the same except for rounding."""
    return max(abs(one.x_m - other.x_m), abs(one.z_m - other.z_m)) < 1e-6


def changed_ids(delta_json: str) -> tuple[str, ...]:
    """Return the ids of all that a change of a house changes."""
    delta: dict[str, Any] = json.loads(delta_json)
    ids = [*delta["removed"], *(one["id"] for name in ("moves", "added", "states") for one in delta[name])]
    return tuple(dict.fromkeys(ids))


def change_around(
    house_json: str, delta_json: str, config: SimulatorConfig, pose: Pose, target_id: str
) -> tuple[str, tuple[str, ...]]:
    """Return a house after a change, without the parts of the change for which an agent stands in the way.

    An object that would touch the agent stays, and so does all that this forces to stay: what would stand on it or
    overlap it, and its support. If the agent would be shut in, or the target cut off from it, everything stays. It is
    computed from the house alone, so it is the same for every simulator.

    Args:
        delta_json: The change, as `House.apply` takes it.
        config: The simulator's, for the agent's body.
        target_id: The object that has to stay within reach.

    Returns:
        The house after it as JSON, and the ids of what stays, in the order of the change.

    Raises:
        HouseError: The change names an object that the house does not contain.
        InvalidArgumentError: The change is malformed.
    """
    core = core_of(house_json, config, name="house", allow_unknown_assets=True)
    changed, skipped = core.change_around(delta_json, agent_m=(pose.x_m, pose.z_m), target_id=target_id)
    return changed, tuple(skipped)
