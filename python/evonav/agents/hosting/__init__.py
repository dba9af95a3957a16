"""Serve an agent in a process of its own, and write its answers as JSON."""
