"""Variants and ablations of evonav's agents, for the studies in its documentation."""
