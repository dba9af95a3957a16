"""What a disk may hold after a loss of power, by the log of `faults.c`: only what was synced is sure to be there."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class File:
    """Contents: those that are safe, and what was done since."""

    safe: bytes = b""
    pending: list = field(default_factory=list)

    def after(self, changes):
        data = bytearray(self.safe)
        for offset, new in changes:
            if new is None:
                data = data[:offset].ljust(offset, b"\0")
            else:
                data = data.ljust(offset, b"\0")
                data[offset : offset + len(new)] = new
        return bytes(data)


def read_log(path):
    """Yields operation, path, offset and data."""
    with path.open("rb") as file:
        while head := file.readline():
            op, *name, offset, size = head.decode().split(" ")
            yield op, " ".join(name), int(offset), file.read(int(size))


class Disk:
    """A folder on a disk that loses power."""

    def __init__(self, folder):
        self.folder = folder
        self.names = {}
        """As programs see them."""
        self.safe_names = {}

    def do(self, op, path, offset, data):
        """An operation of the log."""
        if op in ("create", "empty"):
            file = self.names.setdefault(path, File())
            if op == "empty":
                file.pending.append((0, None))
        elif op == "write":
            self.names[path].pending.append((offset, data))
        elif op == "truncate":
            self.names[path].pending.append((offset, None))
        elif op == "sync" and path == self.folder:
            self.safe_names = dict(self.names)
        elif op == "sync":
            file = self.names[path]
            file.safe, file.pending = file.after(file.pending), []
        elif op == "rename":
            self.names[data.decode()] = self.names.pop(path)
        elif op == "unlink":
            self.names.pop(path, None)

    def leave(self, to, draw=None):
        """Writes what is there after the loss into a folder: what is sure, or a part of the rest too."""
        names = self.safe_names if draw is None or draw.random() < 0.5 else self.names
        for path, file in names.items():
            if path.endswith("-shm"):
                continue  # memory
            changes = [] if draw is None else [one for one in file.pending if draw.random() < 0.5]
            (to / Path(path).name).write_bytes(file.after(changes))
