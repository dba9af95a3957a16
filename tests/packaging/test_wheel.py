"""The wheel works outside the tree: built, unpacked by pip, and run with nothing of the repository on its path."""

import email
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
REPOSITORY = Path(__file__).parents[2]
MAX_WHEEL_BYTES = 13_000_000


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    maturin = shutil.which("maturin", path=Path(sys.executable).parent)
    if maturin is None:
        pytest.skip("maturin is not beside this Python")
    out = tmp_path_factory.mktemp("wheel")
    subprocess.run([maturin, "build", "--release", "--quiet", "--out", out], cwd=REPOSITORY, check=True)
    (built,) = out.glob("evonav-*.whl")
    return built


def test_wheel_is_abi3_and_holds_types_and_data(wheel: Path) -> None:
    assert "-cp310-abi3-" in wheel.name
    assert wheel.stat().st_size < MAX_WHEEL_BYTES
    names = zipfile.ZipFile(wheel).namelist()
    assert {"evonav/py.typed", "evonav/_core.pyi", "evonav/data/houses.jsonl.gz"} <= set(names)
    data_bytes = sum(info.compress_size for info in zipfile.ZipFile(wheel).infolist() if "/data/" in info.filename)
    assert data_bytes < 9_000_000


def test_metadata_of_the_wheel_has_the_readme_with_absolute_links(wheel: Path) -> None:
    archive = zipfile.ZipFile(wheel)
    (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
    metadata = email.message_from_string(archive.read(name).decode())
    assert metadata["Description-Content-Type"].startswith("text/markdown")
    assert {"Author", "Keywords", "License-Expression", "License-File", "Requires-Python"} <= set(metadata)
    assert len(metadata.get_all("Project-URL")) >= 4
    page = re.sub(r"^```.*?^```", "", str(metadata.get_payload()), flags=re.DOTALL | re.MULTILINE)
    targets = re.findall(r"\]\(([^)\s]+)\)", page)
    assert targets
    assert [target for target in targets if not target.startswith(("https://", "#"))] == []


def test_installed_wheel_runs_the_demo_elsewhere(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", site, wheel]
    subprocess.run(pip, check=True)
    environment = {**os.environ, "PYTHONPATH": str(site)}
    where = [sys.executable, "-c", "import evonav; print(evonav.__file__)"]
    found = subprocess.run(where, check=True, cwd=tmp_path, env=environment, capture_output=True, text=True).stdout
    assert Path(found.strip()).is_relative_to(site)
    demo = [sys.executable, "-m", "evonav", "demo", "--limit", "1", "--out", "demo"]
    subprocess.run(demo, check=True, cwd=tmp_path, env=environment)
    assert (tmp_path / "demo" / "summary.json").is_file()
    assert (tmp_path / "demo" / "report.html").is_file()
