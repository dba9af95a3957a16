"""Plots as data, and their one renderer: matplotlib, to SVG in pages and to SVG, PNG and PDF files."""
