"""Name the machine that something was measured on."""

import platform
from pathlib import Path


def machine_name() -> str:
    """Return processor, system and version of Python."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model)
    return f"{model}, {platform.system()}, Python {platform.python_version()}"
