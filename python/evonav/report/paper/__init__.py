"""Set a run beside the paper's tables."""
