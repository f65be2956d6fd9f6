"""Measured lines: numbers over another quantity, and what a run says at the same places.

A line is compared with a variable of the run, over one of its dimensions, such as residual stress
over depth, or over another variable along the same dimension, such as force over approach. Where
such a curve turns, as it does between loading and unloading, line and curve are divided, and each
piece is compared with its own.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, PlainValidator, ValidationInfo, model_validator

from solver.derivatives.asked import named
from solver.files import number_of
from solver.scenes import Scene
from solver.typing import Array
from studies.definition.parameters import in_unit
from studies.definition.quantity import Line, Read, Variable, known_variable, picked
from studies.definition.rows import read_table
from studies.definition.schema import Context, StudyTable, is_finite
from studies.definition.sweep import linked_values
from studies.errors import StudyError, Unchecked, one_of
from studies.toml import CASE
from studies.units import UnitError, number_in, under

_HEADING = re.compile(r"(?P<name>[^\[\]]+?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
SIGMA = "sigma"
"""Heading of the column with the standard deviations."""
_USUAL = 0.01
"""Standard deviation if none is given, as a share of the largest value of a line."""
_TURN = 0.02
"""Least way back, as a share of the range, after which a curve has turned."""
_BEYOND = 0.5
"""Largest distance from the ends of a curve to which it is continued, as a share of its range."""
_MOST = 100_000
_STEP = 1e-6
"""Difference of a parameter, over its range, by which derivatives of curves move them."""


def _numbers(content: Any, info: ValidationInfo) -> list[float]:
    """Return a list of finite numbers in the unit of their variable."""
    of = info.data.get("over" if info.field_name == "places" else "of")
    if of is None:
        raise Unchecked
    if not of:
        raise StudyError("", content, "needs over: the name of what they are")
    unit = Context.of(info).scene.known_quantities[of].units
    if isinstance(content, list | tuple):
        content = [in_unit(unit, each, f"[{k}]") for k, each in enumerate(content[: _MOST + 1])]
    known = isinstance(content, list) and len(content) <= _MOST and all(map(is_finite, content))
    if not known or not content:
        raise StudyError("", content, "must be a list of finite numbers, one or more")
    return [*map(float, content)]


def _deviations(content: Any, info: ValidationInfo) -> list[float]:
    """Return the standard deviations; a number is that of all values."""
    values, of = info.data.get("values", ()), info.data.get("of")
    if not values or of is None:
        raise Unchecked
    if not isinstance(content, list | tuple):
        own = in_unit(Context.of(info).scene.known_quantities[of].units, content, "")
        found = [float(own)] * len(values) if is_finite(own) else []
    else:
        found = _numbers(content, info)
    if len(found) != len(values) or not all(each > 0.0 for each in found):
        raise StudyError("", content, "must be a number > 0, or one for each value")
    return found


def _over(name: Any, info: ValidationInfo) -> str:
    return "" if name == "" else known_variable(name, info)


_Numbers = Annotated[
    list[float], PlainValidator(_numbers, json_schema_input_type=list[float | str])
]


class MeasuredLine(StudyTable):
    """A measured line; ``rows`` of a file, as `read_table` returns them, stand for its lists.

    Attributes
    ----------
    of, over : variables; `over` is empty for one number a run
    values, places : numbers of `of` and `over`; `places` is empty with it
    sigma : standard deviations of the values
    at : the place on other dimensions of the variable, and on the axes of the study
    """

    of: Variable
    over: Annotated[str, PlainValidator(_over, json_schema_input_type=str)] = ""
    values: _Numbers
    places: _Numbers = Field(default_factory=list)
    sigma: Annotated[
        list[float],
        PlainValidator(_deviations, json_schema_input_type=float | str | list[float | str]),
    ] = Field(default_factory=list)
    at: dict[str, Any] = Field(default_factory=dict)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> Any:
        """Add the rows of a file."""
        found = handler.resolve_ref_schema(whole := handler(core))
        found |= {"if": {"required": ["rows"]}, "else": {"required": found.pop("required")}}
        found["properties"]["rows"] = {"type": "array", "items": {"type": "object"}}
        return whole

    @model_validator(mode="before")
    @classmethod
    def _columns(cls, content: Any, info: ValidationInfo) -> Any:
        """Return the columns of the rows of a file."""
        if isinstance(content, str) or (isinstance(content, Mapping) and "file" in content):
            allowed = "names a file, which only a study file can: give the lines themselves"
            raise StudyError("", content, allowed)
        if not isinstance(content, Mapping) or "rows" not in content:
            return content
        rest = {key: each for key, each in content.items() if key != "rows"}
        return rest | _columns(content["rows"], Context.of(info).scene)

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        quantity, count = Context.of(info).scene.known_quantities[self.of], len(self.places)
        if self.over and (count != len(self.values) or len({*self.places}) < 2):
            two = f"must be as many as the values, {len(self.values)}, and two different ones"
            raise StudyError("places", f"{count} numbers", f"{two} at least")
        axes = {**(swept := Context.of(info).axes), **linked_values(swept)}
        for name, value in self.at.items():
            if name not in axes and name not in quantity.dims:
                raise StudyError(f"at.{name}", value, one_of(name, [*axes, *quantity.dims]))
        return self

    @property
    def deviations(self) -> list[float]:
        """The standard deviations of the values."""
        usual = _USUAL * max(map(abs, self.values)) or 1.0
        return self.sigma or [usual] * len(self.values)

    def derived(self, by: str, scene: Scene) -> bool:
        """Whether runs have the derivatives of the line by a parameter.

        That of another line at a number of a dimension is not known: the number may move.
        """
        if any(isinstance(at, float) for at in self.at.values()):
            return False
        known = scene.known_quantities
        return all(named(each, by) in known for each in {self.of, self.over} - {""})

    def with_slopes(self, read: Read, widths: Mapping[str, float]) -> Array:
        """Return `seen`, and its derivatives by parameters, times the widths of their ranges.

        The columns (n, 1 + n_parameters) of derivatives that the run lacks are NaN.
        """
        columns = [self.seen(read)]
        for by, width in widths.items():
            lines = self._moved(read, by, _STEP * width)

            def moved(name: str, own: Mapping[str, Line] = lines) -> Line | None:
                return own.get(name) or read(name)

            there = self.seen(moved) if lines else np.full(len(self.values), np.nan)
            columns.append((there - columns[0]) / _STEP)
        return np.column_stack(columns)

    def _moved(self, read: Read, by: str, step: float) -> dict[str, Line]:
        """Return the lines after a step of a parameter; none if one has no derivative."""
        found = dict[str, Line]()
        for name in {self.of, self.over} - {""}:
            line, change = read(name), read(named(name, by))
            if line is None or change is None:
                return {}
            if not np.isfinite(change.values[np.isfinite(line.values)]).all():
                return {}
            found[name] = line._replace(values=line.values + step * change.values)
        return found

    def seen(self, read: Read) -> Array:
        """Return what a run says at the places (n,).

        Raises
        ------
        ValueError
            if the run has no such line, or it does not reach so far
        """
        if not self.over:
            return np.full(len(self.values), float(picked(read, self.of, self.at).item()))
        found = read(self.over)
        if found is None:
            raise ValueError(f"the run has no {self.over}")
        keeps = found.dims[-1:]
        x = picked(read, self.over, self.at, keeps)
        y = picked(read, self.of, self.at, keeps)
        known = np.isfinite(x) & np.isfinite(y)
        curve = pieces(x[known])
        places = np.array(self.places)
        own = pieces(places)
        if len(own) > len(curve):
            there = f"{len(curve)} of the run, and {len(own)} of the measured line"
            raise ValueError(f"{self.over} turns more often than in the run: pieces are {there}")
        seen = np.empty(len(places))
        for mine, its in zip(own, curve, strict=False):
            seen[mine] = _at(places[mine], x[known][its], y[known][its], self.over)
        return seen


def pieces(x: Array) -> list[slice]:
    """Return the pieces of a curve between its turns, each with both of its ends.

    A way back of less than `_TURN` of the range is no turn.
    """
    least, found, start, far, sign = _TURN * float(np.ptp(x)) if len(x) else 0.0, [], 0, 0, 0.0
    for k in range(1, len(x)):
        way = float(x[k] - x[far])
        if not sign:
            sign = math.copysign(1.0, way) if abs(way) > least else 0.0
            far = k if sign else far
        elif sign * way >= 0.0:
            far = k
        elif -sign * way > least:
            found.append(slice(start, far + 1))
            start, far, sign = far, k, -sign
    return [*found, slice(start, len(x))]


def _at(places: Array, x: Array, y: Array, over: str) -> Array:
    """Return a piece of a curve at places: between its points, and a little beyond its ends."""
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    different = np.concatenate([[True], np.diff(x) > 0.0])
    x, y = x[different], y[different]
    if len(x) < 2:
        raise ValueError(f"{over} has fewer than two values in the run")
    reach = _BEYOND * (x[-1] - x[0])
    if places.min() < x[0] - reach or places.max() > x[-1] + reach:
        raise ValueError(
            f"{over} is measured from {places.min():.6g} to {places.max():.6g}, and the run has it "
            f"from {x[0]:.6g} to {x[-1]:.6g}"
        )
    k = np.clip(np.searchsorted(x, places) - 1, 0, len(x) - 2)
    slope = (y[k + 1] - y[k]) / (x[k + 1] - x[k])
    return np.asarray(y[k] + slope * (places - x[k]))


def _columns(rows: Any, scene: Scene) -> dict[str, Any]:
    """Return a line of the rows of a file: the columns are `over`, `of` and `SIGMA`."""
    tables = isinstance(rows, list | tuple) and all(isinstance(row, Mapping) for row in rows)
    if not tables or not rows:
        raise StudyError("rows", rows, "must be a list of tables: the rows of a file")
    headings = list(dict.fromkeys(key for row in rows for key in row))
    matches = [_HEADING.fullmatch(heading) for heading in headings]
    names = [m["name"] if m else h for m, h in zip(matches, headings, strict=True)]
    lines = [name for name in names if name != SIGMA]
    if not 1 <= len(lines) <= 2:
        allowed = "must have the columns PLACE and VALUE, named as variables of the runs, and sigma"
        raise StudyError("", ", ".join(headings), allowed)
    columns, known = {}, scene.known_quantities
    for name, heading, match in zip(names, headings, matches, strict=True):
        columns[name] = [_number(heading, row.get(heading)) for row in rows]
        quantity = known.get(lines[-1] if name == SIGMA else name)
        if quantity and match and match["unit"] is not None:
            unit = match["unit"].strip()
            try:
                columns[name] = [under(unit, each, quantity.units) for each in columns[name]]
            except UnitError as error:
                allowed = f"must be {number_in(quantity.units)}; {error}"
                raise StudyError("", heading, allowed) from None
    found: dict[str, Any] = {"of": lines[-1], "values": columns[lines[-1]]}
    if len(lines) == 2:
        found |= {"over": lines[0], "places": columns[lines[0]]}
    return found | ({SIGMA: columns[SIGMA]} if SIGMA in columns else {})


def _number(heading: str, text: Any) -> float:
    try:
        return number_of(text)
    except (AttributeError, ValueError):
        raise StudyError(heading, text, "must be a number in every row") from None


def with_files(content: Any, folder: Path, given: Sequence[Path]) -> Any:
    """Return a fit with the rows of its measured lines.

    Parameters
    ----------
    content : the entry of a study; None if it has none
    folder : of the study
    given : tables, in place of those that the fit names; the place of one on other dimensions may
        be behind its name: ``crater.csv@stage=unloaded,pass=2``
    """
    if given and not isinstance(content := {} if content is None else content, dict):
        raise StudyError("fit", content, "must be a table")
    if given:
        return content | {"measured": [_at_place(str(each), "--measured") for each in given]}
    if not isinstance(content, dict) or "measured" not in content:
        return content
    lines = content["measured"] if isinstance(content["measured"], list) else [content["measured"]]
    every = [_with_rows(each, f"fit.measured[{k}]", folder) for k, each in enumerate(lines)]
    return content | {"measured": every}


def _with_rows(line: Any, field: str, folder: Path) -> Any:
    """Return a measured line with the rows of its file, if it names one."""
    given = {"file": line} if isinstance(line, str) else line
    if not isinstance(given, dict) or not isinstance(given.get("file"), str):
        return line
    rest = {key: value for key, value in given.items() if key != "file"}
    return rest | {"rows": read_table(folder / given["file"], field)}


def _at_place(text: str, field: str) -> dict[str, Any]:
    """Return the rows of a measured line, and its place, which may be behind the file's name."""
    signs = [k for k in range(len(text) - 1, 0, -1) if text[k] == "@" and "=" in text[k:]]
    # Path.is_file raises an error for a text that is too long for the name of a file
    there = (k for k in [len(text), *signs] if os.path.isfile(text[:k]))  # noqa: PTH113
    end = next(there, signs[0] if signs else len(text))  # names and folders may have these signs
    name, places = text[:end], text[end + 1 :]
    if not places:
        return {"rows": read_table(text, field)}
    at: dict[str, Any] = {}
    for each in places.split(","):
        dim, sign, value = each.partition("=")
        if not (dim and sign and value):
            raise StudyError(field, text, "must be FILE, or FILE@NAME=VALUE,NAME=VALUE")
        try:
            at[dim] = value if dim == CASE else float(value)
        except ValueError:
            at[dim] = value
    return {"rows": read_table(name, field), "at": at}
