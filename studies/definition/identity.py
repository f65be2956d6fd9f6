"""Content ids: the same parameters and the same solver give the same id.

A change of the solver that may change a number, a name or a unit changes every id, so that no old
run is mistaken for a new one. So does a change of the user's own files with parts. A change of the
user's own scene changes the ids of its runs. A change of comments and docstrings alone changes no
id: source text is reduced to its syntax tree (`meaning`). Everything else counts: numbers, names,
operators, their order, annotations, imports, and all texts, because a text may be a name, a unit or
a choice.

To parse all sources takes half a second, and every process of a study needs their digests. As
Python keeps its bytecode, they are kept in ``__pycache__``, by the digests of the whole sources.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import cache, lru_cache
from importlib.machinery import ModuleSpec
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import solver
from solver.files import appearing, read_file
from solver.parts import own_files
from solver.scenes import Scene

ID_PATTERN = re.compile(r"[0-9a-f]{32}")


def canonical(value: Any) -> str:
    """Return JSON that is equal for equal content; key order, spacing and ``-0.0`` do not count."""
    return json.dumps(
        _normalised(value),
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
    )


def content_id(*parts: Any) -> str:
    """Return 32 hexadecimal digits that depend on `parts` and on the solver's sources."""
    return digest(canonical([*parts, solver_hash()]).encode())


class Namer:
    """Makes ids of tables that share most of their entries; common text is made once.

    The id of a table is ``content_id(kind, name, table, source)``.

    Parameters
    ----------
    kind, name, source : the content besides the table
    table : the entries of all tables, which `id_of` may replace
    """

    def __init__(self, kind: str, name: str, table: Mapping[str, Any], source: Any) -> None:
        keys = sorted(table)
        self._places = {key: place for place, key in enumerate(keys)}
        self._texts = [self.entry(key, table[key]) for key in keys]
        self._before = canonical([kind, name]).removesuffix("]") + ",{"
        self._after = "}," + canonical([source, solver_hash()]).removeprefix("[")

    @staticmethod
    def entry(key: str, value: Any) -> str:
        """Return the text of one entry."""
        return f"{canonical(key)}:{canonical(value)}"

    def places(self, keys: Iterable[str]) -> Places:
        """Return the places of entries with these keys, for the keys that the table has."""
        return [(k, self._places[key]) for k, key in enumerate(keys) if key in self._places]

    def id_of(self, changes: Iterable[tuple[Places, Sequence[str]]]) -> str:
        """Return the content id of the table with other entries at some places."""
        texts = self._texts.copy()
        for places, entries in changes:
            for k, place in places:
                texts[place] = entries[k]
        return digest(f"{self._before}{','.join(texts)}{self._after}".encode())


Places = list[tuple[int, int]]
"""Numbers of entries in a list of them, and the place of each in the table of a `Namer`."""


def is_id(text: str) -> bool:
    """Tell whether `text` has the form of a content id."""
    return ID_PATTERN.fullmatch(text) is not None


FORM = (
    "definition/cases.py",
    "definition/parameters.py",
    "definition/vocabulary.py",
    "storage/dataset.py",
    "storage/provenance.py",
)
"""Modules of this package that decide the layout of files: names, units, dimensions, attributes."""


NO_NUMBERS = frozenset({"effort"})
"""Functions of a scene that do not affect the results of a run."""


@cache
def solver_hash() -> str:
    """Return the digest of all sources that decide the content of a run's file.

    These are the sources of the solver, and the modules that decide the layout of files, each with
    its path: moving a file changes the digest. The user's own files with parts count too
    (`solver.parts`), wherever they are.
    """
    root, here = Path(solver.__file__).parent, Path(__file__).parents[1]
    files = {f"solver/{path.relative_to(root).as_posix()}": path for path in root.rglob("*.py")}
    files |= {f"studies/{name}": here / name for name in FORM}
    files |= {f"parts/{k}": path for k, path in enumerate(own_files())}
    digests = digests_of([read_file(path) for path in files.values()])
    return digest(json.dumps(dict(zip(files, digests, strict=True)), sort_keys=True).encode())


def written(scene: Scene) -> list[list[str]]:
    """Return the sources of a scene, for `content_id`.

    These are the names of its parameters and of its functions that compute results, each with the
    digest of its module, if the module is not the solver's. Code under ``if __name__ ==
    "__main__":`` does not count, since workers do not run it. Imported modules do not count, and
    code without a file, such as a cell of a notebook, has no digest.
    """
    functions = _functions(scene)
    digests = {name: _module_digest(name) for name in {each.__module__ for each in functions}}
    found = [[each.__qualname__, digests[each.__module__]] for each in functions]
    return [*found, *_read(scene)] if scene.source else found


def loaded(scene: Scene) -> dict[str, str]:
    """Return the digests of the modules by whose names a scene goes to another process."""
    names = {each.__module__ for each in _functions(scene)} - {"__main__"}
    return {name: found for name in names if (found := _module_digest(name))}


def _read(scene: Scene) -> list[list[str]]:
    """Return the data that a scene was made from, and the modules that have read it."""
    file = _own_file(type(scene).__module__)
    modules = sorted(file.parent.glob("*.py")) if file else []
    return [["source", scene.source], *map(list, _file_digests(tuple(modules)))]


@cache
def _file_digests(files: tuple[Path, ...]) -> list[tuple[str, str]]:
    """Return the name of each file, and the digest of its source."""
    digests = digests_of([read_file(each) for each in files])
    return [(each.name, found) for each, found in zip(files, digests, strict=True)]


def sources(scene: Scene) -> list[Path]:
    """Return the source files of solver, studies and scene, from which all results are made."""
    roots = (Path(solver.__file__).parent, Path(__file__).parents[1])
    own = filter(None, (_own_file(each.__module__) for each in _functions(scene)))
    return sorted({*own, *(path for root in roots for path in root.rglob("*.py"))})


def _functions(scene: Scene) -> list[Any]:
    """Return the parameters of a scene and its functions that compute results."""
    given: list[Any] = [type(scene)]
    for item in fields(scene):
        if item.name in NO_NUMBERS:
            continue
        value = getattr(scene, item.name)
        given += value if isinstance(value, tuple) else [value]
    called = [getattr(each, "func", each) for each in given if callable(each)]
    return [each if hasattr(each, "__qualname__") else type(each) for each in called]


def _own_file(module: str) -> Path | None:
    """Return the file of a module that is not the solver's, if it has one."""
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or Path(file).is_relative_to(Path(solver.__file__).parent):
        return None
    return Path(file)


_LOADED: dict[str, tuple[ModuleSpec, str]] = {}
"""By the name of a module, how it was loaded, and the digest of its source."""


def _module_digest(name: str) -> str:
    """Return the digest of a module's source without comments; empty for one of the solver's.

    It is that of the code which this process has loaded, though the file may be another one by now:
    it is read when an id is made for the first time, and again after the module is loaded again.
    """
    file = _own_file(name)
    if file is None:
        return ""
    spec = getattr(sys.modules[name], "__spec__", None)
    if spec is None:  # of a script nothing tells whether it is loaded again
        return _code_digest(read_file(file))
    if name not in _LOADED or _LOADED[name][0] is not spec:
        _LOADED[name] = spec, _code_digest(read_file(file))
    return _LOADED[name][1]


@lru_cache(maxsize=100)
def _code_digest(source: bytes) -> str:
    """Return the digest of what workers run of a source; it is asked for again with every run."""
    tree = ast.parse(source)
    tree.body = [each for each in tree.body if not only_as_script(each)]
    return digests_of([ast.unparse(tree).encode()])[0]


def only_as_script(statement: ast.stmt) -> bool:
    """Whether a statement is ``if __name__ == "__main__":``."""
    names = ast.walk(statement.test) if isinstance(statement, ast.If) else ()
    return any(isinstance(each, ast.Name) and each.id == "__name__" for each in names)


def _normalised(value: Any) -> Any:
    if isinstance(value, float):
        return value + 0.0  # -0.0 becomes 0.0
    if isinstance(value, dict):
        return {key: _normalised(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_normalised(item) for item in value]
    return value


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
