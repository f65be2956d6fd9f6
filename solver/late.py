"""Late imports, at first use: public names of a package, functions of a scene.

Scenes are thus listed without importing the modules that compute them.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pkgutil import resolve_name
from typing import Any


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
