"""Measure how fast a scene memory updates, and what it still believes after things have moved."""
