"""Run one agent through the stages of one task."""
