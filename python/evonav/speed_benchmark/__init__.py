"""Measure how long parts of evonav take, beside other libraries on the same inputs in the same run."""
