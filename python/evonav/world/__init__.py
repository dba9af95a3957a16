"""Simulators of a house, behind one protocol."""
