"""What pydantic finds wrong, in the words of this project: field, value, what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from studies.errors import StudyError

_WORDS = {
    "missing": "must be given",
    "float_type": "must be a number",
    "int_type": "must be an integer",
    "int_from_float": "must be an integer",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "finite_number": "must be finite",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "literal_error": "must be {expected}",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "string_too_long": "must have at most {max_length} characters",
    "too_short": "must have {min_length} or more",
    "too_long": "must have at most {max_length}",
    "union_tag_not_found": "must be a table with a kind",
    "union_tag_invalid": "must be of a kind {expected_tags}",
    "string_pattern_mismatch": "must match {pattern}",
}

_TABLES = frozenset({"properties", "additionalProperties", "patternProperties"})
"""What the schema of a table has, one of them at least."""

Where = tuple[str | int, ...]


def mistakes_of(
    error: ValidationError, table: type[BaseModel], known: Collection[Where] = ()
) -> Iterator[StudyError]:
    """Yield what is wrong, but for what is ``known`` to be wrong at these places."""
    schema = table.model_json_schema()
    told: set[Where] = set()
    for each in error.errors():
        kept, entries = _walked(schema, each["loc"])
        if kept in known or kept in told:
            continue
        told.add(kept)
        yield StudyError(dotted(kept), _given(each), _allowed(each, entries))


def _given(each: Any) -> Any:
    return None if each["type"] == "missing" else each["input"]


def _allowed(each: Any, entries: list[str]) -> str:
    kind, context = each["type"], each.get("ctx", {})
    if kind == "extra_forbidden":
        name = str(each["loc"][-1])
        matches = difflib.get_close_matches(name, entries, n=1)
        meant = f"; did you mean {matches[0]}?" if matches else ""
        return f"there is no such entry; there are {', '.join(entries)}{meant}"
    if kind in _WORDS:
        return _WORDS[kind].format(**context)
    return str(each["msg"])


def _walked(schema: Mapping[str, Any], loc: Where) -> tuple[Where, list[str]]:
    """Return a place without the tags that unions put into it, and the entries of its table."""
    node: Mapping[str, Any] = schema
    kept: list[str | int] = []
    entries: list[str] = []
    for part in loc:
        node = _resolved(schema, node)
        mapping = node.get("discriminator", {}).get("mapping", {})
        if part in mapping:
            node = {"$ref": mapping[part]}
            continue
        options = [_resolved(schema, each) for each in node.get("anyOf", ())]
        if options and isinstance(part, str) and not any(_TABLES & o.keys() for o in options):
            continue  # the name of a branch: float, str
        node = next((o for o in options if o.get("type") != "null"), node)
        kept.append(part)
        entries = list(node.get("properties", {}))
        if part in entries:
            node = node["properties"][part]
        elif isinstance(part, int):
            node = node.get("items", (node.get("prefixItems") or [{}])[0])
        else:
            named = node.get("patternProperties") or {"": node.get("additionalProperties")}
            below = next(iter(named.values()))  # a table with names of the user's own
            node = below if isinstance(below, Mapping) else {}
    return tuple(kept), entries


def _resolved(schema: Mapping[str, Any], node: Mapping[str, Any]) -> Mapping[str, Any]:
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    return node


def dotted(where: Where) -> str:
    """Return the name of an entry: ``contacts[0].friction``."""
    return "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in where).removeprefix(".")
