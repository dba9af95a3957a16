"""Task generation (paper, Algorithm 1)."""
