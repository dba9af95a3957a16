"""Register the Gymnasium environments as soon as Gymnasium is imported, without importing it.

Gymnasium has no entry points for packages that bring environments, so `import evonav` watches for its import.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType


def register_when_imported() -> None:
    """Make `evonav/LifelongNav-v0` known to Gymnasium: now if it is imported already, else right after its import."""
    if "gymnasium" in sys.modules:
        _register()
    else:
        sys.meta_path.insert(0, _GymnasiumWatcher())


def _register() -> None:
    import_module("evonav.gym.registration").register()


class _GymnasiumWatcher:
    """Finds Gymnasium as all other finders would, and registers the environments once it has been executed.

    It has no base class: importing `importlib.abc` would take longer than `import evonav`.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of `gymnasium` with a loader that registers; `None` for every other module."""
        if fullname != "gymnasium":
            return None
        others = (finder for finder in sys.meta_path if finder is not self)
        spec = next(filter(None, (finder.find_spec(fullname, path, target) for finder in others)), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def execute_and_register(module: ModuleType) -> None:
                execute(module)
                if self in sys.meta_path:
                    sys.meta_path.remove(self)
                    _register()

            vars(spec.loader)["exec_module"] = execute_and_register
        return spec
