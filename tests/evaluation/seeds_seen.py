"""A perception that notes what it was told."""

from pathlib import Path

from evonav.perception.ground_truth import GroundTruthPerception


class Noting(GroundTruthPerception):
    def __init__(self, path):
        super().__init__()
        self._path = Path(path)

    def begin_stage(self, scene):
        super().begin_stage(scene)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(f"{scene.agent} {scene.task_id} {scene.seed}\n")
