"""Timings against the libraries people use today, in the same run on the same data: `python -m benches`."""
