"""What agents ask: one typed question a purpose, one file an agent family."""
