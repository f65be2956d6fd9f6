"""What pydantic finds wrong, in the words of this project: field, value, what is allowed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel, ValidationError

from studies.errors import StudyError, nearest, one_of, worded
from studies.scenes.mending import Where

_KINDS = ("union_tag_not_found", "union_tag_invalid")

_TABLES = frozenset({"properties", "additionalProperties", "patternProperties"})
"""What the schema of a table has, one of them at least."""


def mistakes_of(
    error: ValidationError, table: type[BaseModel], known: Collection[Where] = ()
) -> dict[Where, StudyError]:
    """Return what is wrong by its place, but for what is ``known`` to be wrong at these places.

    Of a table whose entries are wrong the entries are told alone.
    """
    schema = _schema(table)
    walked = [(each, *_walked(schema, _loc(each))) for each in error.errors()]
    wrong = {kept for _, kept, _ in walked} | set(known)
    above = {where[:k] for where in wrong for k in range(len(where))}
    told: dict[Where, tuple[Any, list[str]]] = {}
    for each, kept, entries in walked:
        if kept not in above and kept not in known:
            told.setdefault(kept, (_given(each), []))[1].append(_allowed(each, entries))
    return {
        kept: StudyError(dotted(kept), given, _either(list(dict.fromkeys(allowed))))
        for kept, (given, allowed) in told.items()
    }


@cache
def _schema(table: type[BaseModel]) -> Mapping[str, Any]:
    """Return the JSON Schema of a table, which takes a tenth of a second to make."""
    return table.model_json_schema()


def _either(allowed: list[str]) -> str:
    """Return what is allowed by one of the branches of a union."""
    *others, last = (each.removeprefix("must be ") for each in allowed)
    return f"must be {', '.join(others)} or {last}" if others else allowed[0]


def _loc(each: Any) -> Where:
    """Return where it is wrong: of a table that is of no known kind, its kind."""
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
    return worded(each)


def _walked(schema: Mapping[str, Any], loc: Where) -> tuple[Where, list[str]]:
    """Return a place without the tags that unions put into it, and what its table may have.

    These are the entries; where its kind is not known, the kinds.
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
        if options and isinstance(part, str) and not any(_TABLES & o.keys() for o in options):
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
            below = next(iter(named.values()))  # a table with names of the user's own
            node = below if isinstance(below, Mapping) else {}
    return tuple(kept), entries


def _is_branch(part: str | int, option: Mapping[str, Any]) -> bool:
    """Whether a part of a place is the name of this branch of a union: a table, or a list."""
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
    return "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in where).removeprefix(".")
