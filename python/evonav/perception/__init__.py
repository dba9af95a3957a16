"""From rendered frames to what an agent is told that it sees: ground truth, ground truth with errors, models."""

from evonav.perception.perception import Percept, Perception, StageScene

__all__ = ["Percept", "Perception", "StageScene"]
