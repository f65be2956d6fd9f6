"""Attributes that `Law` computes and a subclass may define as fields instead."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class attribute(Generic[T]):  # noqa: N801
    """A property that a subclass may replace by a field of its dataclass.

    With a plain property, ``dataclass`` would take the property for the field's default value,
    and the field could not be set.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__

    def __get__(self, instance: Any, owner: type) -> T:
        """Return the value for an instance; the class itself has none."""
        if instance is None:
            raise AttributeError(f"{owner.__name__}.{self._compute.__name__}")
        return self._compute(instance)
