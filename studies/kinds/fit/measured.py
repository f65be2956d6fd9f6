"""Measured lines: numbers over another quantity, and what a run says at the same places.

A line is compared with a variable of the run, over one of its dimensions, such as residual stress
over depth, or over another variable along the same dimension, such as force over approach. Where
such a curve turns, as it does between loading and unloading, line and curve are divided, and each
piece is compared with its own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.scenes import Scene
from studies.definition.line import Read, picked
from studies.definition.parameters import in_unit
from studies.definition.spaced import is_finite
from studies.errors import StudyError, check_entries, nearest, one_of
from studies.units import UnitError, number_in, under

Numbers = NDArray[np.float64]

_KEYS = ("of", "over", "at", "values", "places", "sigma")
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredLine:
    """A measured line.

    Attributes
    ----------
    of, over : variables; `over` is empty for one number a run
    at : the place on other dimensions of the variable, and on the axes of the study
    places, values : (n,), of `over` and `of`; `places` is empty with it
    sigma : (n,) standard deviations of the values
    told : whether they were given
    unit : of the values
    """

    of: str
    over: str
    at: Mapping[str, Any]
    places: Numbers
    values: Numbers
    sigma: Numbers
    told: bool
    unit: str

    def seen(self, read: Read) -> Numbers:
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
        own = pieces(self.places)
        if len(own) > len(curve):
            there = f"{len(curve)} of the run, and {len(own)} of the measured line"
            raise ValueError(f"{self.over} turns more often than in the run: pieces are {there}")
        seen = np.empty(len(self.places))
        for mine, its in zip(own, curve, strict=False):
            seen[mine] = _at(self.places[mine], x[known][its], y[known][its], self.over)
        return seen


def pieces(x: Numbers) -> list[slice]:
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


def _at(places: Numbers, x: Numbers, y: Numbers, over: str) -> Numbers:
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


def checked_measured(content: Any, scene: Scene, axes: Collection[str]) -> list[MeasuredLine]:
    """Return the measured lines of a study.

    Parameters
    ----------
    content : a list of tables ``{of, values, over, places, sigma, at}``; or of the rows of a file
        as `read_table` returns them, ``{rows, at}``
    scene : its variables are known
    axes : names by which `at` may tell a position on the axes of the study

    Raises
    ------
    StudyError
        naming the entry, its value and what is allowed
    """
    if not isinstance(content, list | tuple) or not content:
        allowed = "must be a list of measured lines: names of files, or {of, over, places, values}"
        raise StudyError("fit.measured", content, allowed)
    return [_checked(f"fit.measured[{k}]", one, scene, axes) for k, one in enumerate(content)]


def _checked(field: str, content: Any, scene: Scene, axes: Collection[str]) -> MeasuredLine:
    if isinstance(content, str) or (isinstance(content, Mapping) and "file" in content):
        allowed = "names a file, which only a study file can: give the lines themselves"
        raise StudyError(field, content, allowed)
    if not isinstance(content, Mapping):
        raise StudyError(field, content, "must be a table {of, over, places, values, sigma, at}")
    given = dict(content)
    if "rows" in given:
        given |= _columns(field, given.pop("rows"), scene)
    check_entries(field, given, _KEYS)
    of = _known(f"{field}.of", given.get("of"), scene)
    over = _known(f"{field}.over", given["over"], scene) if given.get("over", "") != "" else ""
    unit = scene.known_quantities[of].units
    values = _numbers(f"{field}.values", given.get("values"), unit)
    places = np.empty(0)
    if over:
        along = scene.known_quantities[over].units
        places = _numbers(f"{field}.places", given.get("places", []), along)
        if len(places) != len(values) or len(places) < 2 or not np.ptp(places) > 0.0:
            allowed = (
                f"must be as many as the values, {len(values)}, and two different ones at least"
            )
            raise StudyError(f"{field}.places", f"{len(places)} numbers", allowed)
    elif "places" in given:
        raise StudyError(
            f"{field}.places", given["places"], "needs over: the name of what they are"
        )
    if not len(values):
        raise StudyError(f"{field}.values", given.get("values"), "must be one number or more")
    told = "sigma" in given
    raw = given.get("sigma", _USUAL * float(np.abs(values).max()) or 1.0)
    own = in_unit(unit, raw, f"{field}.sigma")
    if not isinstance(own, list | tuple):
        own = [own] * len(values) if is_finite(own) else []
    sigma = _numbers(f"{field}.sigma", own, unit)
    if len(sigma) != len(values) or not (sigma > 0.0).all():
        allowed = "must be a number > 0, or one for each value"
        raise StudyError(f"{field}.sigma", raw, allowed)
    at = given.get("at", {})
    if not isinstance(at, Mapping):
        raise StudyError(f"{field}.at", at, "must be a table: a place on each other dimension")
    quantity = scene.known_quantities[of]
    for name, value in at.items():
        if name not in axes and name not in quantity.dims:
            raise StudyError(f"{field}.at.{name}", value, one_of(name, [*axes, *quantity.dims]))
    return MeasuredLine(
        of=of, over=over, at=dict(at), places=places, values=values, sigma=sigma, told=told,
        unit=unit,
    )  # fmt: skip


def content_of(line: MeasuredLine) -> dict[str, Any]:
    """Return what `checked_measured` reads."""
    found: dict[str, Any] = {"of": line.of, "values": line.values.tolist()}
    if line.over:
        found |= {"over": line.over, "places": line.places.tolist()}
    if line.told:
        found["sigma"] = line.sigma.tolist()
    return found | ({"at": dict(line.at)} if line.at else {})


def _columns(field: str, rows: Any, scene: Scene) -> dict[str, Any]:
    """Return a line of the rows of a file: the columns are `over`, `of` and `SIGMA`."""
    tables = isinstance(rows, list | tuple) and all(isinstance(row, Mapping) for row in rows)
    if not tables or not rows:
        raise StudyError(f"{field}.rows", rows, "must be a list of tables: the rows of a file")
    headings = list(dict.fromkeys(key for row in rows for key in row))
    matches = [_HEADING.fullmatch(heading) for heading in headings]
    names = [m["name"] if m else h for m, h in zip(matches, headings, strict=True)]
    lines = [name for name in names if name != SIGMA]
    if not 1 <= len(lines) <= 2:
        allowed = "must have the columns PLACE and VALUE, named as variables of the runs, and sigma"
        raise StudyError(field, ", ".join(headings), allowed)
    columns, known = {}, scene.known_quantities
    for name, heading, match in zip(names, headings, matches, strict=True):
        columns[name] = [_number(field, heading, row.get(heading)) for row in rows]
        quantity = known.get(lines[-1] if name == SIGMA else name)
        if quantity and match and match["unit"] is not None:
            unit = match["unit"].strip()
            try:
                columns[name] = [under(unit, each, quantity.units) for each in columns[name]]
            except UnitError as error:
                allowed = f"must be {number_in(quantity.units)}; {error}"
                raise StudyError(field, heading, allowed) from None
    found: dict[str, Any] = {"of": lines[-1], "values": columns[lines[-1]]}
    if len(lines) == 2:
        found |= {"over": lines[0], "places": columns[lines[0]]}
    return found | ({SIGMA: columns[SIGMA]} if SIGMA in columns else {})


def _number(field: str, heading: str, text: Any) -> float:
    try:
        return float(text)
    except (TypeError, ValueError):
        raise StudyError(f"{field}.{heading}", text, "must be a number in every row") from None


def _known(field: str, name: Any, scene: Scene) -> str:
    known = scene.known_quantities
    if not isinstance(name, str) or name not in known:
        raise StudyError(field, name, f"must be a variable of the runs{nearest(name, known)}")
    return name


def _numbers(field: str, values: Any, unit: str) -> Numbers:
    if isinstance(values, list | tuple):
        values = [
            in_unit(unit, each, f"{field}[{k}]") for k, each in enumerate(values[: _MOST + 1])
        ]
    fits = isinstance(values, list | tuple) and len(values) <= _MOST and all(map(is_finite, values))
    if not fits:
        raise StudyError(field, values, "must be a list of finite numbers")
    return np.array(values, dtype=float)
