"""`import evonav` is fast and needs only numpy; the command starts fast too."""

import json
import subprocess
import sys

HEAVY = ("matplotlib", "pandas", "pyarrow", "openai", "torch", "ray", "scipy", "cv2", "open3d", "ai2thor")


def _python(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout


def test_import_is_fast_and_light() -> None:
    code = (
        "import json, sys, time; start = time.process_time(); import evonav;"
        "print(json.dumps([time.process_time() - start, sorted(sys.modules)]))"
    )
    seconds, modules = min(json.loads(_python(code)) for _ in range(3))
    assert seconds < 0.1
    assert not {name.partition(".")[0] for name in modules} & {*HEAVY, "pydantic", "rich", "typer", "jinja2", "PIL"}


def test_the_command_starts_without_heavy_modules() -> None:
    code = "import json, sys, evonav.cli; print(json.dumps(sorted(sys.modules)))"
    assert not {name.partition(".")[0] for name in json.loads(_python(code))} & set(HEAVY)
