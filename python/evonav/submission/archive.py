"""Read a zip archive that holds nothing but its members, one after the other, and the list of them.

Other programs read other parts of a zip than Python does: what lies before, between or behind the members, what a
member says of itself, its other names. Here all of these must agree, so that a file means the same to everybody.
Nothing is extracted to disk.
"""

import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from evonav.errors import StoreError

MAX_TOTAL_BYTES = 2 << 30
MAX_RATIO = 100
"""Largest ratio of uncompressed to compressed size of a member; records have 10 to 30."""
MAX_LIST_BYTES = 1 << 20
"""Largest list of members: about 20,000 of them."""
_END = struct.Struct("<4s4H2IH")
_MEMBER = struct.Struct("<4s5H3I2H")
_UTF8_NAME = 0x800


class SubmissionError(StoreError):
    """A file that is not a submission, or not a whole one."""


class Archive:
    """A zip archive whose list of members was checked."""

    def __init__(self, path: Path) -> None:
        """Open the archive, and check where its members lie, how large they are and how they are stored.

        Raises:
            SubmissionError: It is no zip archive, or one that could be read in two ways.
        """
        self.path = path
        with self._naming():
            if not stat.S_ISREG(path.stat().st_mode):  # a pipe would be waited for
                raise SubmissionError(f"{path}: not a submission (no regular file)")
            self._check_end()
            self._zip = zipfile.ZipFile(path)
        try:
            self._check_members()
        except BaseException:
            self._zip.close()
            raise

    def __enter__(self) -> "Archive":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._zip.close()

    @property
    def names(self) -> list[str]:
        """Names of the members, in order."""
        return self._zip.namelist()

    def date_of(self, name: str) -> tuple[int, int, int]:
        """Return year, month and day of a member's time stamp, which may be no date."""
        return self._zip.getinfo(name).date_time[:3]

    def read(self, name: str, max_bytes: int) -> bytes:
        """Return the contents of a member.

        Raises:
            SubmissionError: It is larger than `max_bytes`, or damaged.
        """
        size = self._zip.getinfo(name).file_size
        if size > max_bytes:
            raise SubmissionError(f"{self.path}: {name}: {size} B, the limit is {max_bytes}")
        with self._naming(name):
            return self._zip.read(name)

    def lines(self, name: str, max_bytes: int) -> Iterator[bytes]:
        """Yield the lines of a member without their ends.

        Raises:
            SubmissionError: A line is longer than `max_bytes` or not ended, or the member is damaged.
        """
        with self._naming(name), self._zip.open(name) as file:
            while line := file.readline(max_bytes + 1):
                if not line.endswith(b"\n"):
                    why = f"longer than {max_bytes} B" if len(line) > max_bytes else "without an end"
                    raise SubmissionError(f"{self.path}: {name}: a line {why}")
                yield line[:-1]

    @contextmanager
    def _naming(self, name: str = "") -> Iterator[None]:
        """Name the file, and a member, in the errors of the libraries that read it."""
        try:
            yield
        except (
            OSError,
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            NotImplementedError,
            RuntimeError,
            ValueError,
        ) as error:
            what = f"{name}: {type(error).__name__}: {error}" if name else f"not a submission ({error})"
            raise SubmissionError(f"{self.path}: {what}") from error

    def _check_end(self) -> None:
        """Check the end of the file, before the list of members that it names is read into memory."""
        with self.path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            if size > MAX_TOTAL_BYTES:
                raise SubmissionError(f"{self.path}: {size} B, the limit is {MAX_TOTAL_BYTES}")
            file.seek(max(0, size - _END.size))
            end = file.read(_END.size)
        if len(end) < _END.size or not end.startswith(b"PK\5\6"):
            raise SubmissionError(f"{self.path}: not a submission (no end of a zip archive, or more behind it)")
        _, disk, first_disk, here, all_there, list_bytes, list_start, comment = _END.unpack(end)
        if (disk, first_disk, comment) != (0, 0, 0) or here != all_there:
            raise SubmissionError(f"{self.path}: a comment, or an archive in several parts")
        if list_bytes > MAX_LIST_BYTES:
            raise SubmissionError(f"{self.path}: a list of members of {list_bytes} B, the limit is {MAX_LIST_BYTES}")
        if list_start + list_bytes + _END.size != size:
            raise SubmissionError(f"{self.path}: bytes before the members, or a list of them elsewhere")

    def _check_members(self) -> None:
        infos = self._zip.infolist()
        twice = sorted({info.filename for info in infos if self.names.count(info.filename) > 1})
        if twice:
            raise SubmissionError(f"{self.path}: {', '.join(map(repr, twice[:5]))} is there twice")
        total = sum(info.file_size for info in infos)
        if total > MAX_TOTAL_BYTES:
            raise SubmissionError(f"{self.path}: {total} B uncompressed, the limit is {MAX_TOTAL_BYTES}")
        place = 0
        with self._naming(), self.path.open("rb") as file:
            for info in sorted(infos, key=lambda info: info.header_offset):
                self._check_member(info)
                if info.header_offset != place:
                    raise SubmissionError(f"{self.path}: {info.filename!r}: bytes between the members, or two in one")
                file.seek(place)
                place += self._check_place(info, file.read(_MEMBER.size + len(info.filename)))
        if place != self._zip.start_dir:
            raise SubmissionError(f"{self.path}: bytes between the members and their list")

    def _check_member(self, info: zipfile.ZipInfo) -> None:
        where = f"{self.path}: {info.filename!r}"
        if stat.S_IFMT(info.external_attr >> 16) not in (0, stat.S_IFREG) or info.is_dir():
            raise SubmissionError(f"{where}: a link, a folder or a device")
        if info.flag_bits & ~_UTF8_NAME or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise SubmissionError(f"{where}: encrypted, or in another compression than deflate")
        if info.file_size > MAX_RATIO * max(1, info.compress_size):
            raise SubmissionError(f"{where}: {info.file_size} B from {info.compress_size}")
        if info.extra or info.comment or not info.filename.isascii():
            raise SubmissionError(f"{where}: a comment, other fields, or a name that is not ASCII")

    def _check_place(self, info: zipfile.ZipInfo, start: bytes) -> int:
        """Compare what a member says of itself with the list, and return how many bytes it takes."""
        own = _MEMBER.unpack(start[: _MEMBER.size].ljust(_MEMBER.size, b"\0"))
        sign, _, flags, method, _, _, crc, compressed, size, name_bytes, extra_bytes = own
        listed = (info.flag_bits, info.compress_type, info.CRC, info.compress_size, info.file_size)
        name = info.orig_filename.encode()
        if (
            sign != b"PK\3\4"
            or (flags, method, crc, compressed, size) != listed
            or (name_bytes, extra_bytes, start[_MEMBER.size :]) != (len(name), 0, name)
        ):
            raise SubmissionError(f"{self.path}: {info.filename!r}: says of itself what the list of members does not")
        return _MEMBER.size + len(name) + info.compress_size
