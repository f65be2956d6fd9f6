"""Numbers of the runs by which a study may choose its runs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from solver.scenes import Scene
from studies.definition.line import Read, picked
from studies.definition.parameters import in_unit
from studies.definition.spaced import is_finite
from studies.errors import StudyError, check_entries, nearest, one_of

_LARGEST = {"largest": np.max, "smallest": np.min}
"""What may be taken of a variable over dimensions."""


def number_of_a_run(field: str, name: Any, scene: Scene) -> type[IntEnum] | None:
    """Return the words of the values of a variable; None for numbers.

    Raises
    ------
    StudyError
        naming ``field``, if there is none, or if it has dimensions
    """
    quantities = scene.known_quantities
    quantity = quantities.get(name) if isinstance(name, str) else None
    if quantity is not None and not quantity.dims:
        return quantity.flags
    what = "is no variable" if quantity is None else f"is over {', '.join(quantity.dims)}"
    numbers = [own for own, each in quantities.items() if not each.dims]
    allowed = f"{what}: must be a variable with one number a run{nearest(name, numbers)}"
    raise StudyError(field, name, allowed)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunNumber:
    """A number of a run: a variable without dimensions, or one of its values.

    Attributes
    ----------
    of : the variable
    at : the place on its dimensions
    take : ``largest`` or ``smallest`` over those that ``at`` does not name
    """

    of: str
    at: Mapping[str, Any] = field(default_factory=dict)
    take: str = ""

    @property
    def whole(self) -> bool:
        """Whether it is all of its variable: it is in the row of a run."""
        return not (self.at or self.take)

    @property
    def name(self) -> str:
        """Its name in a data set: that of the variable, and what is taken of it."""
        parts = [self.of, *map(str, self.at.values()), *([self.take] if self.take else [])]
        return "_".join(parts)

    @property
    def content(self) -> Any:
        """What `checked_number` reads."""
        if self.whole:
            return self.of
        at = {"at": dict(self.at)} if self.at else {}
        return {"of": self.of, **at, **({"take": self.take} if self.take else {})}

    def seen(self, read: Read) -> float | None:
        """Return the number of a run; None if the run has not this variable.

        Raises
        ------
        ValueError
            if the variable has not this place
        """
        found = read(self.of)
        if found is None:
            return None
        values = picked(
            read, self.of, self.at, [each for each in found.dims if each not in self.at]
        )
        there = values[np.isfinite(values)]
        return float(_LARGEST[self.take or "largest"](there)) if there.size else None


def checked_number(field: str, content: Any, scene: Scene) -> RunNumber:
    """Return a number of the runs: the name of a variable, or a table ``{of, at, take}``.

    Raises
    ------
    StudyError
        naming the entry, its value and what is allowed
    """
    given = {"of": content} if isinstance(content, str) else content
    if not isinstance(given, Mapping):
        raise StudyError(field, content, "must be the name of a variable, or {of, at, take}")
    check_entries(field, given, ("of", "at", "take"))
    of, at, take = given.get("of"), given.get("at", {}), given.get("take", "")
    quantities = scene.known_quantities
    if not isinstance(of, str) or of not in quantities:
        raise StudyError(field, of, f"must be a variable of the runs{nearest(of, quantities)}")
    dims = quantities[of].dims
    if not isinstance(at, Mapping):
        raise StudyError(f"{field}.at", at, "must be a table: a place on each dimension")
    for dim, place in at.items():
        if dim not in dims:
            raise StudyError(f"{field}.at.{dim}", place, one_of(dim, dims))
    if take not in ("", *_LARGEST):
        raise StudyError(f"{field}.take", take, one_of(take, _LARGEST))
    left = [dim for dim in dims if dim not in at]
    if left and not take:
        named = ", ".join(f"{dim} = …" for dim in left)
        allowed = f'is over {", ".join(dims)}: give at = {{{named}}}, or take = "largest"'
        raise StudyError(field, content, allowed)
    if take and not left:
        raise StudyError(f"{field}.take", take, "is of one number: leave it out")
    found = RunNumber(of=of, at=dict(at), take=take)
    if not found.whole and found.name in quantities:
        raise StudyError(field, content, f"would be named {found.name}, as another variable is")
    return found


class Condition(NamedTuple):
    """A condition on a number of a run: above or below a limit."""

    name: str
    sign: str
    limit: float

    @property
    def text(self) -> str:
        """The condition, as `checked_condition` and tables of runs read it."""
        return f"{self.name} {self.sign} {self.limit!r}"

    def over(self, value: float) -> float:
        """Return how far a value is beyond the limit: positive if it breaks the condition."""
        return value - self.limit if self.sign[0] == "<" else self.limit - value


CONDITION = re.compile(r"\s*(?P<name>\w+)\s*(?P<sign><=|>=|!=|<|>|=)\s*(?P<value>.*?)\s*")


def checked_condition(field: str, text: Any, scene: Scene) -> Condition:
    """Return a condition on a variable with one number a run, such as ``"rigid_shift < 20 um"``.

    Raises
    ------
    StudyError
        naming ``field``, the condition and what is allowed
    """
    found = CONDITION.fullmatch(text) if isinstance(text, str) else None
    if found is None or found["sign"][0] not in "<>":
        raise StudyError(field, text, "must be NAME < NUMBER, with <, <=, > or >=")
    number_of_a_run(field, found["name"], scene)
    given = in_unit(scene.known_quantities[found["name"]].units, found["value"], field)
    with suppress(ValueError):
        if is_finite(limit := float(given)):
            return Condition(found["name"], found["sign"], limit)
    raise StudyError(field, text, "must end with a finite number")
