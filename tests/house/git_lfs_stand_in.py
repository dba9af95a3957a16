"""Of git-lfs only what `prior` calls: `install`, `fetch origin` and `checkout`, for a remote that is a folder.

The real program is used where it is installed; this one lets the tests run where it is not. The layout of the remote,
and what a checkout leaves, are those of the real one.
"""

import re
import subprocess
import sys
from pathlib import Path


def git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], check=True, capture_output=True, text=True).stdout


def checkout() -> None:
    remote = Path(git("ls-remote", "--get-url", "origin").strip().removeprefix("file://"))
    for name in git("ls-files").splitlines():
        found = re.match(r"version https://git-lfs\S*\noid sha256:(([0-9a-f]{2})([0-9a-f]{2})\S*)", _text(Path(name)))
        if found:
            Path(name).write_bytes((remote / "lfs/objects" / found[2] / found[3] / found[1]).read_bytes())


def _text(path: Path) -> str:
    return path.read_bytes()[:1024].decode(errors="replace")


if __name__ == "__main__":
    if sys.argv[1:] == ["checkout"]:
        checkout()
    elif sys.argv[1:] not in ([], ["install"], ["fetch", "origin"]):
        sys.exit(f"git-lfs: unexpected {sys.argv[1:]}")
