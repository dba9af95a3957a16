"""The rivals: other ways to keep a memory or to explore, on Frontier-Update."""
