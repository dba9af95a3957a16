"""Name the agents that are no contestants: they bound what a contestant can reach, from above and from below."""

ORACLE_BASELINE_NAMES = ("shortest-path", "nearest-frontier", "oracle-memory", "oracle-flags")
"""Agents that know more than an agent may; `evonav.evaluation.episode.oracle_baselines` has their classes."""
REFERENCE_BASELINE_NAMES = ("random-walk", "stay-still")
"""Ordinary agents that show what chance reaches, and what costs nothing."""
BASELINES = frozenset((*ORACLE_BASELINE_NAMES, *REFERENCE_BASELINE_NAMES))
