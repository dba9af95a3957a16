"""An engine that answers every action with the same bytes: the floor under any engine, the client's own cost.

`canned_engine.py ANSWER` speaks AI2-THOR's FIFO protocol; ANSWER holds `HEAD TAIL` of the metadata around the sequence
id, and the image fields, pickled. Imports nothing that an engine could do without.
"""

import json
import os
import pickle
import struct
import sys
from pathlib import Path

HEADER = struct.Struct("!BI")


def main() -> None:
    """See the module."""
    head, tail, images = pickle.loads(Path(sys.argv[1]).read_bytes())
    # The client opens its ends in this order, each with its first use.
    with Path(os.environ["AI2THOR_FIFO_SERVER_PIPE_PATH"]).open("wb", buffering=0) as answers:
        answers.write(_message(head, tail, images, 0))
        requests = Path(os.environ["AI2THOR_FIFO_CLIENT_PIPE_PATH"]).open("rb")  # noqa: SIM115
        while header := requests.read(HEADER.size):
            body = requests.read(HEADER.unpack(header)[1])
            requests.read(HEADER.size)
            answers.write(_message(head, tail, images, json.loads(body)["sequenceId"]))


def _message(head: bytes, tail: bytes, images: bytes, sequence_id: int) -> bytes:
    metadata_bytes = len(head) + 5 + len(tail)
    return b"".join(
        [HEADER.pack(1, metadata_bytes), head, struct.pack(">BI", 0xCE, sequence_id), tail, images, HEADER.pack(255, 0)]
    )


if __name__ == "__main__":
    main()
