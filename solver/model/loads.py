"""Loads of a body, each with its own course over time.

Every load is given at load factor one. Its factor at a time is that of its amplitude; without an
amplitude time is the load factor.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError
from solver.model.amplitude import Amplitude

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Field = Callable[[Array], Array]

_ALWAYS = Amplitude.constant(1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Load:
    """What all loads have.

    Attributes
    ----------
    amplitude : load factor over time; when absent, time is the load factor
    """

    amplitude: Amplitude | None = None

    def factor(self, time: float) -> float:
        """Return the load factor at a time."""
        return time if self.amplitude is None else self.amplitude.at(time)

    @property
    def name(self) -> str:
        """Its name in messages."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", type(self).__name__).lower()

    @property
    def boundaries(self) -> tuple[str, ...]:
        """The boundaries of the body that it acts on."""
        return ()

    @property
    def outside(self) -> bool:
        """Whether these must lie on the outside of the body."""
        return True

    @property
    def varies(self) -> bool:
        """Whether it changes with time."""
        return True

    def check(self) -> None:
        """Raise `ModelError` for a value that is not allowed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _OnBoundary(Load):
    """A load on a named boundary."""

    boundary: str

    @property
    def boundaries(self) -> tuple[str, ...]:
        """The boundary that it acts on."""
        return (self.boundary,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pressure(_OnBoundary):
    """A pressure on a boundary, positive when it pushes: ``value`` [MPa]."""

    value: float

    def check(self) -> None:
        """Raise `ModelError` for a pressure that is not finite."""
        _finite(f"pressure.{self.boundary}", self.value, "MPa")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Traction(_OnBoundary):
    """A force per area on a boundary, in fixed directions: ``x`` and ``y`` [MPa]."""

    x: float = 0.0
    y: float = 0.0

    def check(self) -> None:
        """Raise `ModelError` for a component that is not finite."""
        for axis in ("x", "y"):
            _finite(f"traction.{self.boundary}.{axis}", getattr(self, axis), "MPa")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Displacement(_OnBoundary):
    """A prescribed displacement of a boundary: ``x`` and ``y`` [mm], None where it is free."""

    x: float | None = None
    y: float | None = None

    @property
    def outside(self) -> bool:
        """Facets inside a body may be moved as well."""
        return False

    @property
    def components(self) -> dict[int, float]:
        """The prescribed components: 0 (x) or 1 (y) -> displacement [mm]."""
        given = enumerate((self.x, self.y))
        return {axis: value for axis, value in given if value is not None}

    def check(self) -> None:
        """Raise `ModelError` where no component is given, or one is not finite."""
        if not self.components:
            raise ModelError(f"displacement.{self.boundary}", None, "must give x, y or both [mm]")
        for axis, value in self.components.items():
            _finite(f"displacement.{self.boundary}.{'xy'[axis]}", value, "mm")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Temperature(Load):
    """A rise of temperature, which lets the body expand, and may soften it.

    Attributes
    ----------
    rise : a number, or a function (positions (2, n) [mm]) -> (n,) [K]
    expansion : coefficient of linear thermal expansion [1/K]
    modulus_drop, yield_drop : shares of Young's modulus and of the yield stress that are lost for
        each kelvin [1/K]. Every slope of the tension curve falls with Young's modulus
    """

    rise: float | Field
    expansion: float
    modulus_drop: float = 0.0
    yield_drop: float = 0.0

    def check(self) -> None:
        """Raise `ModelError` for a number that is not finite."""
        for name in ("expansion", "modulus_drop", "yield_drop"):
            _finite(f"temperature.{name}", getattr(self, name), "1/K")
        if not callable(self.rise):
            _finite("temperature.rise", self.rise, "K")

    @property
    def softens(self) -> bool:
        """Whether it changes the elastic constants or the yield stress."""
        return bool(self.modulus_drop or self.yield_drop)

    def at(self, x: Array) -> Array:
        """Return the rise of temperature (n,) at positions (2, n) [K]."""
        rise = self.rise(x) if callable(self.rise) else self.rise
        return _field("temperature.rise", rise, (x.shape[1],), "K")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InitialStress(Load):
    """Stress present before any load, for instance from manufacture.

    It is there from the beginning, and is brought to equilibrium before any load acts: what is not
    in balance bends the body. Give no amplitude.

    Attributes
    ----------
    stress : a function (positions (2, n) [mm]) -> components xx, yy, zz, xy (4, n) [MPa]
    """

    stress: Field
    amplitude: Amplitude | None = _ALWAYS

    @classmethod
    def on_grid(cls, x: Array, y: Array, stress: Array) -> InitialStress:
        """Return the stress that was measured or computed on a grid, linear between its points.

        Parameters
        ----------
        x, y : (n_x,), (n_y,) positions, in order [mm]; the grid must hold the body
        stress : (4, n_y, n_x) components xx, yy, zz, xy [MPa]
        """
        from scipy.interpolate import RegularGridInterpolator

        name, values = "initial_stress.stress", np.asarray(stress, dtype=float)
        if values.shape != (4, len(y), len(x)):
            raise ModelError(name, values.shape, f"must have the shape {(4, len(y), len(x))}")
        try:
            along = RegularGridInterpolator((y, x), np.moveaxis(values, 0, -1))
        except ValueError as error:
            raise ModelError(
                name, "this grid", f"must have increasing positions: {error}"
            ) from None

        def between(at: Array) -> Array:
            try:
                return np.asarray(along(at[::-1].T).T)
            except ValueError:
                held = f"x {x[0]:g} to {x[-1]:g}, y {y[0]:g} to {y[-1]:g} mm"
                raise ModelError(name, held, "the grid must hold the whole body") from None

        return cls(stress=between)

    @property
    def varies(self) -> bool:
        """It is there from the beginning."""
        return False

    def check(self) -> None:
        """Raise `ModelError` where the stress is no function, or has an amplitude."""
        if not callable(self.stress):
            raise ModelError("initial_stress.stress", self.stress, "must be a function of position")
        if self.amplitude is not _ALWAYS:
            raise ModelError("initial_stress.amplitude", self.amplitude, "must not be given")

    def at(self, x: Array) -> Array:
        """Return xx, yy, zz, xy (4, n) at positions (2, n) [MPa]."""
        return _field("initial_stress.stress", self.stress(x), (4, x.shape[1]), "MPa")


def _finite(field: str, value: object, unit: str) -> None:
    if not isinstance(value, int | float | np.number) or not np.isfinite(float(value)):
        raise ModelError(field, value, f"must be finite [{unit}]")


def _field(field: str, value: object, shape: tuple[int, ...], unit: str) -> Array:
    found = np.asarray(value, dtype=float)
    try:
        found = np.broadcast_to(found, shape)
    except ValueError:
        raise ModelError(field, found.shape, f"must give an array of the shape {shape}") from None
    if not np.isfinite(found).all():
        raise ModelError(field, "nan or inf", f"must be finite at all points [{unit}]")
    return found
