"""The content of a scene file, and its tables evaluated for values of its parameters."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

from pydantic import ValidationError

from solver.parts import Declared
from studies.errors import SceneError, StudyError
from studies.materials import parameters_in, read_material
from studies.scenes.arithmetic import ExpressionError, evaluated, is_expression, names
from studies.scenes.meshfile import MeshFile
from studies.scenes.quantities import in_own_units, wrong_units
from studies.scenes.refusals import NUMBER, Where, dotted, mended, mistakes_of
from studies.scenes.table import FILE_NAME
from studies.scenes.tables import ACCURACY, NAMED, OPEN, ParameterTable, SceneFile
from studies.toml import read_given, toml_of

_ARITHMETIC = re.compile(r"[+*/^()]|\s-\s")
"""What makes a text of [derived] an expression also without a parameter."""
PLAIN = ("name", "summary", "parameters", "derived", "accuracy", "advice")
"""Entries of a scene file without expressions of parameters, and the derived numbers."""

LARGEST = 1e100
"""Largest absolute value of the default of a parameter."""

WHEN = "when"
"""Entry of a table: the condition without which the table is left out."""

DESCRIBED = ("parameters", "outputs")
"""Entries of a scene file whose tables have a description."""

_LEAST: dict[str, Any] = {
    "name": "scene",
    "materials": {"m": {"youngs_modulus": 1.0, "poisson_ratio": 0.3}},
    "bodies": {"b": {"material": "m"}},
}
"""The required entries of a scene file, to check some other entries alone."""

_LEFT_OUT = object()
"""Stands for a table whose condition is false."""

Mistakes = dict[Where, StudyError | None]
"""Mistakes by place; None if the mistake that causes it is at another place."""


class Readable(NamedTuple):
    """The readable part of a scene file.

    Attributes
    ----------
    tables : with stand-ins for wrong tables; None if too little is left
    wrong : the mistakes by place
    own : see `refusals.Mended`
    """

    tables: SceneFile | None
    wrong: Mistakes
    own: Mapping[Where, frozenset[str]]

    @property
    def mistakes(self) -> list[StudyError]:
        """The mistakes to report, without those that another mistake causes."""
        return [mistake for mistake in self.wrong.values() if mistake]


@dataclass(frozen=True, eq=False)
class Description:
    """The content of a scene file and of the files it names.

    Attributes
    ----------
    file : name of the file, for messages
    content : its tables, as read from TOML or JSON; a number with a unit is in that of its entry
    meshes : meshes and tables of values by the names that bodies and loads give; None if they are
        not at hand, so that no model can be built
    shipped : whether it is a scene of the package, which studies call by its name
    """

    file: str
    content: Mapping[str, Any]
    meshes: Mapping[str, MeshFile] | None
    shipped: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "content", in_own_units(_with_materials(self.content)))

    @classmethod
    def read(cls, path: Path | str, *, shipped: bool = False) -> Self:
        """Read a scene file, and the meshes and tables beside it.

        Raises
        ------
        StudyError
            if a file cannot be read or is no TOML
        """
        path = Path(path)
        content = toml_of(read_given(path, "scene"), "scene", path.name)
        if "scene" in content and "bodies" not in content:
            allowed = f"is a study file, not a scene: its scene is {content['scene']}"
            raise StudyError("scene", path.name, allowed)
        for where, table in _named(content):
            if isinstance(table[NAMED], str):
                table[NAMED] = read_material(table[NAMED], path.parent, f"{where}.{NAMED}")
        meshes = {}
        for name in file_names(content):
            if (path.parent / name).is_file():  # a missing one is a mistake of the scene file
                meshes[name] = MeshFile(name, read_given(path.parent / name, "scene"))
        return cls(path.name, content, meshes, shipped)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the fields alone: cached properties do not go to other processes."""
        return Description, (self.file, self.content, self.meshes, self.shipped)

    @cached_property
    def digest(self) -> str:
        """Content id of the file and those it names, 32 hexadecimal digits; texts do not count."""
        content = json.dumps(_without_texts(self.content), sort_keys=True, default=str)
        meshes = sorted((self.meshes or {}).items())
        parts = [content, *(f"{name} {_digest(mesh.data)}" for name, mesh in meshes)]
        return _digest("\n".join(parts).encode())[:32]

    @cached_property
    def key(self) -> tuple[str, str, bool]:
        """Content id, content with its texts, and whether it is a scene of the package."""
        return self.digest, json.dumps(self.content, sort_keys=True, default=str), self.shipped

    @cached_property
    def parameters(self) -> dict[str, ParameterTable]:
        """The declared parameters.

        Raises
        ------
        SceneError
            if a declaration is wrong
        """
        given = self.content.get("parameters", {})
        stub = {"parameters": given}
        try:
            return SceneFile.model_validate_json(_json({**_LEAST, **stub}), strict=True).parameters
        except ValidationError as error:
            raise SceneError(self.file, [*mistakes_of(error, SceneFile).values()]) from None

    @cached_property
    def opened(self) -> Declared:
        """The parameters that open tables declare and the file itself does not."""
        given = self.content.get("parameters")
        own = given.keys() if isinstance(given, Mapping) else ()
        return {
            name: each
            for key, entries in OPEN.items()
            for name, each in entries.items()
            if name not in own and any(name not in table for table in _open(self.content.get(key)))
        }

    @cached_property
    def completed(self) -> Mapping[str, Any]:
        """The content; entries left out of open tables are expressions of their parameters."""
        found = dict(self.content)
        for key, entries in OPEN.items():
            whole = {name: f"${name}" for name in entries}
            given = found.get(key)
            if isinstance(given, Mapping):
                found[key] = {n: whole | {**t} if _is_open(t) else t for n, t in given.items()}
            elif isinstance(given, list | tuple):
                found[key] = [whole | {**t} if _is_open(t) else t for t in given]
        return found

    def parameter_of(self, where: str) -> str:
        """Return an entry, or the parameter that takes its place in an open table."""
        table, _, entry = where.rpartition(".")
        name, _, which = table.replace("[", ".").rstrip("]").partition(".")
        given: Any = self.content.get(name, {})
        own: Any = given.get(which) if isinstance(given, Mapping) else given[int(which)]
        return entry if _is_open(own) and entry not in own else where

    def tables(self, values: Mapping[str, Any]) -> SceneFile:
        """Return the tables for values of all parameters.

        Raises
        ------
        SceneError
            with all wrong entries
        """
        found = self.readable(values)
        if found.tables is None or found.wrong:
            raise SceneError(self.file, found.mistakes)
        return found.tables

    def readable(self, values: Mapping[str, Any]) -> Readable:
        """Return the tables for values of all parameters, and the mistakes."""
        tree, wrong = self._evaluated(values)
        try:
            tables = SceneFile.model_validate_json(_json(tree), strict=True)
            if not wrong:
                return Readable(tables, wrong, {})
        except ValidationError as error:
            told = mistakes_of(error, SceneFile, wrong)
            wrong |= told | {at: each for at, each in wrong_units(tree).items() if at in told}
        rest, own = mended(tree, wrong)
        try:
            return Readable(SceneFile.model_validate_json(_json(rest), strict=True), wrong, own)
        except ValidationError:  # too little is left, or a name is wrong
            return Readable(None, wrong, own)

    def used(self) -> set[str]:
        """Return the parameters that some entry uses, directly or through derived numbers."""
        derived = self._derived
        completed = _without_texts(self.completed)
        rest = {key: value for key, value in completed.items() if key not in PLAIN}
        found = set().union(*(names(text) for _, text in _expressions(rest)))
        for name in reversed(list(derived)):
            if name in found and is_expression(derived[name]):
                found |= names(derived[name])
        return found

    @property
    def declared(self) -> dict[str, Any]:
        """The defaults as written in the file; None for those that no parameter can have."""
        given = self.content.get("parameters")
        tables = given.items() if isinstance(given, Mapping) else ()
        defaults = {str(k): v.get("default") if isinstance(v, Mapping) else None for k, v in tables}
        levels = self._levels({})
        usual = levels.get("standard") if isinstance(levels, Mapping) else None
        if isinstance(usual, Mapping):
            from_it = {k: v for k, v in usual.items() if k in defaults and defaults[k] is None}
            defaults |= {ACCURACY: "standard"} | from_it
        known = {name: each if _is_value(each) else None for name, each in defaults.items()}
        known |= {str(name): None for table, name, *_ in self._wrong_numbers if table != "derived"}
        return known | {name: field.default for name, (_, field) in self.opened.items()}

    @cached_property
    def _wrong_numbers(self) -> dict[Where, StudyError]:
        """The mistakes of declared and derived numbers with a wrong unit, by place."""
        return wrong_units({key: self.content.get(key) for key in ("parameters", "derived")})

    def _levels(self, mistakes: Mistakes) -> Any:
        """Return the table of accuracies; its texts are expressions without parameters."""

        def numbers(where: Where, value: Any) -> Any:
            if isinstance(value, Mapping):
                return {str(key): numbers((*where, str(key)), each) for key, each in value.items()}
            try:
                return evaluated(value, {}) if isinstance(value, str) else value
            except ExpressionError as error:
                mistakes[where] = StudyError(dotted(where), value, str(error))
                return None

        return numbers((ACCURACY,), self.content.get(ACCURACY))

    @property
    def _derived(self) -> dict[str, Any]:
        given = self.content.get("derived")
        return {str(k): v for k, v in given.items()} if isinstance(given, Mapping) else {}

    def _evaluated(self, values: Mapping[str, Any]) -> tuple[dict[str, Any], Mistakes]:
        """Return the tables with values in place of expressions, and the mistakes."""
        mistakes: Mistakes = {**self._wrong_numbers}
        known = dict(values)
        for name, text in self._derived.items():
            where = ("derived", name)
            computed = isinstance(text, str) and where not in mistakes and _ARITHMETIC.search(text)
            value = _value(where, text, known, mistakes, bool(computed))
            if name in values:
                allowed = "is a parameter too: give it another name"
                mistakes[where] = StudyError(dotted(where), text, allowed)
            elif where not in mistakes and not _is_value(value):
                mistakes[where] = StudyError(dotted(where), text, NUMBER)
            known[name] = None if where in mistakes else value
        plain = {key: value for key, value in self.content.items() if key in PLAIN}
        rest = {key: value for key, value in self.completed.items() if key not in PLAIN}
        tree: dict[str, Any] = plain | _with_values((), rest, known, mistakes)
        if ACCURACY in tree:
            tree[ACCURACY] = self._levels(mistakes)
        return tree, mistakes


def _named(content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the tables of materials that name another one, each with its place."""
    tables = content.get("materials")
    for name, table in tables.items() if isinstance(tables, Mapping) else ():
        if isinstance(table, Mapping) and NAMED in table:
            yield f"materials.{name}", table


def _with_materials(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a scene file with the parameters of materials instead of names that are known."""
    found = dict[str, Any]()
    for where, table in _named(content):
        rest = {key: each for key, each in table.items() if key != NAMED}
        try:
            rest = parameters_in(table[NAMED]) | rest
        except StudyError:  # the check of the tables reports it
            rest = {**_LEAST["materials"]["m"], **table}
        found[where.partition(".")[2]] = rest
    return {**content, "materials": {**content["materials"], **found}} if found else content


def file_names(content: Mapping[str, Any]) -> list[str]:
    """Return the names of the meshes of bodies and tables of loads, without paths to folders."""
    bodies = content.get("bodies")
    each = bodies.values() if isinstance(bodies, Mapping) else ()
    found = [body.get("mesh") for body in each if isinstance(body, Mapping)]
    found += _files([content.get(key) for key in ("loads", "contacts", "rigid")])
    plain = [name for name in found if isinstance(name, str) and FILE_NAME.fullmatch(name)]
    return list(dict.fromkeys(plain))


def _files(tree: Any) -> Iterator[Any]:
    """Yield the entries `file` of all tables in a part of the tree."""
    if isinstance(tree, Mapping):
        yield from [tree["file"]] if "file" in tree else []
    each = tree.values() if isinstance(tree, Mapping) else tree
    for entry in each if isinstance(each, Iterable) and not isinstance(each, str) else ():
        yield from _files(entry)


def _open(tables: Any) -> list[Mapping[str, Any]]:
    """Return the open tables of a collection."""
    each = tables.values() if isinstance(tables, Mapping) else tables
    return [table for table in each if _is_open(table)] if isinstance(each, Iterable) else []


def _is_open(table: Any) -> bool:
    return isinstance(table, Mapping) and table.get("open") is True


def _with_values(where: Where, value: Any, known: Mapping[str, Any], mistakes: Mistakes) -> Any:
    """Return a part of the tree with values in place of expressions, without tables left out.

    Places in lists count the remaining tables.
    """
    if isinstance(value, Mapping):
        tree = {}
        for key, each in value.items():
            at = (*where, str(key))
            if key == "description" and len(where) == 2 and where[0] in DESCRIBED:
                tree[str(key)] = each
            elif (rest := _unconditional(at, each, known, mistakes)) is not _LEFT_OUT:
                tree[str(key)] = _with_values(at, rest, known, mistakes)
        return tree
    if isinstance(value, list | tuple):
        found: list[Any] = []
        for each in value:
            at = (*where, len(found))
            if (rest := _unconditional(at, each, known, mistakes)) is not _LEFT_OUT:
                found.append(_with_values(at, rest, known, mistakes))
        return found
    return _value(where, value, known, mistakes)


def _unconditional(where: Where, value: Any, known: Mapping[str, Any], mistakes: Mistakes) -> Any:
    """Return an entry without its condition; `_LEFT_OUT` if the condition is false.

    A table with unknown parameters is never left out, so that they are always reported.
    """
    if not isinstance(value, Mapping) or isinstance(value.get(WHEN), Mapping | None):
        return value
    condition = value[WHEN]
    holds = _value((*where, WHEN), condition, known, mistakes)
    rest = {key: each for key, each in value.items() if key != WHEN}
    if (*where, WHEN) not in mistakes and not isinstance(holds, bool):
        allowed = "must be true or false, such as $depth > 0 or $kind == 'round'"
        mistakes[(*where, WHEN)] = StudyError(dotted((*where, WHEN)), condition, allowed)
    if holds is False and all(names(text) <= known.keys() for _, text in _expressions(rest)):
        return _LEFT_OUT
    return rest


def _value(
    where: Where, value: Any, known: Mapping[str, Any], mistakes: Mistakes, constant: bool = False
) -> Any:
    """Return the value of an expression, or None if it or a parameter of it has none.

    A ``constant`` is an expression without parameters.
    """
    if not constant and not is_expression(value):
        return value
    if any(known.get(name, value) is None for name in names(value)):
        mistakes[where] = None
        return None
    try:
        return evaluated(value, known)
    except ExpressionError as error:
        mistakes[where] = StudyError(dotted(where), value, str(error))
        return None


def _is_value(value: Any) -> bool:
    """Tell whether a parameter may have this value: a number, a word, true or false."""
    if isinstance(value, int | float):
        return not abs(value) > LARGEST
    return isinstance(value, str) and not is_expression(value)


def _expressions(value: Any) -> Iterator[tuple[Where, str]]:
    if isinstance(value, Mapping):
        for key, each in value.items():
            yield from (((str(key), *at), text) for at, text in _expressions(each))
    elif isinstance(value, list | tuple):
        for k, each in enumerate(value):
            yield from (((k, *at), text) for at, text in _expressions(each))
    elif is_expression(value):
        yield (), value


def _without_texts(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables without summary, descriptions and advice, which affect no number."""
    return {
        key: {name: _undescribed(each) for name, each in value.items()}
        if key in DESCRIBED and isinstance(value, Mapping)
        else value
        for key, value in content.items()
        if key not in ("summary", "advice")
    }


def _undescribed(table: Any) -> Any:
    if not isinstance(table, Mapping):
        return table
    return {key: value for key, value in table.items() if key != "description"}


def _json(tree: Any) -> str:
    return json.dumps(tree, default=str)


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
