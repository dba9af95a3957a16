"""Run many evaluations from one file and compare them."""
