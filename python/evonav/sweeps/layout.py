"""Names of the files of a sweep's folder."""

SWEEP_NAME = "sweep.json"
RUNS_NAME = "runs"
"""Folder with a run for each cell."""
