"""Describe simulated errors of perception: presets, confused labels, drifting poses."""
