"""Render a stream from its plan, one frame at a time: the same frames whenever it is read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evonav._core import House
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo, read_only
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
from evonav.sensors.observation import View, VisibleOccupancy
from evonav.tasks.language import PROCTHOR_TYPES, STRUCTURE_TYPES
from evonav.tasks.public import Goal
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import Frame, SceneObject

NO_OCCUPANCY = VisibleOccupancy(np.empty((0, 2), np.int32), np.empty((0, 2), np.int32))
"""Views of streams have no oracle occupancy: a memory has depth."""
_NO_IMAGE = np.zeros((1, 1, 3), np.uint8)


@dataclass(frozen=True, slots=True)
class _Bodies:
    """The bodies of one scene, in the frame of the stream's world."""

    all: tuple[SceneObject, ...]
    """The simulator's bodies, in instance order."""
    objects: tuple[SceneObject, ...]
    """All that stands in the world while the scene is shown."""
    vacated: tuple[tuple[int, SceneObject], ...]
    """Places that objects have left and nothing has taken, by the index of the change."""


class RenderedStream:
    """A `Stream` that the embedded simulator renders."""

    has_truth = True
    """Always true; streams in files may lack their truth."""

    def __init__(self, spec: StreamSpec, plan: StreamPlan, *, rgb: bool = False) -> None:
        """Make a stream; nothing is rendered yet.

        Args:
            rgb: Whether frames have colours, which cost more than the rest.
        """
        self.spec = spec
        self.plan = plan
        self.rgb = rgb

    @property
    def name(self) -> str:
        """Its kind, house and seed, such as `S1/bundled-0012/0`."""
        return self.spec.name

    @property
    def kind(self) -> str:
        """`S0` to `S9`."""
        return self.spec.kind

    @property
    def house(self) -> str:
        """The house that intervals are resampled by."""
        return self.spec.house_name

    @property
    def info(self) -> StreamInfo:
        """The public facts that a memory is told; the labels are all of ProcTHOR's types, whatever the house holds."""
        return StreamInfo(self.spec.camera.intrinsics, (*PROCTHOR_TYPES, *STRUCTURE_TYPES), RATE_HZ)

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return len(self.plan.visits)

    @property
    def checkpoints(self) -> Sequence[tuple[int, int]]:
        """Numbers of objects of S7, each with the index of the frame at which so many have been seen."""
        return self.plan.checkpoints

    @property
    def changes(self) -> Sequence[TrueChange]:
        """All changes, in the order of time."""
        return self._world[1]

    @cached_property
    def _world(self) -> tuple[list[_Bodies], tuple[TrueChange, ...]]:
        """Bodies of every scene, and all changes; computed once."""
        simulator, scenes = self._simulator(), self.plan.scenes
        bodies = []
        for scene in scenes:
            simulator.reset(scene.house_json)
            bodies.append(tuple(placed(body, scene) for body in simulator.objects))
        if self.kind == "S7":
            everything = tuple(body for group in bodies for body in objects_of(group))
            return [_Bodies(group, everything, ()) for group in bodies], ()
        objects = [objects_of(group) for group in bodies]
        positions_m = [
            {item.id: item.position_m for item in House(scene.house_json, name=self.name).objects} for scene in scenes
        ]
        changes: list[TrueChange] = []
        vacated: list[list[tuple[int, SceneObject]]] = [[] for _ in scenes]
        for number in range(1, len(scenes)):
            first = int(np.searchsorted(self.plan.frame_scenes, number))
            pair = positions_m[number - 1 : number + 1]
            for change in changes_between(objects[number - 1], objects[number], pair, first):
                if change.before is not None:
                    for later in range(number, len(scenes)):
                        if is_taken(change.before, objects[number - 1], objects[later]):
                            break
                        vacated[later].append((len(changes), change.before))
                changes.append(change)
        return [_Bodies(*parts) for parts in zip(bodies, objects, map(tuple, vacated), strict=True)], tuple(changes)

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Render the stream, one frame at a time."""
        perception: Perception = parse_perception(self.spec.perception).create()
        current = -1
        for index, (frame, bodies) in enumerate(self._rendered(rgb=self.rgb or perception.needs_rgb)):
            number = int(self.plan.frame_scenes[index])
            if number != current:
                perception.begin_stage(self._stage(number + 1, bodies.all))
                current = number
            percept = perception.perceive([frame])[0]
            view = View(
                percept.pose,
                frame.intrinsics,
                percept.depth_m,
                percept.detections,
                NO_OCCUPANCY,
                frame.rgb if self.rgb else None,
            )
            truth = FrameTruth(
                bodies.objects,
                visible_px(frame, bodies.all),
                empty_px(frame, bodies.vacated),
                detected_ids(percept.detections, frame, bodies.all),
            )
            shot = MemoryFrame(index, float(self.plan.times_s[index]), int(self.plan.visits[index]), view)
            yield read_only(shot), truth

    def evidence(self, range_m: float) -> Iterator[tuple[Frame, dict[str, int], dict[int, int]]]:
        """Render the stream without perception; yield each frame with its `visible_px` and `empty_px`.

        Args:
            range_m: Largest distance on the ground plane of what counts.
        """
        for frame, bodies in self._rendered(rgb=False):
            yield frame, visible_px(frame, bodies.all, range_m), empty_px(frame, bodies.vacated, range_m)

    def _rendered(self, *, rgb: bool) -> Iterator[tuple[Frame, _Bodies]]:
        """Yield the simulator's frames, in the frame of the stream's world."""
        scenes, simulator, current = self._world[0], self._simulator(), -1
        for index, number in enumerate(self.plan.frame_scenes.tolist()):
            scene = self.plan.scenes[number]
            if number != current:
                simulator.reset(scene.house_json)
                current = number
            frame = simulator.render(self.plan.pose(index), rgb=rgb, instances=True)
            yield moved(frame, scene), scenes[number]

    def _simulator(self) -> EmbeddedSimulator:
        return EmbeddedSimulator(self.spec.camera, allow_unknown_assets=self.spec.allow_unknown_assets)

    def _stage(self, number: int, bodies: Sequence[SceneObject]) -> StageScene:
        """Return a scene as perceptions know it; a stream has no goal."""
        goal = Goal(number, "", "", "", "", _NO_IMAGE)
        # The draws of S8 are S2's houses and walks under different errors, so all its streams share a name here.
        task_id = f"{self.spec.house_name}/{self.spec.seed}"
        return StageScene(task_id, goal, "fu", self.spec.seed, bodies)


def placed(body: SceneObject, scene: PlannedScene) -> SceneObject:
    """Return a body of a scene's house where it stands in the stream's world, with its id there."""
    (x_m, y_m, z_m), (by_x_m, by_z_m) = body.centre_m, scene.offset_m
    if not scene.prefix and scene.offset_m == (0.0, 0.0):
        return body
    return replace(body, id=scene.prefix + body.id, centre_m=(x_m + by_x_m, y_m, z_m + by_z_m))


def moved(frame: Frame, scene: PlannedScene) -> Frame:
    """Return a frame of a scene's house with its pose in the stream's world."""
    if scene.offset_m == (0.0, 0.0):
        return frame
    pose, (by_x_m, by_z_m) = frame.pose, scene.offset_m
    return replace(frame, pose=replace(pose, x_m=pose.x_m + by_x_m, z_m=pose.z_m + by_z_m))
