"""Compute statistics of sets of tasks in the paper's metrics (Sec. 3.2)."""
