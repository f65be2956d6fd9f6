"""Source text reduced to its syntax tree: comments, layout and docstrings are left out.

Everything else counts: numbers, names, operators, their order, annotations, imports, and all texts,
because a text may be a name, a unit or a choice.

To parse all sources takes half a second, and every process of a study needs their digests. As
Python keeps its bytecode, they are kept in ``__pycache__``, by the digests of the whole sources.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from solver.files import appearing, read_file

_NO_MEANING = frozenset({"ctx", "kind", "type_comment", "type_ignores"})
"""Fields of Python's grammar that follow from the position of a node, or come from comments."""

_MOST = 5000
"""Number of digests above which those of earlier sources are no longer kept."""


def digests_of(sources: Sequence[bytes]) -> list[str]:
    """Return a digest of the `meaning` of each source, from the kept ones where they are known."""
    maker, whole = digest(read_file(__file__)), [digest(each) for each in sources]
    kept = Path(cache_from_source(__file__)).with_suffix(".json")
    known = _kept(kept, maker)
    fresh = {
        key: digest(meaning(source).encode())
        for key, source in zip(whole, sources, strict=True)
        if key not in known
    }
    if fresh:
        _keep(kept, maker, fresh if len(known) > _MOST else {**known, **fresh})
    return [fresh.get(key) or known[key] for key in whole]


def digest(data: bytes) -> str:
    """Return 32 hexadecimal digits of SHA-256."""
    return hashlib.sha256(data).hexdigest()[:32]


def _kept(path: Path, maker: str) -> Mapping[str, str]:
    """Return the kept digests, if this module has not changed since; else none."""
    try:
        content = json.loads(read_file(path))
        return dict(content["digests"]) if content["maker"] == maker else {}
    except (OSError, ValueError, TypeError, KeyError):
        return {}


def _keep(path: Path, maker: str, digests: Mapping[str, str]) -> None:
    with suppress(OSError):  # such as a directory that only its owner may write to
        path.parent.mkdir(parents=True, exist_ok=True)
        with appearing(path) as part:
            part.write_text(json.dumps({"maker": maker, "digests": digests}), encoding="ascii")


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
