"""An agent's input: observations and visible occupancy."""
