"""Stand-ins for wrong tables of a scene file, so that the others can be checked."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

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
