"""Typed questions and who answers them."""
