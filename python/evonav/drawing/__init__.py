"""Draw floor plans from above as SVG: houses, maps of cells, object entries and paths."""
