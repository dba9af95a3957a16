"""What makes decision models, by import path: see `evonav.evaluation.backend.Backend.decision`."""

from evonav.decision.questions.question import DecisionModel


def text_match(seed: int) -> DecisionModel:
    """The rules of `evonav.decision.text_match`, which draw nothing."""
    from evonav.decision.text_match import TextMatch

    return TextMatch()
