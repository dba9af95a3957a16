"""The toy simulator in a process that is lost now and then; counts starts and calls in a folder."""

from pathlib import Path

from toy_house import ToySimulator

from evonav.errors import SimulatorLostError


class FlakySimulator(ToySimulator):
    """Is lost at the `lost_at`-th look into the house of `stage`, in the first `num_losses` processes."""

    def __init__(self, folder, stage, lost_at, num_losses):
        super().__init__()
        self._starts = Path(folder) / "starts"
        self._is_flaky = self._count() < num_losses
        with self._starts.open("a") as file:
            file.write("x")
        self._stage, self._lost_at = stage, lost_at
        self._num_resets = self._num_renders = 0

    def _count(self):
        return len(self._starts.read_text()) if self._starts.exists() else 0

    def reset(self, *arguments):
        self._num_resets += 1
        self._num_renders = 0
        return super().reset(*arguments)

    def render(self, *arguments, **keywords):
        self._num_renders += 1
        if self._is_flaky and self._num_resets == self._stage and self._num_renders == self._lost_at:
            raise SimulatorLostError("the process is gone")
        return super().render(*arguments, **keywords)


def make(folder, stage=2, lost_at=3, num_losses=1):
    return FlakySimulator(folder, stage, lost_at, num_losses)
