"""Curves given by points, in memory or in a file, and sections given by a mesh."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from solver.errors import ModelError
from solver.files import number_of, read_file
from solver.parameters import Pairs, require
from solver.typing import Array

_FEWEST = 4
"""Least number of points of a curve."""
_LENGTHS = {"mm": 1.0, "m": 1000.0, "um": 1e-3, "in": 25.4}
"""Units that a heading may have, in mm."""


def read_points(path: str | Path) -> Array:
    """Return the points (2, n) of a text file: z, y in each line, with comma or space between [mm].

    A first line without numbers is a heading; ``z [m], y [m]`` has the unit of the numbers. For the
    points see `checked_points`.

    Raises
    ------
    ModelError
        for ``file``, if it cannot be read, its unit is no length or a line does not have two
        numbers; for ``points``
    """
    try:
        text = read_file(path).decode()
    except (OSError, UnicodeDecodeError) as error:
        reason = "there is none" if isinstance(error, FileNotFoundError) else error
        raise ModelError("file", str(path), f"must be a readable text file: {reason}") from None
    lines = [line.replace(",", " ").split() for line in text.splitlines()]
    units = {unit.strip() for unit in re.findall(r"\[([^]]*)\]", text.partition("\n")[0])} or {"mm"}
    if len(units) > 1 or not units <= _LENGTHS.keys():
        allowed = f"must have one unit in its heading, of {', '.join(_LENGTHS)}"
        raise ModelError("file", f"{path}: [{'], ['.join(sorted(units))}]", allowed)
    points = []
    for number, line in enumerate(lines, 1):
        try:
            z, y = map(number_of, line)
        except ValueError:
            if not line or (number == 1 and any(map(str.isalpha, "".join(line)))):
                continue
            allowed = f"must have two numbers in each line; line {number} is {' '.join(line)!r}"
            raise ModelError("file", str(path), allowed) from None
        points.append((z, y))
    return checked_points(_LENGTHS[units.pop()] * np.array(points).reshape(-1, 2).T)


def as_points(field: str, value: Any) -> Pairs:
    """Return points as pairs z, y, from pairs or an array (n, 2) [mm].

    Raises
    ------
    ModelError
        for ``field``, if they are not at least four pairs of finite numbers, z increasing
    """
    with suppress(TypeError, ValueError):
        value = tuple(map(tuple, np.asarray(value, dtype=float).tolist()))
    require(field, value, Pairs)
    checked_points(np.array(value).reshape(-1, 2).T, field)
    return cast("Pairs", value)


def checked_points(points: Array, field: str = "points") -> Array:
    """Return points (2, n) of a curve from left to right, or raise `ModelError` for ``field``.

    They must be at least four finite points, the first coordinate increasing.
    """
    X = np.asarray(points, dtype=float)
    if X.ndim != 2 or len(X) != 2:
        raise ModelError(field, f"an array {X.shape}", "must have two numbers z, y for each point")
    if X.shape[1] < _FEWEST:
        raise ModelError(field, X.T.tolist(), f"must have at least {_FEWEST} points")
    for k in np.flatnonzero(~np.isfinite(X).all(axis=0))[:1]:
        raise ModelError(field, X[:, k].tolist(), f"must be finite numbers; this is point {k + 1}")
    for k in np.flatnonzero(np.diff(X[0]) <= 0)[:1]:
        allowed = f"must be points whose z increases; these are number {k} and {k + 1}"
        raise ModelError(field, X[:, k : k + 2].T.tolist(), allowed)
    return X


RUNNING, FOOT = "running", "foot"
"""Names of the lines of a section: where the wheel may touch, and where the foundation acts."""


class SectionMesh(NamedTuple):
    """A mesh of quadrilaterals with the lines `RUNNING` and `FOOT`, as plain numbers.

    Attributes
    ----------
    points : positions z, y [mm]
    cells : numbers of the points of each element, from 0 on: four corners, or with the middles of
        the sides
    running, foot : pairs of corners, the edges of the lines
    """

    points: tuple[tuple[float, float], ...]
    cells: tuple[tuple[int, ...], ...]
    running: tuple[tuple[int, int], ...]
    foot: tuple[tuple[int, int], ...]

    @property
    def in_words(self) -> str:
        """The mesh in a few words, for errors."""
        return f"a mesh of {len(self.cells)} elements"
