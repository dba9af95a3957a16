"""Maps of houses and of what happened in them, as SVG, and as PNG and PDF files."""
