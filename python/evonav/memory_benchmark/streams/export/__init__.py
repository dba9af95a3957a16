"""Streams as files: for programs of any language, and recordings of one's own (docs/memory-benchmark.md)."""
