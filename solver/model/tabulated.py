"""Tables of values at positions, for loads that vary in space."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from solver.errors import ModelError
from solver.files import number_of, read_file
from solver.mesh.rounding import ROUNDED
from solver.typing import Array


def columns_of(text: str, names: Sequence[str]) -> dict[str, Array]:
    """Return the named columns (n,) of a CSV text with a header; it may have others.

    Raises
    ------
    ModelError
        if a column is absent or occurs twice, or an entry is not a finite number
    """
    listed = ", ".join(names)
    allowed = f"must be numbers under a header with {listed}"
    try:
        rows = [row for row in csv.reader(io.StringIO(text)) if any(map(str.strip, row))]
    except csv.Error as error:
        raise ModelError("table", str(error), allowed) from None
    header = [name.strip() for name in rows[0]] if rows else []
    if any(len(row) != len(header) for row in rows):
        raise ModelError("table", "a line of another length", allowed)
    if not set(names) <= set(header) or len(rows) < 2:
        words = f"must have the columns {listed}, and numbers under them"
        raise ModelError("table", ", ".join(header) or "nothing", words)
    twice = [name for name in names if header.count(name) > 1]
    if twice:
        raise ModelError("table", ", ".join(header), f"must have one column {twice[0]}")
    columns = dict(zip(header, zip(*rows[1:], strict=True), strict=True))
    try:
        found = {name: np.array([*map(number_of, columns[name])]) for name in names}
    except ValueError as error:
        raise ModelError("table", str(error), allowed) from None
    if not all(np.isfinite(each).all() for each in found.values()):
        raise ModelError("table", "nan or inf", "must be finite")
    return found


@dataclass(frozen=True, eq=False)
class Tabulated:
    """A function of position, linear between the positions of a table: a `Value` of a load.

    With x and y it is linear in the Delaunay triangles of the positions, with one of them linear
    along this axis. Outside of the table it has no value.

    Attributes
    ----------
    x, y : (n,) positions [mm], or None
    value : (n,) values
    """

    x: Array | None = None
    y: Array | None = None
    value: Array | None = None

    def __post_init__(self) -> None:
        own = [np.asarray(each, dtype=float) for each in (self.x, self.y) if each is not None]
        values = np.asarray(self.value if self.value is not None else (), dtype=float)
        shapes = [each.shape for each in (*own, values)]
        least = len(own) + 1
        if not own or len(set(shapes)) > 1 or values.ndim != 1 or len(values) < least:
            raise ModelError("table", shapes, f"must be lists of one length, {least} or more")
        if not (np.isfinite(own).all() and np.isfinite(values).all()):
            raise ModelError("table", "nan or inf", "must be finite")
        places, count = np.unique(np.array(own), axis=1, return_counts=True)
        if count.max() > 1:
            place = tuple(places[:, count.argmax()].tolist())
            raise ModelError("table", place, "must not be a position of two values")
        if len(own) == 2 and np.linalg.matrix_rank(self._scaled(np.array(own)), tol=1e-6) < 2:
            raise ModelError("table", "positions on one line", "needs x alone, or y alone")

    def __reduce__(self) -> tuple[Any, ...]:
        return Tabulated, (self.x, self.y, self.value)

    @classmethod
    def of(cls, text: str, column: str = "value") -> Tabulated:
        """Return the table of a CSV text with the columns x, y, or both, and ``column``.

        Raises
        ------
        ModelError
            if a column is absent, or an entry is not a number
        """
        first = text.lstrip().partition("\n")[0]
        header = [name.strip(' \r"') for name in first.split(",")]
        axes = [axis for axis in ("x", "y") if axis in header]
        if not axes or column in axes:
            listed = ", ".join(header) or "nothing"
            raise ModelError("table", listed, f"must have the columns x, y or both, and {column}")
        found = columns_of(text, (*axes, column))
        return cls(found.get("x"), found.get("y"), found[column])

    @classmethod
    def read(cls, path: Path | str, column: str = "value") -> Tabulated:
        """Return the table of a CSV file; see `of`."""
        return cls.of(read_file(path).decode("utf-8-sig"), column)

    def times(self, factor: float) -> Tabulated:
        """Return the table with its values multiplied by ``factor``."""
        return Tabulated(self.x, self.y, factor * np.asarray(self.value))

    def __call__(self, x: Array) -> Array:
        """Return the values (n,) at positions x (2, n).

        Raises
        ------
        ModelError
            if a position is outside the table
        """
        found = self._between(x)
        outside = np.isnan(found)
        if outside.any():
            place = tuple(float(f"{each:.6g}") for each in x[:, outside.argmax()])
            raise ModelError("table", place, f"must be inside the table: {self._range}")
        return found

    @property
    def _range(self) -> str:
        each = [f"{axis} from {np.min(own):g} to {np.max(own):g}"
                for axis, own in (("x", self.x), ("y", self.y)) if own is not None]  # fmt: skip
        return " and ".join(each) + " mm"

    @cached_property
    def _between(self) -> Callable[[Array], Array]:
        """The interpolation (2, n) -> (n,), NaN outside."""
        values = np.asarray(self.value, dtype=float)
        if self.x is not None and self.y is not None:
            return self._triangulated(np.array([self.x, self.y], dtype=float), values)
        axis = 0 if self.y is None else 1
        own = np.asarray(self.x if axis == 0 else self.y, dtype=float)
        order = np.argsort(own)
        own, values = own[order], values[order]
        beyond = ROUNDED * float(np.ptp(own))

        def along(x: Array) -> Array:
            inside = (x[axis] >= own[0] - beyond) & (x[axis] <= own[-1] + beyond)
            return np.where(inside, np.interp(x[axis], own, values), np.nan)

        return along

    @staticmethod
    def _scaled(places: Array) -> Array:
        """Return positions (2, n) relative to their mean, over their extent."""
        return np.asarray(places - places.mean(axis=1, keepdims=True)) / np.ptp(places)

    @staticmethod
    def _triangulated(places: Array, values: Array) -> Callable[[Array], Array]:

        linear = scipy.interpolate.LinearNDInterpolator(places.T, values)
        middle = places.mean(axis=1, keepdims=True)

        def between(x: Array) -> Array:
            found = np.asarray(linear(x.T))
            near = np.isnan(found)
            if near.any():  # rounding may put a position on the rim outside: move it inwards
                found[near] = linear((x + ROUNDED * (middle - x)).T[near])
            return found

        return between
