"""Source text reduced to its syntax tree: comments, layout and docstrings are left out.

Everything else counts: numbers, names, operators, their order, annotations, imports, and all texts,
because a text may be a name, a unit or a choice.
"""

from __future__ import annotations

import ast
import gc
from functools import cache
from typing import Any

_NO_MEANING = frozenset({"ctx", "kind", "type_comment", "type_ignores"})
"""Fields of Python's grammar that follow from the position of a node, or come from comments."""


def meaning(source: bytes | str) -> str:
    """Return a text that is equal for two modules that differ in comments and docstrings only.

    The text lists the nodes of Python's grammar and their fields. An empty field is left out, so
    that the text stays the same when a newer version of Python adds fields.
    """
    collecting = gc.isenabled()
    gc.disable()  # a tree has many small objects and no garbage: collecting would double the time
    try:
        written: list[str] = []
        _write(ast.parse(source), written)
        return "".join(written)
    finally:
        if collecting:
            gc.enable()


def _write(value: Any, out: list[str]) -> None:
    """Append a node, a list of nodes without its docstrings, or an identifier."""
    if isinstance(value, ast.Constant):
        out.append(f"{type(value.value).__name__}:{value.value!a}")
    elif isinstance(value, ast.AST):
        kind: Any = type(value)
        out.append(f"{kind.__name__}(")
        for name in _fields(kind):
            item = getattr(value, name, None)
            if item is not None and item != []:
                out.append(f"{name}=")
                _write(item, out)
                out.append(",")
        out.append(")")
    elif isinstance(value, list):
        out.append("[")
        for item in value:
            if not (isinstance(item, ast.Expr) and _is_text(item.value)):
                _write(item, out)
                out.append(",")
        out.append("]")
    else:  # an identifier, a number of the grammar's own, or None: ``**other`` has no key
        out.append(str(value))


@cache
def _fields(kind: type[ast.AST]) -> tuple[str, ...]:
    """Return the fields of a kind of node that carry meaning."""
    return tuple(name for name in kind._fields if name not in _NO_MEANING)


def _is_text(node: ast.expr) -> bool:
    literal = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return literal or isinstance(node, ast.JoinedStr)
