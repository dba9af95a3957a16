"""The metrics of the memory benchmark, each in a small function (docs/memory-benchmark.md defines them)."""
