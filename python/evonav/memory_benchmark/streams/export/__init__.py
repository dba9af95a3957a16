"""Streams as files: for programs of any language, and recordings of one's own (docs/memory-benchmark.md)."""

from evonav.memory_benchmark.streams.export.read import ExportedStream, read_exported
from evonav.memory_benchmark.streams.export.recording import Recording, read_recording
from evonav.memory_benchmark.streams.export.write import export_stream

__all__ = ["ExportedStream", "Recording", "export_stream", "read_exported", "read_recording"]
