"""The latest of what was made, each until what it was made of has changed."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Cache(Generic[T]):
    """Keeps what was asked for last.

    Parameters
    ----------
    most : largest size of all together
    size : gives the size of one; by default each counts as one
    """

    def __init__(self, most: int, size: Callable[[T], int] = lambda one: 1) -> None:
        self.most, self.size, self.total = most, size, 0
        self._kept: OrderedDict[Hashable, tuple[object, T]] = OrderedDict()

    def __iter__(self) -> Iterator[Any]:
        return iter(self._kept)

    def get(self, key: Hashable, of: object = None) -> T | None:
        """Return what is kept under a key; None if there is nothing, or it was made of another."""
        before, one = self._kept.get(key, (of, None))
        if one is None or before != of:
            return None
        self._kept.move_to_end(key)
        return one

    def put(self, key: Hashable, one: T, of: object = None) -> T:
        """Keep one, and return it; what was asked for longest ago is forgotten."""
        self.forget(key)
        self._kept[key] = of, one
        self.total += self.size(one)
        while self.total > self.most:
            self.forget(next(iter(self._kept)))
        return one

    def forget(self, key: Hashable) -> None:
        """Forget what is kept under a key."""
        if key in self._kept:
            self.total -= self.size(self._kept.pop(key)[1])
