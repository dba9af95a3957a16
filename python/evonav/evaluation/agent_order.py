"""The order of a run's agents in tables, files and pairs: a pair is the later agent minus the earlier."""

from collections.abc import Iterable

PAPER_ORDER = ("unigoal", "3d-mem", "msgnav", "fu", "stage-reset", "ftu")
"""Agents in the order of the paper's tables."""


def agents_in_order(agents: Iterable[str]) -> tuple[str, ...]:
    """Return the agents, each once: the paper's in the order of its tables, then the others by name."""
    rank = {agent: i for i, agent in enumerate(PAPER_ORDER)}
    return tuple(sorted(set(agents), key=lambda agent: (rank.get(agent, len(rank)), agent)))
