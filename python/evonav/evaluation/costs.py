"""What a stage cost: time by component, questions, tokens, money and memory. None of it is part of a record."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class StageCosts:
    """Of one stage; `None` where it was not measured. CPU time is of the evaluator's and the agent's processes."""

    wall_s: float | None = None
    cpu_s: float | None = None
    simulation_wall_s: float | None = None
    """Loading the house, rendering, moving, and planning paths."""
    simulation_cpu_s: float | None = None
    perception_wall_s: float | None = None
    """Detections and visible occupancy."""
    perception_cpu_s: float | None = None
    agent_wall_s: float | None = None
    """Asking the agent, its decision model and the way there and back included."""
    agent_cpu_s: float | None = None
    decision_wall_s: float | None = None
    """Of that, in its decision model."""
    decision_cpu_s: float | None = None
    evaluator_wall_s: float | None = None
    """All else: judging, recording, the map of the house."""
    evaluator_cpu_s: float | None = None
    num_questions: int | None = None
    """That a model was asked, tries included; `None` for a decision model that keeps no account."""
    num_replayed: int | None = None
    """Answered by kept exchanges."""
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    """By the prices given; `None` without."""
    agent_peak_rss_mb: float | None = None
    """Of the agent's process, at its most so far: it serves many episodes."""
    num_retries: int | None = None
