"""Fuzz packed runs: whatever `verify` accepts claims the scores of the honest run, and nothing else happens."""

import copy
import gzip
import json
import random
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from forged_pack import ForgedPack, line_of, rescored
from mutation import json_bytes, mutated_bytes, mutated_json

from evonav.evaluation.run import components
from evonav.evaluation.run.evaluate import evaluate
from evonav.submission.pack import pack
from evonav.submission.verify import verify
from evonav.tasks.listing import BUNDLED_TASKS, TaskFile, task_files


@dataclass(frozen=True)
class Packs:
    """Mutated packed runs of one agent on one task."""

    folder: Path
    honest: bytes
    parts: ForgedPack
    tasks: list[TaskFile]
    summary: str

    @classmethod
    def made_in(cls, folder: Path) -> "Packs":
        components.load_spec = lru_cache(components.load_spec)  # the task to verify with is always the same
        path = folder / "honest.gz"
        tasks = task_files(BUNDLED_TASKS, 1)
        evaluate(["ftu"], tasks, folder / "run", num_workers=0)
        pack(folder / "run", path)
        verdict = verify(path, tasks, scores_only=True)
        assert verdict.is_accepted
        return cls(folder, path.read_bytes(), ForgedPack.of(path), tasks, json.dumps(verdict.summary))

    def case(self, draws: random.Random) -> bytes:
        """Return a mutated file; in most cases it is whole gzip, and in some its scores are right."""
        kind = draws.randrange(5)
        if kind == 0:
            return mutated_bytes(self.honest, draws)
        rows = list(self.parts.rows[0])
        parts = ForgedPack(copy.deepcopy(self.parts.header), [rows])
        lines = [line_of(row) for row in rows]
        if kind == 1:
            return self._packed([json_bytes(mutated_json(parts.header, draws)), *lines])
        if kind == 2:
            return gzip.compress(mutated_bytes(gzip.decompress(self.honest), draws), 1)
        at = draws.randrange(len(rows))
        rows[at] = mutated_json(rows[at], draws)
        if kind == 4:
            _make_consistent(parts, at)
        lines[at] = json_bytes(rows[at])
        return self._packed([line_of(parts.header), *lines])

    def run(self, data: bytes) -> str:
        """Verify a file; return the first check that it fails, or `accepted`.

        Where scores alone tell nothing, as of a longer reference path, the actions are executed again.

        Raises:
            AssertionError: It is accepted and has other scores than the honest one.
        """
        path = self.folder / "case.gz"
        path.write_bytes(data)
        verdict = verify(path, self.tasks, scores_only=True)
        if verdict.is_accepted and json.dumps(verdict.summary) != self.summary:
            verdict = verify(path, self.tasks)
            assert not verdict.is_accepted, "accepted with other scores"
        if verdict.is_accepted:
            return "accepted"
        return next(check.name for check in verdict.checks if not check.is_passed)

    def _packed(self, lines: list[bytes]) -> bytes:
        return self.parts.write(self.folder / "made.gz", lines).read_bytes()


def _make_consistent(parts: ForgedPack, at: int) -> None:
    """Make scores and summary follow from a changed record, where it is one still."""
    try:
        rescored(parts.rows[0][at])
        parts.claim()
    except (
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        AssertionError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ):
        pass
