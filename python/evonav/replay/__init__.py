"""Replay recorded episodes for the viewer, for film and for rerun."""
