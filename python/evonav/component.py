"""Build objects from import paths and options, which cross process borders as JSON."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, TypeVar, cast

from evonav.errors import InvalidArgumentError, StoreError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Component(Generic[T]):
    """A recipe for one part of a run, which is a `T`."""

    path: str
    """Import path of a class or function: `package.module:name`, or `path/to/file.py:name`."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Keyword arguments that decide results, as JSON. They are part of a run's identity."""
    host_options: Mapping[str, Any] = field(default_factory=dict)
    """Keyword arguments that depend on this machine (devices, addresses, files, limits), as JSON.

    They are not part of a run's identity.
    """

    @property
    def keywords(self) -> dict[str, Any]:
        """All keyword arguments."""
        return {**self.options, **self.host_options}

    def create(self, *arguments: object, **runtime: object) -> T:
        """Build the object.

        Args:
            *arguments: Positional arguments, such as a seed or a path.
            **runtime: Keyword arguments known only at run time.

        Raises:
            InvalidArgumentError: The path cannot be imported.
        """
        return cast("T", import_callable(self.path)(*arguments, **self.keywords, **runtime))

    def identity(self, name: str) -> dict[str, Any]:
        """Return the entries of a run header that describe this component: `name`, and `name_options` if it has any."""
        return {name: self.path} | ({f"{name}_options": dict(self.options)} if self.options else {})


def import_callable(path: str, kind: str = "") -> Callable[..., Any]:
    """Return the class or function at an import path.

    Args:
        path: `package.module:name`, or `path/to/file.py:name`.
        kind: A noun for what it makes, such as `agent`, for error messages.

    Raises:
        InvalidArgumentError: It cannot be imported, or is not callable.
    """
    module, _, name = path.rpartition(":")
    shown = f"{kind} `{path}`".strip()
    try:
        loaded = _file_module(module) if module.endswith(".py") else import_module(module)
    except Exception as error:  # importing runs other people's code, which may raise anything
        hint = _file_hint(error, module, name)
        raise InvalidArgumentError(f"{shown} cannot be imported: {type(error).__name__}: {error}{hint}") from error
    try:
        found = getattr(loaded, name)
    except AttributeError as error:
        raise InvalidArgumentError(f"{shown} cannot be imported: {_missing_name(loaded, name)}") from error
    if not callable(found):
        raise InvalidArgumentError(f"{shown} is not callable: name a class or a function")
    return cast("Callable[..., Any]", found)


def _file_hint(error: Exception, module: str, name: str) -> str:
    """Return a hint at the file `module.py` of this folder, if the module was not found and such a file is here."""
    file = Path(f"{module.replace('.', '/')}.py")
    if isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0] and file.is_file():
        return f"; did you mean `./{file.as_posix()}:{name}`?"
    return ""


def _missing_name(module: ModuleType, name: str) -> str:
    """Say that a module lacks a name, and name the classes that it defines or the nearest of its names."""
    own = [key for key, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__]
    near = get_close_matches(name, own, 1)
    known = ", ".join(own[:10])
    hint = (
        f"did you mean `{near[0]}`?" if near else f"it defines {known}" if known else "it defines no class or function"
    )
    return f"`{module.__name__}` has no `{name}`; {hint}"


def _file_module(path: str) -> ModuleType:
    """Load a Python file as a module by its own name, once; the module may import its neighbours."""
    file = Path(path).resolve()
    loaded = sys.modules.get(file.stem)
    if loaded is not None and getattr(loaded, "__file__", None) == str(file):
        return loaded
    if loaded is not None:
        raise ImportError(f"another module is called `{file.stem}`: rename the file")
    spec = spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise FileNotFoundError(f"no file {path}")
    module = module_from_spec(spec)
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    sys.modules[file.stem] = module  # before it runs, as import does: dataclasses look it up there
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[file.stem]
        raise
    return module


def optional_module(name: str, purpose: str, install: str) -> Any:  # noqa: ANN401 - a module
    """Return a module of a library that only some installations have.

    Args:
        purpose: Reason why the library is needed, for the message.
        install: Argument of `pip install` that installs it, in quotes where a shell needs them.

    Raises:
        StoreError: It cannot be imported.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise StoreError(f"{purpose} ({error}): pip install {install}") from error
