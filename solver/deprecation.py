"""Old names that still work for one release, with a warning."""

from __future__ import annotations

import warnings
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

_Class = TypeVar("_Class", bound=type)


def renamed(**names: str) -> Callable[[_Class], _Class]:
    """Return a class decorator that still accepts old names: ``renamed(old="new")``.

    An old name, of an argument or of an attribute, stands for the new one and gives a
    `DeprecationWarning`.
    """

    def told(kind: type, old: str) -> None:
        text = (
            f"{kind.__name__}.{old} is called {kind.__name__}.{names[old]} now: use the new name, "
            "the old one will be removed"
        )
        warnings.warn(text, DeprecationWarning, stacklevel=3)

    def decorate(kind: _Class) -> _Class:
        make: Any = kind.__init__  # type: ignore[misc]

        @wraps(make)
        def init(self: Any, *args: Any, **given: Any) -> None:
            for old in names.keys() & given.keys():
                told(kind, old)
                if names[old] in given:
                    raise TypeError(f"{kind.__name__} got both {old} and {names[old]}")
                given[names[old]] = given.pop(old)
            make(self, *args, **given)

        kind.__init__ = init  # type: ignore[misc]
        for old, new in names.items():

            def read(self: Any, old: str = old, new: str = new) -> Any:
                told(kind, old)
                return getattr(self, new)

            setattr(kind, old, property(read))
        return kind

    return decorate
