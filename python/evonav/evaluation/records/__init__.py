"""Define, convert and store what a run records of each stage."""
