"""Values along named lines and at named points.

Lines are sampled at equal fractions of their length, so that runs with lines of different lengths
share one index; the positions are stored too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from solver.results.quantities import along_axes, declare, declare_along, placed
from solver.tensors import AXES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.results.fields import Solved, SystemFields
    from solver.results.run import Values
    from solver.results.view import Places

    Array = NDArray[np.float64]

FRACTION = declare(
    "fraction", "fraction of the length of a line or contact surface", dims=("fraction",)
)
LINE = declare("line", "line", "", dims=("line",))
POINT = declare("point", "point", "", dims=("point",))

_LINE = ("line", "fraction")
_STATES = ("line", "stage", "fraction")
LINE_AT = declare_along("line_{}", "position along {} of a point of the line", "mm", dims=_LINE)
LINE_S = declare("line_s", "distance from the start of the line", "mm", dims=_LINE)
LINE_STRESS = declare(
    "line_stress",
    "stress along the line",
    "MPa",
    dims=("line", "stage", "component", "fraction"),
    beside=placed("line", *AXES, "s"),
)
LINE_MISES = declare("line_mises", "von Mises stress along the line", "MPa", dims=_STATES)
LINE_STRAIN = declare(
    "line_plastic_strain", "equivalent plastic strain along the line", dims=_STATES
)

_POINT = ("point", "stage")
POINT_AT = declare_along("point_{}", "position of the point along {}", "mm", dims=("point",))
POINT_STRESS = declare(
    "point_stress",
    "stress at the point",
    "MPa",
    dims=("point", "stage", "component"),
    beside=placed("point", *AXES),
)
POINT_MISES = declare("point_mises", "von Mises stress at the point", "MPa", dims=_POINT)
POINT_STRAIN = declare(
    "point_plastic_strain", "equivalent plastic strain at the point", dims=_POINT
)
POINT_MOVED = declare_along(
    "point_displacement_{}", "displacement of the point along {}", "mm", dims=_POINT
)


def along_lines(
    fields: SystemFields, lines: Mapping[str, Places], states: Sequence[Solved]
) -> Values:
    """Return stress and plastic strain in each state along lines with equal numbers of points."""
    X = np.stack([line.X for line in lines.values()])
    distance = np.linalg.norm(np.diff(X, axis=2), axis=1)
    found = _states(fields, lines, states)
    return {
        LINE: np.array(list(lines)),
        FRACTION: np.linspace(0.0, 1.0, X.shape[2]),
        **along_axes(LINE_AT, X.swapaxes(0, 1)),
        LINE_S: np.pad(np.cumsum(distance, axis=1), ((0, 0), (1, 0))),
        LINE_STRESS: found["stress"],
        LINE_MISES: found["mises"],
        LINE_STRAIN: found["plastic_strain"],
    }


def at_points(
    fields: SystemFields, points: Mapping[str, Places], states: Sequence[Solved]
) -> Values:
    """Return stress, plastic strain and displacement at points in each state."""
    found = {name: each[..., 0] for name, each in _states(fields, points, states).items()}
    X = np.stack([point.X[:, 0] for point in points.values()])
    return {
        POINT: np.array(list(points)),
        **along_axes(POINT_AT, X.T),
        POINT_STRESS: found["stress"],
        POINT_MISES: found["mises"],
        POINT_STRAIN: found["plastic_strain"],
        **along_axes(POINT_MOVED, np.moveaxis(found["displacement"], -1, 0)),
    }


def _states(
    fields: SystemFields, places: Mapping[str, Places], states: Sequence[Solved]
) -> dict[str, Array]:
    """Return each field as an array over places, states, its components and points."""
    every = [fields.at_places(each, states) for each in places.values()]
    names = every[0][0]._fields
    return {
        name: np.stack([np.stack([getattr(at, name) for at in place]) for place in every])
        for name in names
    }
