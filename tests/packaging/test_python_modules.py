"""No import between Python modules closes a circle, and no folder or file of source grows out of sight."""

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


def test_folders_and_files_of_source_stay_small() -> None:
    files = [path for folder in ("python/evonav", "rust") for path in (ROOT / folder).rglob("*.[pr][ys]")]
    files = [path for path in files if "tests" not in path.parts and "target" not in path.parts]
    crowded = Counter(path.parent for path in files if path.name not in ("__init__.py", "mod.rs"))
    assert {str(folder): count for folder, count in crowded.items() if count > MAX_FILES} == {}
    lengths = {str(path): len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {path: length for path, length in lengths.items() if length > MAX_LINES} == {}
