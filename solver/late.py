"""Late imports, at first use: public names of a package, functions of a scene, parts of libraries.

Scenes are thus listed without importing the modules that compute them.
"""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec
from pkgutil import resolve_name
from typing import Any

# A search for garbage at the end, among all that libraries have loaded, takes 0.1 to 0.3 s.
atexit.register(gc.freeze)


@contextmanager
def no_search() -> Iterator[None]:
    """Look for no garbage while modules are loaded.

    Modules make many objects and no garbage: the search takes a sixth of the time to load them.
    """
    searched = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if searched:
            gc.enable()


def used_late(name: str) -> None:
    """Let a module of a package be loaded when it is first used, by whoever imports it.

    SciPy copies all names of NumPy, and so loads `numpy.f2py` and `numpy.testing` for nothing.
    """
    spec = None if name in sys.modules else find_spec(name)
    if spec is not None and spec.loader is not None:
        spec.loader = LazyLoader(spec.loader)
        module = sys.modules[name] = module_from_spec(spec)
        spec.loader.exec_module(module)
        package, _, own = name.rpartition(".")
        setattr(sys.modules[package], own, module)


@dataclass(frozen=True)
class Late:
    """A function whose module is imported at the first call.

    Attributes
    ----------
    name : ``module:function``
    """

    name: str

    def __post_init__(self) -> None:
        module, _, function = self.name.partition(":")
        vars(self).update(__module__=module, __qualname__=function)  # those of the function

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Return the result of the function."""
        with no_search():
            function = resolve_name(self.name)
        return function(*given, **named)


def late(module: str, *functions: str) -> tuple[Late, ...]:
    """Return late functions of a module of the solver."""
    return tuple(Late(f"solver.{module}:{function}") for function in functions)


def front(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package that imports its public names at first use.

    Parameters
    ----------
    homes : public name -> module of the package that defines it
    """

    def public(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        with no_search():
            return getattr(import_module(f"{package}.{homes[name]}"), name)

    return public
