"""The base class of the tables of a scene file, and types of their entries."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from annotated_types import Interval, Unit
from pydantic import AfterValidator, BaseModel, ConfigDict, WithJsonSchema
from pydantic_core import PydanticCustomError

from solver.parameters import Coordinate
from studies.scenes.arithmetic import ExpressionError, Field


def _spelled(pattern: re.Pattern[str], words: str) -> tuple[Any, Any]:
    """Return the marks of a text of this pattern, which an error says in words."""

    def checked(text: str) -> str:
        if not pattern.fullmatch(text):
            raise PydanticCustomError("spelled", "must be {words}", {"words": words})
        return text

    return AfterValidator(checked), WithJsonSchema(
        {"type": "string", "pattern": f"^{pattern.pattern}$"}
    )


Label = Annotated[
    str,
    *_spelled(
        re.compile("[A-Za-z][A-Za-z0-9_]{0,59}"),
        "1 to 60 of A-Z a-z 0-9 _, beginning with a letter",
    ),
]
"""A name: 1 to 60 of ``A-Z a-z 0-9 _``, beginning with a letter."""
FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
FileName = Annotated[
    str,
    *_spelled(FILE_NAME, "the name of a file beside the scene file: 1 to 100 of A-Z a-z 0-9 _ . -"),
]
"""The name of a file beside the scene file."""


def _field(text: str) -> Field:
    try:
        return Field(text)
    except ExpressionError as error:
        raise PydanticCustomError(
            "expression",
            "must be an expression of x and y; this one {reason}",
            {"reason": str(error)},
        ) from None


FieldText = Annotated[str, AfterValidator(_field)]
"""A function of position: an expression of ``x`` and ``y``."""


class SceneTable(BaseModel):
    """A table without unknown entries; numbers are finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def unit_of(cls, name: str, given: Mapping[str, Any]) -> str | None:
        """Return the unit of an entry, None if it has none: ``given`` are those of the table."""
        del given
        return unit_in(cls.model_fields[name].metadata)


def unit_in(marks: Iterable[Any], usual: str | None = None) -> str | None:
    """Return the unit among the marks of a type."""
    return next((mark.unit for mark in marks if isinstance(mark, Unit)), usual)


class TabulatedTable(SceneTable):
    """A function of position: a column of a CSV file beside the scene, times a factor.

    Its header names ``x``, ``y`` or both, and the column; it is linear between these positions.
    """

    file: FileName
    column: Label = "value"
    times: float = 1.0


Angle = Annotated[float, Unit("deg")]
Place = tuple[Coordinate, Coordinate]
Span = tuple[Coordinate, Coordinate]
Angles = tuple[Angle, Angle]
Count = Annotated[int, Interval(ge=1, le=10_000)]
Side = Annotated[
    str, *_spelled(re.compile(r"[^.]+\.[^.]+"), "a boundary of a body, such as punch.bottom")
]
"""A boundary of a body: ``body.boundary``."""
