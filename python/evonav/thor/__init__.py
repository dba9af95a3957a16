"""An AI2-THOR-compatible engine: what `ai2thor.controller.Controller(local_executable_path=...)` starts for Unity.

The `ai2thor` package is not needed here: the engine is a process of its own that speaks its client's wire protocol
(`fifo`, `wsgi`). Degrees live in this package and nowhere below it.
"""
