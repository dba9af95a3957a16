"""Run many evaluations from one file and compare them."""

SWEEP_NAME = "sweep.json"
"""File of a sweep's settings, in its folder."""
RUNS_NAME = "runs"
"""Folder with a run for each cell."""
