"""Lay out tables as text, Markdown, HTML and LaTeX."""
