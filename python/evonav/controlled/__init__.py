"""Measure what one change does, all else being equal: the Fixed / Not Fixed analysis."""
