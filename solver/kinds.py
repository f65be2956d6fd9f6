"""Whether values are of the kinds that a dataclass or a function declares."""

from __future__ import annotations

import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Union

from solver.errors import ModelError, plain
from solver.parameters import is_number

_PLAIN: dict[Any, tuple[Callable[[object], bool], str]] = {
    float: (is_number, "a number"),
    int: (lambda value: isinstance(value, int) and not isinstance(value, bool), "an integer"),
    bool: (lambda value: isinstance(value, bool), "true or false"),
    str: (lambda value: isinstance(value, str), "text"),
    NoneType: (lambda value: value is None, "None"),
}


def check_kinds(kind: Any, declared: Any, within: str = "") -> None:
    """Raise `ModelError` for the first value that is not of the kind that its field declares.

    Parameters
    ----------
    kind : the dataclass; fields that a class derived from it adds are not checked
    declared : the object
    within : what stands before the name of the field in the message
    """
    for name, hint in _hints(kind):
        require(within + name, getattr(declared, name), hint)


def require(field: str, value: object, hint: Any) -> None:
    """Raise `ModelError` unless the value is of this kind; a list or an array is a tuple too."""
    if not _fits(value, hint):
        raise ModelError(field, value, f"must be {_words(hint)}")


@cache
def _hints(kind: Any) -> tuple[tuple[str, Any], ...]:
    hints = typing.get_type_hints(kind)
    return tuple((item.name, hints[item.name]) for item in fields(kind))


def _fits(value: Any, hint: Any) -> bool:
    of, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint][0](plain(value))
    if of is Literal:  # its words are in the message of the class with the field
        return True
    if of in (Union, UnionType):
        return any(_fits(value, part) for part in parts)
    if of is tuple:
        several = getattr(value, "ndim", 0) or isinstance(value, Sequence)
        if not several or isinstance(value, str):
            return False
        each = parts[:1] * len(value) if parts[-1] is Ellipsis else parts
        return len(value) == len(each) and all(map(_fits, value, each))
    if of is Mapping:
        return isinstance(value, Mapping) and all(
            _fits(key, parts[0]) and _fits(each, parts[1]) for key, each in value.items()
        )
    return isinstance(value, of or hint)


def _words(hint: Any) -> str:
    """Return a kind in words."""
    of, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint][1]
    words = [_words(part) for part in parts if part is not Ellipsis] if of else []
    if of in (Union, UnionType):
        return " or ".join(words)
    if of is tuple:
        return f"a tuple of {words[0]}" if Ellipsis in parts else f"a tuple ({', '.join(words)})"
    if of is Mapping:
        return "a dict of " + " to ".join(words)
    return "a function" if of is Callable else str(hint.__name__)
