"""Measure parts of evonav alone, which bound what is around them from below."""
