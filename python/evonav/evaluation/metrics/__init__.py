"""Compute success, SPL and all other metrics from records."""
