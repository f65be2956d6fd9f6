"""Cache of set-ups that a process keeps for its next runs, limited in bytes.

A set-up (mesh, operators, factors) grows while it is used. Kept values are therefore measured, with
all objects that they refer to, when another one is made and when `release` is called; the least
recently used ones are dropped first. A dropped value is found again while it is in use elsewhere.
"""

from __future__ import annotations

import ctypes
import gc
import os
import re
import resource
import sys
import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from functools import wraps
from hashlib import sha256
from types import FunctionType, ModuleType
from typing import Any, ParamSpec, TypeVar

import numpy as np

from solver.errors import ModelError
from solver.files import read_file

P = ParamSpec("P")
R = TypeVar("R")

SETTING, USUAL = "RESIDUA_KEPT_MEMORY", "300MB"
"""Environment variable with the most memory of kept values, such as ``"2GB"``, and its default."""
_SHARE = 16
"""Least ratio of the address space of a limited process to the memory of kept values. Of 1 GiB,
libraries use 640 MB, and a Gaussian process of 1000 runs uses 270 MB while it is made."""
_SIZE = re.compile(r"(\d+(?:\.\d+)?) ?([kMGT]?)(i?)B")
_GROWN, _FREE = 32_000_000, 128_000_000
"""Growth of a process, without kept values, that starts a garbage collection, and free memory that
is returned to the system [bytes]. With less, both would cost more than they gain."""


def bytes_in(text: str) -> int | None:
    """Return the bytes of a size such as ``"500MB"``, ``"2 GiB"``, ``"0B"``; None for others."""
    found = _SIZE.fullmatch(text)
    if found is None:
        return None
    number, prefix, binary = found.groups()
    return round(float(number) * (1024 if binary else 1000) ** " kMGT".index(prefix or " "))


def peak_memory() -> int:
    """Return the largest memory of this process so far [bytes].

    On Linux getrusage begins with that of the process that started this one.
    """
    with suppress(OSError, ValueError):
        (size,) = re.findall(rb"VmHWM:\s*(\d+) kB", read_file("/proc/self/status"))
        return 1024 * int(size)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most * (1 if sys.platform == "darwin" else 1024)


def most_kept() -> int:
    """Return the bytes that this process may keep, at most a share of its address space.

    Raises
    ------
    ModelError
        if the environment variable is not a size
    """
    text = os.environ.get(SETTING, USUAL)
    if (most := bytes_in(text)) is None:
        raise ModelError(SETTING, text, "must be a size such as 500MB or 2GB")
    space, _ = resource.getrlimit(resource.RLIMIT_AS)
    return most if space == resource.RLIM_INFINITY else min(most, space // _SHARE)


_KEPT: OrderedDict[Hashable, Any] = OrderedDict()
"""Values by key, the last used one at the end."""
_UNKNOWN: Any = object()
"""Placeholder of a value that is not kept."""
_PATH = object()
"""Key of a mark in `_KEPT`: values after it have been used since the last `release`."""
_IN_USE: weakref.WeakValueDictionary[Hashable, Any] = weakref.WeakValueDictionary()
"""Values in use, if weak references to them are possible."""
_LOCK = threading.RLock()


def remembered(key: Hashable, make: Callable[[], R]) -> R:
    """Return the value of a key, made anew if it is not kept.

    Before another value is made, the kept ones are reduced to the bytes of `most_kept`.
    """
    with _LOCK:
        value: R = _KEPT.get(key, _IN_USE.get(key, _UNKNOWN))
    if value is _UNKNOWN:
        _evict(most_kept())
        value = make()
    with _LOCK:
        _KEPT[key] = value
        _KEPT.move_to_end(key)
        with suppress(TypeError):  # some kinds of objects have no weak references
            _IN_USE[key] = value
    return value


def kept(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function of hashable arguments, to keep its results: see `remembered`.

    It replaces `functools.lru_cache` for results of megabytes.
    """

    @wraps(function)
    def known(*args: P.args, **kwargs: P.kwargs) -> R:
        key = (function, args, tuple(kwargs.items()))
        return remembered(key, lambda: function(*args, **kwargs))

    return known


def digest_of(*arrays: np.ndarray) -> str:
    """Return a hash of the content of arrays: a key of what is made of it."""
    digest = sha256()
    for array in arrays:
        digest.update(repr((array.shape, array.dtype.str)).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def release(most: int | None = None) -> None:
    """Drop kept values beyond a number of bytes, and return free memory to the system.

    Call it between two loading paths: it also frees cyclic garbage of a path, with the factors of
    its matrices.

    Parameters
    ----------
    most : number of bytes; by default `most_kept`, or more if the last path used more, because the
        next path of a study mostly has the same set-up
    """
    held = _evict(most_kept() if most is None else most, spare=most is None)
    with _LOCK:
        _KEPT[_PATH] = None
        _KEPT.move_to_end(_PATH)
    _HEAP.tidy(held)


def bytes_of(*values: object) -> list[int]:
    """Return the bytes of values with all objects that they refer to, each counted once."""
    seen: set[int] = set()
    return [_measured(value, seen) for value in values]


def _evict(most: int, *, spare: bool = False) -> int:
    """Drop the least recently used values beyond ``most`` bytes; return the bytes of the others.

    If ``spare``, values used since `release` are not dropped.
    """
    with _LOCK:
        keys, total = list(reversed(_KEPT)), 0
        sizes = bytes_of(*((key, _KEPT[key]) for key in keys))
        for key, size in zip(keys, sizes, strict=True):
            if key is _PATH:
                spare = False
            elif total + size > most and not spare:
                del _KEPT[key]
            else:
                total += size
    return total


def _measured(value: object, seen: set[int]) -> int:
    """Return the bytes of a value and of all objects that it refers to, except those ``seen``."""
    total, pending = 0, [value]
    while pending:
        each = pending.pop()
        if id(each) in seen or isinstance(each, type | ModuleType):
            continue
        seen.add(id(each))
        total += sys.getsizeof(each)
        if isinstance(each, np.ndarray):
            pending.append(each.base)  # has the memory of a view
        elif isinstance(each, FunctionType):
            pending.extend(each.__closure__ or ())  # not the module of the function
        else:
            pending.extend(gc.get_referents(each))
    return total


class _Usage(ctypes.Structure):
    """``struct mallinfo2`` of the GNU C library."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks",
                     "uordblks", "fordblks", "keepcost")
    )  # fmt: skip


class _Heap:
    """The memory of this process: collected when it has grown, returned when it is free."""

    def __init__(self) -> None:
        self._libc: ctypes.CDLL | None = ctypes.CDLL(None)
        self._least = 0
        try:
            self._libc.mallinfo2.restype = _Usage
        except AttributeError:  # another C library, which gives memory back by itself
            self._libc = None

    def tidy(self, held: int) -> None:
        """Free cyclic garbage, and return free memory to the system.

        Both cost as much as a small run, and are left out if they gain little: garbage is collected
        when the bytes in use, without those ``held`` by the cache, have grown since their minimum.
        """
        if self._libc is None:
            gc.collect()
            return
        others = self._in_use - held
        if others > self._least + _GROWN:
            gc.collect()
            self._least = others = self._in_use - held
        self._least = min(self._least, others)
        if self._libc.mallinfo2().fordblks > _FREE:
            self._libc.malloc_trim(0)

    @property
    def _in_use(self) -> int:
        """Bytes that the C library has allocated."""
        assert self._libc is not None
        usage = self._libc.mallinfo2()
        return int(usage.uordblks + usage.hblkhd)


_HEAP = _Heap()
