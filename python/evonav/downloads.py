"""Download one file, whole and checked or not at all, with pooch."""

import logging
from pathlib import Path

TIMEOUT_S = 60.0
"""A host that sends nothing for so long is given up."""


def download(url: str, path: Path, sha256: str | None = None) -> None:
    """Bring a file to its place; a file that is there already and has the checksum stays.

    Args:
        url: Address, HTTP or HTTPS.
        path: Destination of the file. Its folder is made.
        sha256: Expected checksum, 64 hexadecimal digits; None takes whatever comes.

    Raises:
        requests.RequestException: The host cannot be reached or refuses.
        ValueError: The file has another checksum.
        OSError: The file cannot be written.
    """
    import pooch
    import requests

    pooch.get_logger().setLevel(logging.WARNING)
    try:
        pooch.retrieve(
            url,
            known_hash=None if sha256 is None else f"sha256:{sha256}",
            fname=path.name,
            path=path.parent,
            downloader=pooch.HTTPDownloader(timeout=TIMEOUT_S),
        )
    except requests.HTTPError as error:
        error.response.close()  # pooch leaves it open
        raise
