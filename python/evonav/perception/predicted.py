"""Perceive with a stack of models, named on the command line and loaded once in each process."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.perception import Percept, Perception, StageScene
from evonav.perception.stacks import STACKS, StackConfig, StackName, facts_of, load_stack, stack_of
from evonav.world.simulator import Frame


@dataclass(slots=True)
class StackPerception:
    """A stack by its name; its models are loaded at the first stage, once a process."""

    stack: str
    config: StackConfig
    models: str | None
    device: str
    needs_rgb: bool = field(default=True, init=False)
    _perception: DetectorPerception | None = field(default=None, init=False, repr=False)

    def check(self, agents: Sequence[str]) -> dict[str, Any]:
        """Check that everything needed is there, without loading it; missing files are fetched.

        Args:
            agents: Agents that will use it.

        Returns:
            What decides results beside options: by stack, hashes of weights and versions of libraries.

        Raises:
            PerceptionError: Something is missing; the message says what to do.
            InvalidArgumentError: An option makes no sense.
        """
        from evonav.perception.models.libraries import device_of

        stacks = sorted({self._stack_for(agent) for agent in agents})
        facts: dict[str, Any] = {stack: facts_of(stack, self.config, self.models) for stack in stacks}
        device_of(self.device)
        return facts

    def begin_stage(self, scene: StageScene) -> None:
        """Load the models of the agent's stack; of the scene, only the agent's name is used."""
        parts = load_stack(self._stack_for(scene.agent), self.config, self.models, self.device)
        self._perception = DetectorPerception(parts.detector, parts.filters, parts.embedder)

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """Perceive the views of a round, as one batch."""
        return self._begun().perceive(frames)

    def text_feature(self, text: str) -> NDArray[np.float32] | None:
        """Return the feature of the stack's CLIP, if it has one."""
        return self._begun().text_feature(text)

    def _begun(self) -> DetectorPerception:
        if self._perception is None:
            raise InvalidArgumentError("a stack of models has no stage yet: call `begin_stage` first")
        return self._perception

    def _stack_for(self, agent: str) -> StackName:
        return next((name for name in STACKS if name == self.stack), None) or stack_of(agent)


def predicted_perception(
    stack: str = "auto",
    models: str | None = None,
    device: str = "auto",
    **options: Any,  # noqa: ANN401 - of `StackConfig`
) -> Perception:
    """Make the perception `predicted[:STACK]`.

    Args:
        stack: One of `evonav.perception.shorthand.STACKS`; `auto`: UniGoal's for UniGoal, 3D-Mem's for all others.
        models: Folder of weights; default: `EVONAV_MODELS`, else the libraries' own hubs.
        device: `auto`, `cpu`, `cuda` or `cuda:N`.
        options: See `evonav.perception.stacks.StackConfig`; of `mini`, which needs neither models nor a device,
            `evonav.perception.mini.MiniPerception`.

    Raises:
        InvalidArgumentError: There is no such stack or option.
    """
    if stack == "mini":
        from evonav.perception.mini import MiniPerception

        return MiniPerception(**options)
    if stack != "auto" and stack not in STACKS:
        raise InvalidArgumentError(f"no stack {stack!r}; there are auto, {', '.join(STACKS)}, mini")
    return StackPerception(stack, StackConfig.from_options(options), models, device)
