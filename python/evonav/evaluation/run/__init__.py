"""Schedule the episodes of a run on workers and commit their results."""
