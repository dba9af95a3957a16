"""Define what a model that passes questions on to another one has in common with it."""

from evonav.decision.goal_input import GoalInput, goal_input_of
from evonav.decision.question import DecisionModel


class ModelWrapper:
    """Says of itself what another model says; subclasses answer by it."""

    def __init__(self, model: DecisionModel) -> None:
        """Store the other model."""
        self.model = model

    @property
    def needs_images(self) -> bool:
        """True if the model needs images."""
        return self.model.needs_images

    @property
    def needs_colours(self) -> bool:
        """True if the model, without images, needs the names of the colours in them."""
        return bool(getattr(self.model, "needs_colours", False))

    @property
    def goal_input(self) -> GoalInput:
        """Form of the goal that the model's agents go by."""
        return goal_input_of(self.model)
