"""Compare agents stage by stage and show where they differ."""
