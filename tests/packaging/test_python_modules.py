"""No import between Python modules closes a circle."""

import graphlib

import grimp


def test_no_import_closes_a_circle() -> None:
    graph = grimp.build_graph("evonav", exclude_type_checking_imports=True)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    graphlib.TopologicalSorter(imports).prepare()  # raises CycleError, which names the modules
