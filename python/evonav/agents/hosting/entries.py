"""Write and read an agent's object memory again and again: only entries that have changed take time."""

from collections.abc import Sequence

from evonav.agents.agent import EntryBelief
from evonav.agents.hosting import wire
from evonav.errors import InvalidArgumentError

_BETWEEN = b",\t"
"""The JSON of an entry has no tab."""


class Entries:
    """The object memory of one agent, written and read as `wire.ENTRIES`."""

    def __init__(self) -> None:
        """Know no entries yet."""
        self._written: dict[int, tuple[object, bytes]] = {}
        """The entries that were written last, and their JSON, by the number of the object."""
        self._read: dict[bytes, EntryBelief] = {}
        """The entries that were read last, by their JSON."""

    def write(self, entries: Sequence[object]) -> bytes:
        """Return entries as JSON in one line; what was written before is not written again.

        Raises:
            InvalidArgumentError: An entry holds what JSON cannot, or they are too large together.
        """
        before, self._written = self._written, {}
        texts = []
        for entry in entries:
            pair = before.get(id(entry)) or (entry, wire.ENTRY.write(entry))
            texts.append(pair[1])
            if id(entry) in before or _is_constant(entry):
                self._written[id(entry)] = pair
        return wire.ENTRIES.checked(b"[%b]" % _BETWEEN.join(texts))

    def read(self, text: bytes) -> list[EntryBelief]:
        """Return the entries of a JSON text; one that was read before is the same object.

        Raises:
            InvalidArgumentError: The text is malformed; the message has the first field that is wrong, and its value.
        """
        is_list = wire.ENTRIES.checked(text).startswith(b"[") and text.endswith(b"]")
        texts = text[1:-1].split(_BETWEEN) if is_list else [text]
        try:
            entries = [self._read.get(one) or wire.ENTRY.read(one) for one in texts]
        except InvalidArgumentError:
            return wire.ENTRIES.read(text)  # which says where in the list it is wrong
        self._read = dict(zip(texts, entries, strict=True))
        return entries


def _is_constant(entry: object) -> bool:
    """Return whether an entry cannot change, nor anything in it: then it has a hash."""
    try:
        hash(entry)
    except TypeError:
        return False
    return type(entry) is EntryBelief
