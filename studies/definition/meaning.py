"""Source text reduced to what it computes: words are left out, formulas and defaults are not.

What is left out, so that mending it changes no run's id:

- comments, blank lines, spacing, line breaks, and how a text is quoted or a number written;
- docstrings: every statement that is a text and nothing else;
- a text under a name of `WORDS`, given as an argument (``long_name="…"``) or as an item of a
  dict display (``{"long_name": "…"}``);
- a text at the place in a call that `WORDS_AT` tells: ``described(0.3, "…")``;
- a text given to an exception of Python in a ``raise``, or to one of our own errors wherever it is
  made, and the text of an ``assert``: a message says why there are no numbers, and makes none.

A text here is a literal, an f-string, a part of ``a + b`` or ``a if … else b`` that is one, or a
value of a dict display.
All else counts: numbers, names, operators, their order, annotations, imports, and any other text,
since that may be a name, a unit or a choice.
"""

from __future__ import annotations

import ast
import builtins
import gc
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import solver.errors
import studies.errors

WORDS = frozenset({"long_name", "description", "summary", "advice"})
"""Arguments and keys under which a text is words."""

WORDS_AT: Mapping[str, int] = {"described": 1, "declare": 1}
"""Functions and classes that take words by position, and at which."""

_ERRORS = frozenset(
    name
    for module in (solver.errors, studies.errors)
    for name, each in vars(module).items()
    if isinstance(each, type) and issubclass(each, Exception)
)

_RAISED = _ERRORS | {
    name
    for name, each in vars(builtins).items()
    if isinstance(each, type) and issubclass(each, Exception)
}

_NO_MEANING = frozenset({"ctx", "kind", "type_comment", "type_ignores"})
"""Fields of Python's grammar that repeat what its place tells, or that only comments fill."""


def meaning(source: bytes | str) -> str:
    """Return a text that is equal for two modules that differ in words only.

    It writes down the nodes of Python's grammar and their fields. An empty field is left out:
    newer versions of Python add such fields, and the text stays the same.
    """
    collecting = gc.isenabled()
    gc.disable()  # a tree is many small objects and no garbage: to look for some doubles the time
    try:
        written: list[str] = []
        _write(ast.parse(source), written, set())
        return "".join(written)
    finally:
        if collecting:
            gc.enable()


def _write(node: ast.AST, out: list[str], words: set[int]) -> None:
    """Append what `node` says; `words` are the ids of the nodes known to be words so far."""
    kind: Any = type(node)
    if id(node) in words:
        out.append("~")
        return
    if isinstance(node, ast.Constant):
        value = node.value
        out.append(f"{type(value).__name__}:{value!a}")
        return
    if kind in _HOLDERS:
        words.update(id(text) for text in _words_in(node))
    out.append(f"{kind.__name__}(")
    for name in _fields(kind):
        value = getattr(node, name, None)
        if value is None or value == []:
            continue
        out.append(f"{name}=")
        if isinstance(value, ast.AST):
            _write(value, out, words)
        elif isinstance(value, list):
            _write_list(value, out, words)
        else:  # an identifier, or a number of the grammar's own
            out.append(str(value))
        out.append(",")
    out.append(")")


def _write_list(items: list[Any], out: list[str], words: set[int]) -> None:
    """Append a list of nodes or identifiers without its statements that are only a text."""
    out.append("[")
    for item in items:
        if isinstance(item, ast.Expr) and _is_text(item.value):
            continue
        if isinstance(item, ast.AST):
            _write(item, out, words)
        else:  # an identifier, or None: ``**other`` in a dict display has no key
            out.append(str(item))
        out.append(",")
    out.append("]")


@cache
def _fields(kind: type[ast.AST]) -> tuple[str, ...]:
    """Return the fields of a kind of node that carry meaning."""
    return tuple(name for name in kind._fields if name not in _NO_MEANING)


_HOLDERS = frozenset({ast.Call, ast.Dict, ast.Raise, ast.Assert})
"""Kinds of nodes that may hold words."""


def _words_in(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes right below a node that are words."""
    match node:
        case ast.Call():
            name = _called(node)
            if name in _ERRORS:
                yield from _arguments(node)
            for place, argument in enumerate(node.args):
                if WORDS_AT.get(name) == place:
                    yield from _texts(argument)
            for keyword in node.keywords:
                if keyword.arg in WORDS:
                    yield from _texts(keyword.value)
        case ast.Dict():
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and key.value in WORDS:
                    yield from _texts(value)
        case ast.Raise(exc=ast.Call() as made) if _called(made) in _RAISED:
            yield from _arguments(made)
        case ast.Assert(msg=ast.AST() as message):
            yield from _texts(message)


def _called(call: ast.Call) -> str:
    """Return the last name of what is called; nothing where it has none."""
    function = call.func
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""


def _arguments(call: ast.Call) -> Iterator[ast.AST]:
    """Yield the texts among the arguments of a call."""
    for argument in (*call.args, *(keyword.value for keyword in call.keywords)):
        yield from _texts(argument)


def _texts(node: ast.expr) -> Iterator[ast.AST]:
    """Yield the texts a node consists of, if it does."""
    if _is_text(node):
        yield node
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        yield from _texts(node.left)
        yield from _texts(node.right)
    elif isinstance(node, ast.Dict):
        for value in node.values:
            yield from _texts(value)
    elif isinstance(node, ast.IfExp):
        yield from _texts(node.body)
        yield from _texts(node.orelse)


def _is_text(node: ast.expr) -> bool:
    literal = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return literal or isinstance(node, ast.JoinedStr)
