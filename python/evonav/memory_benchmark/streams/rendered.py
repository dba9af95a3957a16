"""Render a stream from its plan, one frame at a time: the same frames whenever it is read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evonav._core import House
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.memory_benchmark.streams.evidence import (
    changes_between,
    detected_ids,
    empty_px,
    is_taken,
    objects_of,
    visible_px,
)
from evonav.memory_benchmark.streams.plan import PlannedScene, StreamPlan
from evonav.memory_benchmark.streams.spec import RATE_HZ, StreamSpec
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.perception import Perception, StageScene
from evonav.perception.shorthand import parse_perception
from evonav.sensors.observation import NO_OCCUPANCY, View
from evonav.tasks.language import PROCTHOR_TYPES, STRUCTURE_TYPES
from evonav.tasks.public import Goal
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import Frame, SceneObject

_NO_IMAGE = np.zeros((1, 1, 3), np.uint8)


@dataclass(frozen=True, slots=True)
class _Bodies:
    """The bodies of one scene, in the frame of the stream's world."""

    all: tuple[SceneObject, ...]
    """The simulator's bodies, in instance order."""
    objects: tuple[SceneObject, ...]
    """All that stands in the world while the scene is shown."""
    vacated: list[tuple[int, SceneObject]]
    """Places that objects have left and nothing has taken, by the index of the change."""


class RenderedStream:
    """A `Stream` that the embedded simulator renders."""

    has_truth = True

    def __init__(self, spec: StreamSpec, plan: StreamPlan, *, rgb: bool = False) -> None:
        """Make a stream; no frame is rendered yet.

        Args:
            rgb: Whether frames have colours, which cost more than the rest.
        """
        self.spec, self.plan, self.rgb = spec, plan, rgb
        self.name, self.kind, self.house = spec.name, str(spec.kind), spec.house_name
        # The labels are all of ProcTHOR's types, whatever the house holds.
        self.info = StreamInfo(spec.camera.intrinsics, (*PROCTHOR_TYPES, *STRUCTURE_TYPES), RATE_HZ)
        self.changes: Sequence[TrueChange]
        self._scenes, self.changes = self._world()

    def _world(self) -> tuple[list[_Bodies], list[TrueChange]]:
        """Return the bodies of every scene, and all changes."""
        simulator, scenes = self._simulator(), self.plan.scenes
        bodies = []
        for scene in scenes:
            simulator.reset(scene.house_json)
            bodies.append(tuple(_placed(body, scene) for body in simulator.objects))
        if self.kind == "S7":
            everything = tuple(body for group in bodies for body in objects_of(group))
            return [_Bodies(group, everything, []) for group in bodies], []
        found = [_Bodies(group, objects_of(group), []) for group in bodies]
        positions_m = [
            {item.id: item.position_m for item in House(scene.house_json, name=self.name).objects} for scene in scenes
        ]
        changes: list[TrueChange] = []
        for number in range(1, len(scenes)):
            first = sum(frame.scene < number for frame in self.plan.frames)
            before = found[number - 1].objects
            pair = positions_m[number - 1 : number + 1]
            for change in changes_between(before, found[number].objects, pair, first):
                if change.before is not None:
                    for later in found[number:]:
                        if is_taken(change.before, before, later.objects):
                            break
                        later.vacated.append((len(changes), change.before))
                changes.append(change)
        return found, changes

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Render the stream, one frame at a time."""
        perception: Perception = parse_perception(self.spec.perception).create()
        # S8 has S2's houses and walks under different errors, so all its streams share a name here.
        task_id = f"{self.house}/{self.spec.seed}"
        current = -1
        for index, (frame, bodies) in enumerate(self._rendered(rgb=self.rgb or perception.needs_rgb)):
            planned = self.plan.frames[index]
            if planned.scene != current:
                current = planned.scene
                goal = Goal(current + 1, "", "", "", "", _NO_IMAGE)  # a stream has none
                perception.begin_stage(StageScene(task_id, goal, "fu", self.spec.seed, bodies.all))
            percept = perception.perceive([frame])[0]
            rgb = frame.rgb if self.rgb else None
            view = View(percept.pose, frame.intrinsics, percept.depth_m, percept.detections, NO_OCCUPANCY, rgb)
            truth = FrameTruth(
                bodies.objects,
                visible_px(frame, bodies.all),
                empty_px(frame, bodies.vacated),
                detected_ids(percept.detections, frame, bodies.all),
            )
            yield MemoryFrame(index, planned.time_s, planned.visit, view).read_only(), truth

    def evidence(self, range_m: float) -> Iterator[tuple[Frame, dict[str, int], dict[int, int]]]:
        """Render the stream without perception; yield each frame with its `visible_px` and `empty_px`.

        Args:
            range_m: Largest distance on the ground plane of what counts.
        """
        for frame, bodies in self._rendered(rgb=False):
            yield frame, visible_px(frame, bodies.all, range_m), empty_px(frame, bodies.vacated, range_m)

    def _rendered(self, *, rgb: bool) -> Iterator[tuple[Frame, _Bodies]]:
        """Yield the simulator's frames, in the frame of the stream's world."""
        simulator, current = self._simulator(), -1
        for planned in self.plan.frames:
            scene = self.plan.scenes[planned.scene]
            if planned.scene != current:
                simulator.reset(scene.house_json)
                current = planned.scene
            frame = simulator.render(planned.pose, rgb=rgb, instances=True)
            if scene.offset_m != (0.0, 0.0):
                pose, (by_x_m, by_z_m) = frame.pose, scene.offset_m
                frame = replace(frame, pose=replace(pose, x_m=pose.x_m + by_x_m, z_m=pose.z_m + by_z_m))
            yield frame, self._scenes[current]

    def _simulator(self) -> EmbeddedSimulator:
        return EmbeddedSimulator(self.spec.camera, allow_unknown_assets=self.spec.allow_unknown_assets)


def _placed(body: SceneObject, scene: PlannedScene) -> SceneObject:
    """Return a body of a scene's house where it stands in the stream's world, with its id there."""
    (x_m, y_m, z_m), (by_x_m, by_z_m) = body.centre_m, scene.offset_m
    if not scene.prefix and scene.offset_m == (0.0, 0.0):
        return body
    return replace(body, id=scene.prefix + body.id, centre_m=(x_m + by_x_m, y_m, z_m + by_z_m))
