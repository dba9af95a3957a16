"""Turn rendered frames into what an agent sees: ground truth, ground truth with errors, or detections of models."""

from evonav.perception.perception import Percept, Perception, StageScene

__all__ = ["Percept", "Perception", "StageScene"]
