"""What a scene is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from solver.results.record import Record

Monitor = Callable[[float], None]
"""Called after every increment with the fraction of the path done (0-1).
An exception it raises stops the path and reaches the caller unchanged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A named problem.

    Attributes
    ----------
    name : as written in study files
    summary : one line
    parameters : frozen, keyword-only dataclass; every field has a default, an
        ``annotated_types`` constraint where it has a range, an ``annotated_types.Unit`` and a
        ``description`` in the field's metadata. Building it checks it (``ModelError``).
    branch : the parameter along which one loading path serves many runs
    path : ``path(parameters, values, monitor)`` yields one record for each value of the
        branch parameter, in increasing order, as each becomes known; failures are records too
    refining : the parameters that change how accurate a result is, not what it is the result of:
        runs that differ in these alone solve one problem, and can be compared
    """

    name: str
    summary: str
    parameters: type[Any]
    branch: str
    path: Callable[[Any, Sequence[float], Monitor], Iterator[Record]]
    refining: frozenset[str] = frozenset()
