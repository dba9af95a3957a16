"""The examples that know the files only give what the same memories give in this process."""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from evonav.memory_benchmark.offline import score
from evonav.memory_benchmark.open3d_faiss import Open3DFaissMemory
from evonav.memory_benchmark.run import MeasureSettings, measure
from evonav.memory_benchmark.streams import make_stream
from evonav.memory_benchmark.streams.export.read import ExportedStream
from evonav.memory_benchmark.streams.export.write import export_stream
from evonav.memory_benchmark.streams.spec import StreamSpec

EXAMPLES = Path(__file__).parents[2] / "examples"
FOLDER = EXAMPLES / "foreign_memory"
COMPILER = shutil.which("g++")
HAS_PEER = find_spec("open3d") is not None and find_spec("faiss") is not None


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EVONAV_CACHE", str(tmp_path_factory.mktemp("cache")))
        return make_stream(StreamSpec("S1", "bundled:4", 0, 160, 120, frames_a_visit=8))


@pytest.fixture
def exported(stream, tmp_path):
    export_stream(stream, tmp_path / "stream")
    return tmp_path / "stream"


def require_same(folder, memory, stream):
    """Compare all counts of the judge; depth in files is rounded, so a few may differ."""
    theirs = score(ExportedStream(folder), folder / "entries.jsonl")
    ours = measure(memory, stream, MeasureSettings(own_process=False))
    assert ours.failure is None, ours.failure
    assert ours.update is not None
    assert theirs.update is not None
    assert ours.update.seen_remembered > 10
    for name in (
        "removals",
        "removals_done",
        "standing",
        "false_forgets",
        "entries",
        "right_entries",
        "seen",
        "seen_remembered",
    ):
        assert getattr(theirs.update, name) == pytest.approx(getattr(ours.update, name), abs=2), name
    assert theirs.speed is not None
    assert theirs.speed.observe_wall.p50_ms > 0
    assert theirs.size is not None
    assert theirs.size.num_bytes is not None
    return theirs


@pytest.mark.skipif(COMPILER is None or not Path("/usr/include/png.h").exists(), reason="needs g++ and libpng")
def test_the_program_in_cpp_gives_what_own_memory_gives(stream, exported, tmp_path):
    program = tmp_path / "entries"
    assert COMPILER is not None
    subprocess.run([COMPILER, "-std=c++17", FOLDER / "entries.cpp", "-lpng", "-o", program], check=True)
    subprocess.run([program, exported], check=True)
    require_same(exported, f"{EXAMPLES}/own_memory.py:OwnMemory", stream)
    nothing = subprocess.run([program, tmp_path], capture_output=True, text=True, check=False)
    assert nothing.returncode == 1
    assert "cam_params.json: cannot be read" in nothing.stderr
    (exported / "depth" / "000003.png").write_text("no image")
    damaged = subprocess.run([program, exported], capture_output=True, text=True, check=False)
    assert damaged.returncode == 1
    assert "000003.png: is no PNG" in damaged.stderr


def test_the_program_in_python_imports_nothing_of_evonav():
    text = (FOLDER / "open3d_faiss.py").read_text()
    assert not [line for line in text.splitlines() if "evonav" in line and line.lstrip().startswith(("import", "from"))]


@pytest.mark.skipif(not HAS_PEER, reason="needs the extra `bench`")
def test_the_program_in_python_gives_what_the_peer_gives(stream, exported):
    script = FOLDER / "open3d_faiss.py"
    subprocess.run([sys.executable, script, exported], check=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    require_same(exported, Open3DFaissMemory, stream)
