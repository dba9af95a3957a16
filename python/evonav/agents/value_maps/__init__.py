"""VLFM and OneMap: maps of values, and the agents that explore where the value is largest."""
