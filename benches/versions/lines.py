"""Lines of the table of two versions."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

HEAD = (
    "| work | before | after | gain | best peer | its figure | peer's, before | after | aim |\n"
    "| --- | ---: | ---: | ---: | --- | ---: | ---: | ---: | --- |"
)
NONE = "-"


@dataclass(frozen=True)
class Line:
    """A row."""

    work: str
    before: str
    after: str
    gain: float | None = None
    """How many times better the later version is: the median of pairs where there are pairs."""
    aim: str = ""
    peer: str = ""
    peer_figure: str = ""
    peer_before: float | None = None
    """How many times better the earlier version is than the peer."""
    peer_after: float | None = None

    def __str__(self) -> str:
        """Return the row in Markdown."""
        ratios = ["" if ratio is None else f"{ratio:.2f}" for ratio in (self.peer_before, self.peer_after)]
        gain = "" if self.gain is None else f"{self.gain:.2f}"
        cells = [self.work, self.before, self.after, gain, self.peer, self.peer_figure, *ratios, self.aim]
        return f"| {' | '.join(cells)} |"


def milliseconds(times_ms: Sequence[float]) -> str:
    """Return the median of times, in seconds from one second on."""
    median_ms = statistics.median(times_ms)
    return f"{median_ms:.3g} ms" if median_ms < 1000 else f"{median_ms / 1000:.2f} s"


def pairwise(above: Sequence[float], below: Sequence[float]) -> float:
    """Return the median of the ratios of pairs."""
    return statistics.median(a / max(b, 1e-9) for a, b in zip(above, below, strict=True))
