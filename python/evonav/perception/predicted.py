"""Perception by models: a detector's findings, filtered, one label a pixel, called by ProcTHOR's types.

Nothing of the simulator but colours and depth goes in: neither instances nor the scene's objects are looked at.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import InvalidArgumentError
from evonav.perception.detector import Detector, DetectorView, Embedder, Found
from evonav.perception.filters import FilterConfig, filtered, mask_areas_px, one_label_a_pixel
from evonav.perception.perception import Percept, Perception, StageScene
from evonav.perception.stacks import STACKS, StackConfig, StackName, facts_of, load_stack, stack_of
from evonav.perception.vocabulary import TYPE_OF_WORD
from evonav.sensors.observation import Detections
from evonav.world.simulator import Frame

__all__ = [
    "Detector",
    "DetectorView",
    "Embedder",
    "Found",
    "PredictedPerception",
    "StackPerception",
    "predicted_perception",
]


class PredictedPerception:
    """What a detector sees, as percepts; depth and pose are the frame's own."""

    needs_rgb = True

    def __init__(
        self,
        detector: Detector,
        filters: FilterConfig | None = None,
        embedder: Embedder | None = None,
        types: Mapping[str, str] = TYPE_OF_WORD,
    ) -> None:
        """A perception over models that may be shared.

        Args:
            detector: Finds.
            filters: What is believed; default: 3D-Mem's values.
            embedder: Gives what is left features; without, they are the detector's, if it has some.
            types: ProcTHOR's type by the detector's word; a word that is not in it stays as it is.
        """
        self._detector = detector
        self._filters = filters or FilterConfig()
        self._embedder = embedder
        self._types = types

    def begin_stage(self, scene: StageScene) -> None:
        """Nothing of the scene is used."""

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """The views of a round, as one batch.

        Raises:
            InvalidArgumentError: A frame has no colours, or what the detector returns does not fit.
        """
        views = [DetectorView(_colours(frame), frame.depth_m, frame.pose.horizon_rad) for frame in frames]
        found = self._detector.detect(views)
        if len(found) != len(views):
            raise InvalidArgumentError(f"a detector returned {len(found)} results for {len(views)} views")
        kept = []
        for one, view in zip(found, views, strict=True):
            one.check((view.rgb.shape[0], view.rgb.shape[1]))
            kept.append(filtered(one, self._filters))
        features: Sequence[NDArray[np.float32] | None] = [one.features for one in kept]
        if self._embedder is not None:
            features = self._embedder.image_features([view.rgb for view in views], [one.boxes_px for one in kept])
        return [
            Percept(self._detections(one, feature), frame.depth_m, frame.pose)
            for one, feature, frame in zip(kept, features, frames, strict=True)
        ]

    def text_feature(self, text: str) -> NDArray[np.float32] | None:
        """Of the embedder, if there is one."""
        return None if self._embedder is None else self._embedder.text_feature(text)

    def _detections(self, found: Found, features: NDArray[np.float32] | None) -> Detections:
        """One label a pixel; what smaller masks leave fewer pixels of than a mask must have goes."""
        masks = one_label_a_pixel(found.masks)
        num = len(found)
        left_px = np.bincount(masks[masks >= 0], minlength=num)
        min_area_px = self._filters.min_area_px * self._filters.scale_of(masks.shape) ** 2
        is_kept = left_px >= np.minimum(np.maximum(min_area_px, 1.0), mask_areas_px(found.masks))
        if not is_kept.all():
            masks = one_label_a_pixel(found.masks[is_kept])
        labels = [label for label, kept in zip(found.labels, is_kept.tolist(), strict=True) if kept]
        return Detections(
            masks=masks,
            labels=tuple(self._types.get(label, label) for label in labels),
            confidences=found.confidences[is_kept],
            features=None if features is None else features[is_kept],
        )


def _colours(frame: Frame) -> NDArray[np.uint8]:
    if frame.rgb is None:
        raise InvalidArgumentError("argument `frames`: one has no colours, expected frames rendered with them")
    return frame.rgb


@dataclass(slots=True)
class StackPerception:
    """A stack by its name; its models are loaded at the first stage, once a process."""

    stack: str
    config: StackConfig
    models: str | None
    device: str
    needs_rgb: bool = field(default=True, init=False)
    _perception: PredictedPerception | None = field(default=None, init=False, repr=False)

    def check(self, agents: Sequence[str]) -> dict[str, Any]:
        """Whether all is there that will be needed, without loading it; files that are missing are fetched.

        Args:
            agents: That will look with it.

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
        """Loads the models of the agent's stack; of the scene, the agent's name alone is used."""
        parts = load_stack(self._stack_for(scene.agent), self.config, self.models, self.device)
        self._perception = PredictedPerception(parts.detector, parts.filters, parts.embedder)

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """The views of a round, as one batch."""
        return self._begun().perceive(frames)

    def text_feature(self, text: str) -> NDArray[np.float32] | None:
        """Of the stack's CLIP, if it has one."""
        return self._begun().text_feature(text)

    def _begun(self) -> PredictedPerception:
        if self._perception is None:
            raise InvalidArgumentError("a stack of models is told of a stage (`begin_stage`) before it looks")
        return self._perception

    def _stack_for(self, agent: str) -> StackName:
        return next((name for name in STACKS if name == self.stack), None) or stack_of(agent)


def predicted_perception(
    stack: str = "auto",
    models: str | None = None,
    device: str = "auto",
    **options: Any,  # noqa: ANN401 - of `StackConfig`
) -> Perception:
    """What `predicted[:STACK]` stands for.

    Args:
        stack: Of `evonav.perception.words.STACKS`; `auto`: UniGoal its own, all others 3D-Mem's.
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
