"""Measure perceptions against the truth."""
