"""Take packed runs apart and put them together again as a forger would, who corrects every score."""

import gzip
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evonav.evaluation.episode.motion import polyline_length_m
from evonav.evaluation.metrics.scoring import score_stage
from evonav.evaluation.metrics.stage_metrics import metrics_of
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.submission.pack import brief, packed_summary
from evonav.submission.verify import PackVerdict


def line_of(row: dict[str, Any]) -> bytes:
    """A header or record as evonav writes it, if its values are."""
    return json.dumps(row, separators=(",", ":"), ensure_ascii=False).encode()


@dataclass
class ForgedPack:
    """The parts of a packed run, to be altered."""

    header: dict[str, Any]
    rows: list[list[dict[str, Any]]]
    """Records as JSON values, by agent."""

    @classmethod
    def of(cls, path: Path) -> "ForgedPack":
        header, *rows = map(json.loads, gzip.decompress(path.read_bytes()).splitlines())
        return cls(header, [[row for row in rows if row["agent"] == agent] for agent in header["agents"]])

    def lines(self) -> list[bytes]:
        """The header, and each record."""
        return [line_of(self.header), *(line_of(row) for mine in self.rows for row in mine)]

    def claim(self) -> None:
        """Claim the scores that follow from the records."""
        rows = {
            agent: [metrics_of(brief(StageRecord.model_validate(row, strict=False))) for row in mine]
            for agent, mine in zip(self.header["agents"], self.rows, strict=True)
        }
        summary = packed_summary(rows, sum(task["num_stages"] for task in self.header["tasks"]))
        self.header["summary"] = summary

    def write(self, path: Path, lines: list[bytes] | None = None) -> Path:
        """Write the pack, or these lines in place of its own."""
        return gzipped(path, b"".join(line + b"\n" for line in (self.lines() if lines is None else lines)))


def gzipped(path: Path, data: bytes) -> Path:
    path.write_bytes(gzip.compress(data, 1))
    return path


def rescored(row: dict[str, Any]) -> None:
    """Make a record's lengths, distances and scores follow from its path, start, end, target and reference length."""
    record = StageRecord.model_validate(row, strict=False)
    start, end = record.effective_start, record.terminal
    assert start is not None
    assert end is not None
    length_m = sum(polyline_length_m(part.path_m) for part in record.trace)
    score = score_stage(
        (start.x_m, start.z_m),
        (end.x_m, end.z_m),
        record.target_m_at_end[::2],
        path_length_m=length_m,
        reference_length_m=record.reference_length_m,
        target_at_start_m=record.target.position_m[::2],
    )
    row |= {
        "state": (EndState.SUCCESS if score.is_success else EndState.FAILURE).value,
        "num_rounds": len(record.trace),
        "num_target_visible_rounds": sum(part.is_target_visible for part in record.trace),
        "has_stopped": record.trace[-1].action.kind == "stop",
        "stop_reason": getattr(record.trace[-1].action, "reason", ""),
        "path_length_m": length_m,
        "start_distance_m": score.start_distance_m,
        "terminal_distance_m": score.terminal_distance_m,
        "spl": score.spl,
        "soft_spl": score.soft_spl,
    }


def assert_rejected(verdict: PackVerdict, check: str, reason: str) -> None:
    """The first check that a file fails, and why."""
    failed = [(one.name, one.detail) for one in verdict.checks if not one.is_passed]
    assert failed, "accepted"
    name, detail = failed[0]
    assert name == check, failed
    assert re.search(reason, detail), failed
