"""Run a benchmarked memory in this process or in one of its own."""
