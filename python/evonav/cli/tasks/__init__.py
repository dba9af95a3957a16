"""Commands that make, check and describe tasks and houses."""
