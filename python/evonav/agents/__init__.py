"""Agents, one paper a file."""
