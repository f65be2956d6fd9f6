"""Values along named lines and at named points.

Lines are sampled at equal fractions of their length, so that runs with lines of different length
have the same index. The positions are stored too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from solver.results.body_fields import BODY_FIELDS, STORED
from solver.results.fields import Solved, SystemFields
from solver.results.quantities import along_axes, declare, declare_along, placed
from solver.results.run import Values
from solver.results.view import Places
from solver.tensors import AXES
from solver.typing import Array

FRACTION = declare(
    "fraction", "fraction of the length of a line or contact surface", dims=("fraction",)
)
LINE = declare("line", "line", "", dims=("line",))
POINT = declare("point", "point", "", dims=("point",))

_LINE = ("line", "fraction")
LINE_AT = declare_along("line_{}", "position along {} of a point of the line", "mm", dims=_LINE)
LINE_S = declare("line_s", "distance from the start of the line", "mm", dims=_LINE)
LINE_FIELDS = {
    name: declare(
        f"line_{name}", f"{BODY_FIELDS[name].long_name} along the line", BODY_FIELDS[name].units,
        dims=("line", "stage", *filter(None, [BODY_FIELDS[name].over]), "fraction"),
        beside=placed("line", *AXES, "s"),
    )
    for name in STORED
}  # fmt: skip
"""Variables along lines, by field."""

_POINT = ("point", "stage")
POINT_AT = declare_along("point_{}", "position of the point along {}", "mm", dims=("point",))
POINT_FIELDS = {
    name: declare(
        f"point_{name}", f"{BODY_FIELDS[name].long_name} at the point", BODY_FIELDS[name].units,
        dims=(*_POINT, *filter(None, [BODY_FIELDS[name].over])), beside=placed("point", *AXES),
    )
    for name in STORED
}  # fmt: skip
"""Variables at points, by field."""
POINT_MOVED = declare_along(
    "point_displacement_{}", "displacement of the point along {}", "mm", dims=_POINT
)


def along_lines(
    fields: SystemFields, lines: Mapping[str, Places], states: Sequence[Solved]
) -> Values:
    """Return the fields in each state along lines with equal numbers of points."""
    X = np.stack([line.X for line in lines.values()])
    distance = np.linalg.norm(np.diff(X, axis=2), axis=1)
    found = _states(fields, lines, states)
    return {
        LINE: np.array(list(lines)),
        FRACTION: np.linspace(0.0, 1.0, X.shape[2]),
        **along_axes(LINE_AT, X.swapaxes(0, 1)),
        LINE_S: np.pad(np.cumsum(distance, axis=1), ((0, 0), (1, 0))),
        **{quantity: found[name] for name, quantity in LINE_FIELDS.items()},
    }


def at_points(
    fields: SystemFields, points: Mapping[str, Places], states: Sequence[Solved]
) -> Values:
    """Return the fields and displacement at points in each state."""
    found = {name: each[..., 0] for name, each in _states(fields, points, states).items()}
    X = np.stack([point.X[:, 0] for point in points.values()])
    return {
        POINT: np.array(list(points)),
        **along_axes(POINT_AT, X.T),
        **{quantity: found[name] for name, quantity in POINT_FIELDS.items()},
        **along_axes(POINT_MOVED, np.moveaxis(found["displacement"], -1, 0)),
    }


def _states(
    fields: SystemFields, places: Mapping[str, Places], states: Sequence[Solved]
) -> dict[str, Array]:
    """Return each field as an array (n_places, n_states, components ..., n_points)."""
    every = [fields.at_places(each, states) for each in places.values()]
    names = every[0][0]._fields
    return {
        name: np.stack([np.stack([getattr(at, name) for at in place]) for place in every])
        for name in names
    }
