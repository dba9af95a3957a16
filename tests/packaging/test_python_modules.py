"""No import between Python modules closes a circle, no file is long, and no folder of source holds many files."""

import graphlib
from collections import Counter
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
MAX_FILES, MAX_LINES = 15, 400


def test_no_import_closes_a_circle() -> None:
    graph = grimp.build_graph("evonav", exclude_type_checking_imports=True)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    graphlib.TopologicalSorter(imports).prepare()  # raises CycleError, which names the modules


def files_below(*folders: str) -> list[Path]:
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.[pr][ys]")]
    return [path for path in files if "target" not in path.parts]


def test_files_stay_short() -> None:
    files = files_below("python/evonav", "rust", "tests", "scripts", "benches", "examples")
    assert len(files) > 500  # of Rust and Python, sources and tests
    lengths = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {path: length for path, length in lengths.items() if length > MAX_LINES} == {}


def test_folders_of_source_stay_small() -> None:
    files = [path for path in files_below("python/evonav", "rust") if "tests" not in path.parts]
    numbers = Counter(str(path.parent) for path in files if path.name not in ("__init__.py", "mod.rs"))
    assert {folder: number for folder, number in numbers.items() if number > MAX_FILES} == {}
