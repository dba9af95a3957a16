from .camera import CameraView, Images, project, unproject
from .check import check_simulator
from .embedded import EmbeddedSimulator
from .pose import Pose
from .simulator import Action, Frame, Intrinsics, OccupancyGrid, SceneObject, Simulator, SimulatorConfig

__all__ = [
    "Action",
    "CameraView",
    "EmbeddedSimulator",
    "Frame",
    "Images",
    "Intrinsics",
    "OccupancyGrid",
    "Pose",
    "SceneObject",
    "Simulator",
    "SimulatorConfig",
    "check_simulator",
    "project",
    "unproject",
]
