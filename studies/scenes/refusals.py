"""Mistakes in tables as errors of this project: field, value, what is allowed; stand-ins."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import cache
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from studies.errors import StudyError, nearest, one_of, worded
from studies.units import is_quantity

NUMBER = "must be a number, or an expression, which names parameters as $name"
_KINDS = ("union_tag_not_found", "union_tag_invalid")

_KEY = "[key]"
"""What pydantic adds to the place of a name that is wrong itself."""
_TABLES = frozenset({"properties", "additionalProperties", "patternProperties"})
"""Keys in the schema of a table; it has at least one of them."""


def mistakes_of(
    error: ValidationError, table: type[BaseModel], known: Collection[Where] = ()
) -> dict[Where, StudyError]:
    """Return the mistakes by place, without those at ``known`` places.

    If entries of a table are wrong, only these are mistakes, not the table.
    """
    schema = _schema(table)
    located = [(each, *_located(schema, _loc(each))) for each in error.errors()]
    wrong = {where for _, where, _ in located} | set(known)
    above = {where[:k] for where in wrong for k in range(len(where))}
    found: dict[Where, tuple[Any, list[str]]] = {}
    for each, where, entries in located:
        if where not in above and where not in known:
            found.setdefault(where, (_given(each), []))[1].append(_allowed(each, entries))
    return {
        where: StudyError(dotted(where), given, _either(list(dict.fromkeys(allowed))))
        for where, (given, allowed) in found.items()
    }


@cache
def _schema(table: type[BaseModel]) -> Mapping[str, Any]:
    """Return the JSON Schema of a table; making it takes a tenth of a second."""
    return table.model_json_schema()


def _either(allowed: list[str]) -> str:
    """Return what is allowed by any branch of a union."""
    if len(allowed) == 1:
        return allowed[0]
    each = ("a number" if text == NUMBER else text.removeprefix("must be ") for text in allowed)
    *others, last = each
    return f"must be {', '.join(others)} or {last}"


def _loc(each: Any) -> Where:
    """Return the location of an error; that of an unknown kind of table is its entry ``kind``."""
    loc: Where = each["loc"]
    return (*loc, "kind") if each["type"] in _KINDS else loc


def _given(each: Any) -> Any:
    if each["type"] in _KINDS:
        return each["input"].get("kind")
    return None if each["type"] == "missing" else each["input"]


def _allowed(each: Any, entries: list[str]) -> str:
    kind = each["type"]
    if kind == "extra_forbidden":
        listed = f"there is no such entry; there are {', '.join(entries)}"
        return listed + nearest(each["loc"][-1], entries)
    if kind in _KINDS:
        return one_of(_given(each), entries)
    given = each["input"]
    if kind == "float_type" and isinstance(given, str) and not is_quantity(given):
        return NUMBER
    return worded(each)


def _located(schema: Mapping[str, Any], loc: Where) -> tuple[Where, list[str]]:
    """Return the place of a location of pydantic, and the entries that its table may have.

    The place has no tags of unions. If the kind of the table is unknown, its entries are the kinds.
    """
    node: Mapping[str, Any] = schema
    kept: list[str | int] = []
    entries: list[str] = []
    for part in loc:
        node = _resolved(schema, node)
        options = [_resolved(schema, each) for each in node.get("anyOf", ())]
        options = [each for each in options if each.get("type") != "null"]
        if len(options) == 1:
            (node,), options = options, []
        mapping = node.get("discriminator", {}).get("mapping", {})
        if part in mapping:
            node = {"$ref": mapping[part]}
            continue
        branch = next((o for o in options if _is_branch(part, o)), None)
        if branch is not None:
            node = branch
            continue
        if isinstance(part, str) and not all(_TABLES & o.keys() for o in options):
            continue  # the name of a branch: float, str
        node = next(iter(options), node)
        kept.append(part)
        entries = list(node.get("properties", mapping))
        if part in entries:
            node = node["properties"][part]
        elif isinstance(part, int):
            node = node.get("items", (node.get("prefixItems") or [{}])[0])
        else:
            named = node.get("patternProperties") or {"": node.get("additionalProperties")}
            below = next(iter(named.values()))  # a table whose keys are names of the user
            node = below if isinstance(below, Mapping) else {}
    return tuple(kept), entries


def _is_branch(part: str | int, option: Mapping[str, Any]) -> bool:
    """Tell whether a part of a location is the tag of this branch of a union: a table or a list."""
    if isinstance(part, int):
        return False
    if option.get("type") == "array":
        return part.startswith("tuple[")
    return part == option.get("title") and "properties" in option


def _resolved(schema: Mapping[str, Any], node: Mapping[str, Any]) -> Mapping[str, Any]:
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    return node


def dotted(where: Where) -> str:
    """Return the name of an entry: ``contacts[0].friction``."""
    named = (k for k in where if k != _KEY)
    return "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in named).removeprefix(".")


Where = tuple[str | int, ...]
"""Place of an entry: the keys and list positions that lead to it."""


class _StandIn(NamedTuple):
    """The required entries of a table, and those that can be checked without the others."""

    table: dict[str, Any]
    kept: frozenset[str]


def _stand_in(kept: str, **table: Any) -> _StandIn:
    return _StandIn(table, frozenset(kept.split()))


_STAND_INS: dict[Where, _StandIn] = {
    ("materials",): _stand_in("", youngs_modulus=1.0, poisson_ratio=0.0),
    ("bodies",): _stand_in("material", material=""),
    ("rigid",): _stand_in("", surfaces={"face": {"kind": "line", "points": [[0, 0], [1, 0]]}}),
    ("contacts",): _stand_in(
        "name slave master amplitude", name="contact", slave="a.b", master="a.b"
    ),
    ("loads",): _stand_in(
        "body boundary amplitude", kind="pressure", body="", boundary="", value=0
    ),
    ("checks",): _stand_in("", parameter="", that=True, allowed="true"),
    ("singular",): _stand_in("", at=[0, 0], radius=1.0),
    ("stages",): _stand_in("name", name="stage"),
    ("results", "lines"): _stand_in("body", body=""),
    ("results", "points"): _stand_in("body", body="", at=[0, 0]),
    ("outputs",): _stand_in("of stage body line contact", of="mises", stage=""),
    ("parameters",): _stand_in("", default=0),
}
"""Stand-ins for the tables of each collection."""

_LONE: dict[Where, Any] = {("name",): "scene", ("loading",): {"factor": 1.0, "step": 1.0}}
"""Stand-ins for entries that a file has once; all others may be left out."""

_WITHOUT = (("derived",), ("results",))
"""Tables whose entries may be left out, one by one."""


class Mended(NamedTuple):
    """A scene file with stand-ins.

    Attributes
    ----------
    tree : its tables; None if names that other tables use are lost
    own : for each table or entry with a stand-in, its entries that are still those of the file
    """

    tree: dict[str, Any] | None
    own: dict[Where, frozenset[str]]


def mended(tree: dict[str, Any], wrong: Iterable[Where]) -> Mended:
    """Return a tree with stand-ins for the tables that have a wrong entry at these places."""
    places = sorted(wrong, key=str)
    own: dict[Where, frozenset[str]] = {}
    found = tree
    for at in dict.fromkeys(_item(where) for where in places):
        stand_in = _STAND_INS.get(at[:-1])
        if at in _STAND_INS or at in _WITHOUT or (*at, "name") in places:
            return Mended(None, own)  # a whole collection, or the name of one of its tables
        new, own[at] = _LONE.get(at), frozenset()
        if stand_in:
            given = _at(tree, at)
            bad = {where[len(at)] for where in places if where[: len(at)] == at and where != at}
            kept = stand_in.kept & given.keys() - bad if isinstance(given, dict) else frozenset()
            new, own[at] = stand_in.table | {key: given[key] for key in kept}, frozenset(kept)
        found = _replaced(found, at, new)
    return Mended(found, own)


def _item(where: Where) -> Where:
    """Return the place of the table of a collection that contains an entry, or of the entry."""
    collections = [*_STAND_INS, *_WITHOUT]
    depth = max((len(each) + 1 for each in collections if where[: len(each)] == each), default=1)
    return where[:depth]


def _at(tree: Any, where: Where) -> Any:
    for key in where:
        tree = tree[key]
    return tree


def _replaced(tree: Any, where: Where, new: Any) -> Any:
    """Return a tree with ``new`` at a place, or without the entry if ``new`` is None."""
    if not where:
        return new
    key, *rest = where
    if isinstance(tree, list):
        return [_replaced(v, tuple(rest), new) if k == key else v for k, v in enumerate(tree)]
    below = _replaced(tree.get(key), tuple(rest), new)
    return {k: v for k, v in tree.items() if k != key} | ({} if below is None else {key: below})
