"""Measure two versions of evonav in turn."""
