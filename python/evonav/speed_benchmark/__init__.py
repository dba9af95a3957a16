"""Measure how long parts of evonav take, compared with other libraries on the same inputs in the same run."""
