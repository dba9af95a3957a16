"""Draw and describe tasks."""
