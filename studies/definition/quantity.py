"""Variables of a run, what of them is at a place, and numbers by which a study chooses its runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from enum import IntEnum
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BeforeValidator,
    Field,
    PlainSerializer,
    PlainValidator,
    ValidationInfo,
    model_serializer,
    model_validator,
)

from solver.parameters import is_number
from solver.scenes import Scene
from studies.definition.parameters import in_unit
from studies.definition.schema import Context, StudyTable, is_finite, parsed
from studies.errors import StudyError, nearest, one_of


class Line(NamedTuple):
    """A variable of a run: the names of its dimensions, and its values."""

    dims: tuple[str, ...]
    values: NDArray[Any]


Read = Callable[[str], Line | None]
"""Gives a variable of a run by its name; None if the run has none."""


def picked(
    read: Read, name: str, at: Mapping[str, Any], keeps: Collection[str] = ()
) -> NDArray[np.float64]:
    """Return a variable over the dimensions ``keeps``, at a place on the others.

    Raises
    ------
    ValueError
        if the run has no such variable, or it has not this place
    """
    found = read(name)
    if found is None:
        raise ValueError(f"the run has no {name}")
    dims, values = list(found.dims), found.values
    for dim in found.dims:
        if dim in keeps:
            continue
        grid = read(dim)
        labels = np.arange(values.shape[dims.index(dim)]) if grid is None else grid.values
        place = _position(name, dim, labels, at)
        values = np.take(values, place, axis=dims.index(dim))
        dims.remove(dim)
    return np.asarray(values, dtype=float)


def _position(name: str, dim: str, labels: NDArray[Any], at: Mapping[str, Any]) -> int:
    some = ", ".join(map(str, labels[:6].tolist()))
    if dim not in at:
        if len(labels) == 1:
            return 0
        raise ValueError(f"{name} is over {dim} too: say at which, of {some}")
    wanted = at[dim]
    if labels.dtype.kind in "fiu" and is_number(wanted):
        same = np.isclose(labels.astype(float), wanted, rtol=1e-6)
    else:
        same = labels.astype(str) == str(wanted)
    if not same.any():
        raise ValueError(f"{name} has no {dim} = {wanted}; it has {some}")
    return int(np.argmax(same))


_LARGEST = {"largest": np.max, "smallest": np.min}
"""What may be taken of a variable over dimensions."""


def known_variable(name: Any, info: ValidationInfo) -> str:
    """Return the name of a variable of the runs."""
    known = Context.of(info).scene.known_quantities
    if not isinstance(name, str) or name not in known:
        raise StudyError("", name, f"must be a variable of the runs{nearest(name, known)}")
    return name


Variable = Annotated[str, PlainValidator(known_variable, json_schema_input_type=str)]
"""The name of a variable of the runs."""


def number_of_a_run(name: Any, scene: Scene) -> tuple[str, type[IntEnum] | None]:
    """Return the unit of a variable without dimensions, and the words of its values."""
    quantities = scene.known_quantities
    quantity = quantities.get(name) if isinstance(name, str) else None
    if quantity is not None and not quantity.dims:
        return quantity.units, quantity.flags
    what = "is no variable" if quantity is None else f"is over {', '.join(quantity.dims)}"
    numbers = [own for own, each in quantities.items() if not each.dims]
    allowed = f"{what}: must be a variable with one number a run{nearest(name, numbers)}"
    raise StudyError("", name, allowed)


def _one_number(name: Any, info: ValidationInfo) -> str:
    number_of_a_run(name, Context.of(info).scene)
    return str(name)


OneNumber = Annotated[str, PlainValidator(_one_number, json_schema_input_type=str)]
"""The name of a variable with one number a run."""


class RunNumber(StudyTable):
    """A number of a run: a variable without dimensions, or one of its values.

    Attributes
    ----------
    of : the variable
    at : the place on its dimensions
    take : ``largest`` or ``smallest`` over those that ``at`` does not name
    """

    of: Variable
    at: dict[str, Any] = Field(default_factory=dict)
    take: Literal["", "largest", "smallest"] = ""

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        quantities = Context.of(info).scene.known_quantities
        dims, content = quantities[self.of].dims, self.content
        for dim, place in self.at.items():
            if dim not in dims:
                raise StudyError(f"at.{dim}", place, one_of(dim, dims))
        left = [dim for dim in dims if dim not in self.at]
        if left and not self.take:
            named = ", ".join(f"{dim} = …" for dim in left)
            allowed = f'is over {", ".join(dims)}: give at = {{{named}}}, or take = "largest"'
            raise StudyError("", content, allowed)
        if self.take and not left:
            raise StudyError("take", self.take, "is of one number: leave it out")
        if not self.whole and self.name in quantities:
            raise StudyError("", content, f"would be named {self.name}, as another variable is")
        return self

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
        """What is read: the name of the variable, or a table."""
        given = {"of": self.of, "at": self.at, "take": self.take}
        return self.of if self.whole else {key: each for key, each in given.items() if each}

    @model_serializer
    def _content(self) -> Any:
        return self.content

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


def _one_of_runs(content: Any, info: ValidationInfo) -> RunNumber:
    if not isinstance(content, str):
        return parsed(RunNumber, content, Context.of(info))
    try:
        return parsed(RunNumber, {"of": content}, Context.of(info))
    except StudyError as error:
        raise error.renamed(lambda field: field.removeprefix("of")) from None


OneOf = Annotated[
    RunNumber,
    BeforeValidator(_one_of_runs, json_schema_input_type=str | RunNumber),
]
"""A number of a run: the name of a variable, or a table."""


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


def checked_condition(text: Any, scene: Scene) -> Condition:
    """Return a condition on a variable with one number a run, such as ``"rigid_shift < 20 um"``."""
    found = CONDITION.fullmatch(text) if isinstance(text, str) else None
    if found is None or found["sign"][0] not in "<>":
        raise StudyError("", text, "must be NAME < NUMBER, with <, <=, > or >=")
    unit, _ = number_of_a_run(found["name"], scene)
    given = in_unit(unit, found["value"], "")
    with suppress(ValueError):
        if is_finite(limit := float(given)):
            return Condition(found["name"], found["sign"], limit)
    raise StudyError("", text, "must end with a finite number")


OneCondition = Annotated[
    Condition,
    PlainValidator(
        lambda text, info: checked_condition(text, Context.of(info).scene),
        json_schema_input_type=str,
    ),
    PlainSerializer(lambda condition: condition.text),
]
"""A condition, see `checked_condition`."""
