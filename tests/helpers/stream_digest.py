"""The digest of a stream of the memory benchmark."""

from evonav.memory_benchmark.truth import Digest, Stream


def digest(stream: Stream) -> str:
    """Read all frames and all truth of a stream, and return their digest."""
    hashed = Digest(stream)
    for frame, truth in stream.frames():
        hashed.add(frame, truth)
    return hashed.hexdigest()
