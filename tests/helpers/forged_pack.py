"""Take packed runs apart and put them together again as a forger would, who corrects every checksum and score."""

import hashlib
import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evonav.evaluation.episode.motion import polyline_length_m
from evonav.evaluation.metrics.scoring import score_stage
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.submission.pack import packed_summary
from evonav.submission.verify import Verdict


def line_of(row: dict[str, Any]) -> bytes:
    """A record as evonav writes it, if its values are."""
    return json.dumps(row, separators=(",", ":"), ensure_ascii=False).encode()


@dataclass
class ForgedPack:
    """The parts of a packed run, to be altered."""

    header: dict[str, Any]
    rows: list[list[dict[str, Any]]]
    """Records as JSON values, by agent."""

    @classmethod
    def of(cls, path: Path) -> "ForgedPack":
        with zipfile.ZipFile(path) as archive:
            header = json.loads(archive.read("submission.json"))
            members = [archive.read(part["member"]) for part in header["records"]]
        return cls(header, [[json.loads(line) for line in member.splitlines()] for member in members])

    def members(self) -> list[bytes]:
        return [b"".join(line_of(row) + b"\n" for row in mine) for mine in self.rows]

    def told(self, members: list[bytes]) -> bytes:
        """The header with the checksums of members."""
        for part, member in zip(self.header["records"], members, strict=True):
            part |= {"num_bytes": len(member), "sha256": hashlib.sha256(member).hexdigest()}
        return json.dumps(self.header).encode()

    def claim(self) -> None:
        """Claim the scores that follow from the records."""
        records = {
            part["agent"]: [StageRecord.model_validate(row, strict=False) for row in mine]
            for part, mine in zip(self.header["records"], self.rows, strict=True)
        }
        self.header["summary"] = packed_summary(records, sum(task["num_stages"] for task in self.header["tasks"]))

    def write(self, path: Path, *, header: bytes | None = None, members: list[bytes] | None = None) -> Path:
        """Write the pack; a header or members may be given as bytes, from which checksums are computed."""
        members = self.members() if members is None else members
        header = self.told(members) if header is None else header
        return zipped(path, {"submission.json": header, **{f"records/{n}.jsonl": m for n, m in enumerate(members, 1)}})


def zipped(path: Path, contents: dict[str, bytes]) -> Path:
    """Write an archive; a large member is stored as it is, because a few repeated bytes would be suspiciously small."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in contents.items():
            archive.writestr(name, data, zipfile.ZIP_STORED if len(data) > 200_000 else zipfile.ZIP_DEFLATED)
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
        "stop_reason": record.trace[-1].action.reason or "",
        "path_length_m": length_m,
        "start_distance_m": score.start_distance_m,
        "terminal_distance_m": score.terminal_distance_m,
        "spl": score.spl,
        "soft_spl": score.soft_spl,
    }


def assert_rejected(verdict: Verdict, check: str, reason: str) -> None:
    """The first check that a file fails, and why."""
    failed = [(one.name, one.detail) for one in verdict.checks if not one.is_passed]
    assert failed, "accepted"
    name, detail = failed[0]
    assert name == check, failed
    assert re.search(reason, detail), failed
