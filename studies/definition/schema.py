"""What the tables of a study are made of: their base, types of entries, ranges of parameters.

A table is a model of pydantic, which is read once, by `parsed`. Names of parameters and variables
are those of a scene, which the checks of entries find in the `Context`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from inspect import getdoc
from typing import Annotated, Any, Literal, Self, TypeGuard, TypeVar

from annotated_types import Interval
from pydantic import (
    BaseModel,
    ConfigDict,
    PlainValidator,
    Strict,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)

from solver.parameters import is_number
from solver.scenes import Scene
from studies.definition.identity import canonical
from studies.definition.parameters import Parameter, of_material, parameters_of
from studies.errors import Mistakes, StudyError, Unchecked, encodable, nearest
from studies.scenes.refusals import dotted, mistakes_of

MAXIMUM_RUNS = 100_000
"""Largest number of values of an axis, of its points, and of runs of a study."""
_DIGITS = 12
"""Number of digits to which values are rounded."""


def _documented(schema: dict[str, Any], table: type) -> None:
    """Describe the entries of a table as the docstrings of the class and of its bases do."""
    for base in reversed(table.__mro__):
        summary, _, rest = (getdoc(base) or "").partition("\n\nAttributes\n----------\n")
        schema["description"] = " ".join(summary.split())
        for each in re.split(r"^(?=\w[\w, ]* : )", rest, flags=re.MULTILINE)[1:]:
            names, _, text = each.partition(" : ")
            for entry in map(schema["properties"].get, names.split(", ")):
                if entry is not None:
                    entry["description"] = " ".join(text.split()).replace("`", "")


class StudyTable(BaseModel):
    """A table of a study, without unknown entries; numbers are finite."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, json_schema_extra=_documented
    )


Read = TypeVar("Read", bound=BaseModel)


def parsed(table: type[Read], content: Any, context: Any = None) -> Read:
    """Return what a table says.

    Raises
    ------
    StudyError
        with all its mistakes; checks of entries raise it with a field below the entry
    """
    if isinstance(content, Mapping):  # JSON may hold lone surrogates, which pydantic cannot name
        content = {encodable(str(name)): each for name, each in content.items()}
    try:
        return table.model_validate(content, context=context)
    except ValidationError as error:
        refusal = _refusal(error, table)

    def own(field: str) -> str:
        """Return the name of an entry; one that is given alone has no place in a list."""
        name, first, rest = field.partition("[0]")
        return (
            name + rest if first and not isinstance(content.get(name, []), list | tuple) else field
        )

    raise refusal.renamed(own) if isinstance(content, Mapping) else refusal


def _refusal(error: ValidationError, table: type[BaseModel]) -> StudyError:
    wrong, rest = Mistakes(), list[Any]()
    for each in error.errors():
        cause = each.get("ctx", {}).get("error")
        if isinstance(cause, StudyError):
            wrong.add(dotted(each["loc"]), cause)
        else:
            rest.append(each)
    others = ValidationError.from_exception_data(error.title, rest)
    for mistake in mistakes_of(others, table).values():
        wrong.add("", mistake)
    return wrong.error


@dataclass(slots=True)
class Context:
    """What the entries of a study are checked against.

    Attributes
    ----------
    found : the scene; None if the study names none that is known
    swept : the axes; None if they have mistakes
    varied : words of the sweep, its points and the kind of study: all parameters that vary
    """

    found: Scene | None
    swept: dict[str, Any] | None = None
    varied: frozenset[str] = frozenset()

    @staticmethod
    def of(info: ValidationInfo) -> Context:
        """Return that of a check."""
        assert isinstance(info.context, Context)
        return info.context

    @property
    def scene(self) -> Scene:
        """The scene."""
        if self.found is None:
            raise Unchecked
        return self.found

    @property
    def known(self) -> Mapping[str, Parameter]:
        """The parameters of the scene."""
        return parameters_of(self.scene)

    @property
    def axes(self) -> dict[str, Any]:
        """The axes of the study."""
        if self.swept is None:
            raise Unchecked
        return self.swept


# -- types of entries ----------------------------------------------------------------------------


def checked_text(text: Any) -> str:
    """Return the name of a study or a label, if files and command lines can have it."""
    if isinstance(text, str) and _TEXT.fullmatch(text):
        return text
    raise StudyError("", text, "must be 1 to 80 of A-Z a-z 0-9 . _ -, not beginning with a dot")


_TEXT = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,79}")
Text = Annotated[
    Any, PlainValidator(checked_text),
    WithJsonSchema({"type": "string", "pattern": f"^{_TEXT.pattern}$"}),
]  # fmt: skip
"""A name, see `checked_text`."""
Whole = Annotated[int, Strict()]
Number = Annotated[float, Strict()]


_TABLES = (
    "points", "sample", "goal", "refine", "fit", "minimise", "fatigue", "derivatives",
)  # fmt: skip
OF_STUDY = (*_TABLES, "extends", "keep", "allow", "note", "tags", "licence", "cite", "doi")
"""Entries of a study that are often written among its parameters, those that are tables first."""


def listed(given: Any) -> Any:
    """Return a list of what may be given alone."""
    return [*given] if isinstance(given, list | tuple) else [given]


def known_name(name: Any, known: Mapping[str, Any], value: Any) -> None:
    """Refuse a value if its name is no parameter of the scene."""
    if name in OF_STUDY and name not in known:
        allowed = f"is an entry of the study, not of this table: write {name} above all tables"
        table = f", or as the table [{name}]" if name in _TABLES else ""
        raise StudyError("", value, allowed + table)
    if name not in known:
        allowed = f"the scene has no such parameter; it has {', '.join(known)}"
        raise StudyError("", value, allowed + nearest(name, known))


def checked_settings(
    content: Any, known: Mapping[str, Parameter], varied: Collection[str] = ()
) -> dict[str, Any]:
    """Return a table of parameters of the scene, normalised.

    Those of its material are in it, except those that it has itself or that are ``varied``.
    """
    if not isinstance(content, Mapping):
        raise StudyError("", content, "must be a table of parameters")
    wrong = Mistakes()
    material, rest = of_material(content, known, wrong)
    found = {name: value for name, value in material.items() if name not in varied}
    for name, value in rest.items():
        with wrong.at(str(name)):
            known_name(name, known, value)
            found[name] = known[name].normalise(value, "")
    wrong.report()
    return found


def filled(given: Mapping[Any, Any], known: Mapping[str, Parameter]) -> dict[Any, dict[str, Any]]:
    """Return positions of an axis that set the same parameters, with defaults; none twice."""
    own = [key for key in known if any(key in each for each in given.values())]
    found, seen, wrong = dict[Any, dict[str, Any]](), dict[str, Any](), Mistakes()
    for at, settings in given.items():
        found[at] = {key: settings.get(key, known[key].default) for key in own}
        if (first := seen.setdefault(canonical(found[at]), at)) != at:
            field = f"[{at}]" if isinstance(at, int) else at
            allowed = f"sets the same parameters as {first}: keep one"
            wrong.add("", StudyError(field, settings, allowed))
    wrong.report()
    return found


Settings = Annotated[
    dict[str, Any],
    PlainValidator(
        lambda given, info: checked_settings(given, Context.of(info).known, Context.of(info).varied)
    ),
    WithJsonSchema({"type": "object"}),
]
"""Values of parameters of the scene."""


# -- ranges --------------------------------------------------------------------------------------


def is_finite(value: object) -> TypeGuard[float]:
    """Whether a value is a finite number; an integer of hundreds of digits is none."""
    with suppress(OverflowError):
        return is_number(value) and math.isfinite(value)
    return False


def rounded(value: float) -> float:
    """Return a value with as many digits as a study needs: 0.3, not 0.30000000000000004."""
    return float(f"{value:.{_DIGITS}g}")


def _end(value: Any, info: ValidationInfo) -> float:
    parameter = info.context
    assert isinstance(parameter, Parameter)
    number = parameter.in_own_unit(value, "")
    if not is_finite(number):
        raise parameter.refusal("", value)
    return number


_End = Annotated[
    float, PlainValidator(_end, json_schema_input_type=float | str)
]  # a text has a unit


class Range(StudyTable):
    """The numbers from one value of a parameter to another.

    Attributes
    ----------
    start, stop : its ends, in the unit of the parameter
    spacing : whether steps between them have equal differences or (``log``) equal ratios
    """

    start: _End
    stop: _End
    spacing: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _above_zero(self) -> Self:
        for key in ("start", "stop") if self.spacing == "log" else ():
            if not getattr(self, key) > 0:
                raise StudyError(key, getattr(self, key), "must be > 0 for spacing = log")
        return self

    @classmethod
    def read(cls, content: Any, parameter: Parameter) -> Self:
        """Return a range from the lowest value to the highest, both allowed for a parameter.

        ``[lowest, highest]`` is such a range, as is a table of the entries.
        """
        listed = isinstance(content, list | tuple) and len(content) == 2
        if not listed and not isinstance(content, Mapping):
            allowed = "must be [lowest, highest], or {start, stop, spacing = linear or log}"
            raise StudyError("", content, allowed)
        given = dict(zip(("start", "stop"), content, strict=True)) if listed else content
        places = {"start": "[0]", "stop": "[1]"} if listed else {}
        try:
            found = parsed(cls, given, parameter)
            ends = {key: parameter.number(getattr(found, key), key) for key in ("start", "stop")}
        except StudyError as error:
            raise error.renamed(lambda own: places.get(own, own)) from None
        if not ends["start"] < ends["stop"]:
            raise StudyError("", content, "must begin with its lowest value")
        return found.model_copy(update=ends)

    def value(self, share: float) -> float:
        """Return the value at a share of the way, of the difference or (``log``) of the ratio."""
        if self.spacing == "log":
            return float(self.start * (self.stop / self.start) ** share)
        return self.start + (self.stop - self.start) * share

    def inside(self, share: float) -> float:
        """Return the value at a share of the way, rounded, and not beyond the ends."""
        return min(max(rounded(self.value(share)), self.start), self.stop)

    def share(self, value: float) -> float:
        """Return the share of the way at a value."""
        if self.spacing == "log":
            return math.log(value / self.start) / math.log(self.stop / self.start)
        return (value - self.start) / (self.stop - self.start)

    def slope(self, value: float) -> float:
        """Return how much the value grows by the share."""
        if self.spacing == "log":
            return value * math.log(self.stop / self.start)
        return self.stop - self.start


Limits = tuple[float | str, float | str]
"""``[lowest, highest]``, in JSON Schemas."""


class Steps(Range):
    """An axis: the values of a range in ``num - 1`` steps, in either direction.

    Attributes
    ----------
    num : number of values
    """

    num: Annotated[int, Strict(), Interval(ge=2, le=MAXIMUM_RUNS)]

    @property
    def values(self) -> list[float]:
        """The values; whole numbers are int, so that they suit integer parameters."""
        between = (self.value(k / (self.num - 1)) for k in range(1, self.num - 1))
        every = map(rounded, (float(self.start), *between, float(self.stop)))
        return [int(value) if value.is_integer() else value for value in every]
