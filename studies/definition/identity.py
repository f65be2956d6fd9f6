"""Content ids: the same parameters and the same solver give the same id.

A change of the solver that may change a number, a name or a unit changes every id, so that no old
run is mistaken for a new one. So does a change of the user's own files with parts. A change of the
user's own scene changes the ids of its runs. A change of comments and docstrings alone changes no
id (`studies.definition.meaning`).
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cache, lru_cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import solver
from solver.files import read_file
from solver.parts import own_files
from solver.scenes import Scene
from studies.definition.meaning import digest, digests_of

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
