"""Summarise and show the records of the memory benchmark."""
