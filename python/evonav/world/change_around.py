"""Change a house around an agent that stands in it."""

from evonav.world.embedded import core_of
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig


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
        pose: The agent's pose.
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
