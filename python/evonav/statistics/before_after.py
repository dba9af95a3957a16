"""Hold one number of two runs of the same measurement, and whether it became worse."""

from dataclasses import dataclass

from evonav.statistics.interval import Interval


@dataclass(frozen=True, slots=True)
class BeforeAfter:
    """One number before and now."""

    name: str
    before: float
    now: float
    is_worse: bool
    """Whether it is worse by more than chance explains."""
    is_better: bool = False
    ci95: Interval | None = None
    """Interval of the difference over houses, where it is known."""

    def __str__(self) -> str:
        """Return the change in words: `path, ms: 0.07 -> 0.15 (2.14 times as much)`."""
        factor = f"{self.now / self.before:.2f} times as much" if self.before > 0 else "from nothing"
        return f"{self.name}: {self.before:.3g} -> {self.now:.3g} ({factor})"
