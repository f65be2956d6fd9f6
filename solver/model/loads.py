"""Loads of a body, each with its own amplitude over time.

A kind of load is a subclass of `Load` that overrides some of its methods: a force on a boundary, a
force per volume, an eigenstrain, a stress present before loading, a prescribed displacement, a loss
of stiffness and strength, or the removal of elements. The solver knows only these methods, not the
kinds.

Values are those at load factor 1. The load factor follows the amplitude; without an amplitude it is
the time itself. A `Value` may vary in space. Loads that move return their force at a time.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
import scipy
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.model.amplitude import Amplitude
from solver.parameters import Coordinate, Length, check
from solver.parts import Parts
from solver.typing import Array

Field = Callable[[Array], Array]
Value = float | Field
"""A number, or a function of position: (positions (2, n) [mm]) -> (n,), such as a `Tabulated`."""
StressValue = Annotated[Value, Unit("MPa")]
PerKelvin = Annotated[float, Unit("1/K")]

_ROUNDED = 1e-9
"""Length that may be rounding, over the width of a pressure."""
_ALWAYS, _NOUGHT = Amplitude.constant(1.0), Amplitude.constant(0.0)
_VECTOR, _TENSOR = ("x", "y"), ("xx", "yy", "zz", "xy")


Kinematics = Literal["plane_strain", "plane_stress", "axisymmetric"]
"""Assumption on the third direction of a two-dimensional body."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Load:
    """Base class of loads; a kind of load overrides the methods of the quantities that it applies.

    Positions x are (2, n) [mm]. The other methods return None.

    Attributes
    ----------
    amplitude : load factor over time; by default the time itself
    varies : whether loads of this kind change with time, and have an amplitude
    outside : whether the boundaries of this kind must lie on the outside of the body
    follows : whether it acts at the displaced places of a body of large strain: `push` on the
        deformed boundary, or, without boundaries, `body_force`, then linear in the position.
        Otherwise, as in bodies of small strain, it acts on the body before loading
    """

    amplitude: Amplitude | None = None
    varies: ClassVar[bool] = True
    outside: ClassVar[bool] = True
    follows: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Raise `ModelError` for a value that is not allowed."""
        check(self, f"{self.name}.")

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

    def check(self, kinematics: Kinematics) -> None:
        """Raise `ModelError` for a value that is not allowed in a body of these kinematics."""

    def push(self, x: Array, along: Array) -> Array | None:
        """Return the forces (2, n) on pieces of its boundaries, per depth of the body [N/mm].

        Parameters
        ----------
        x : positions of the pieces
        along : (2, n) vectors along the pieces, with the body on their left [mm]: outward normal
            times length is ``(along[1], -along[0])``
        """
        return None

    def push_at(self, time: float, x: Array, along: Array) -> Array | None:
        """Return the forces of `push` at a time, with the load factor.

        A load that moves along its boundaries overrides this instead of `push`.
        """
        force = self.push(x, along)
        return None if force is None else self.factor(time) * force

    def check_at(self, time: float, edges: Array) -> None:
        """Raise `ModelError` if a load that moves cannot act on the edges (2, n, 2) at a time."""

    @property
    def moves(self) -> bool:
        """Whether it overrides `push_at`: the shape of its force changes with time."""
        return type(self).push_at is not Load.push_at

    def body_force(self, x: Array) -> Array | None:
        """Return the force per volume (2, n) at positions x [N/mm3]."""
        return None

    def eigenstrain(self, x: Array) -> Array | None:
        """Return the eigenstrain xx, yy, zz, xy (4, n) at positions x: strain without stress."""
        return None

    def initial_stress(self, x: Array) -> Array | None:
        """Return the stress present before loading, xx, yy, zz, xy (4, n), at positions x [MPa]."""
        return None

    def softening(self, x: Array) -> tuple[Array, Array] | None:
        """Return the shares of Young's modulus and yield stress lost, (n,) each, at positions x."""
        return None

    @property
    def components(self) -> dict[int, float]:
        """Prescribed displacements of its boundaries: component 0 (x), 1 (y), 2 (z) -> [mm]."""
        return {}

    @property
    def removes(self) -> str:
        """The region of the body that it removes; empty for other kinds."""
        return ""


LOADS: Parts[Load] = Parts("kind", alike=False)
"""Kinds of load by the words that name them in scene files."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoundaryLoad(Load):
    """A load on a named boundary."""

    boundary: str

    @property
    def boundaries(self) -> tuple[str, ...]:
        """The boundary that it acts on."""
        return (self.boundary,)


@LOADS.word("pressure")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pressure(BoundaryLoad):
    """A pressure on a boundary, positive when it pushes: ``value`` [MPa].

    With large strain it follows the boundary, and a value that varies is that at the deformed one.
    In plane stress it acts on the thickness before loading.
    """

    value: StressValue
    follows: ClassVar[bool] = True

    def push(self, x: Array, along: Array) -> Array:
        """Return the forces (2, n) on pieces of the boundary [N/mm]."""
        pressure = _values(f"pressure.{self.boundary}", self.value, x, "MPa")
        return pressure * np.stack([-along[1], along[0]])


@LOADS.word("traction")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Traction(BoundaryLoad):
    """A force per area on a boundary, in fixed directions: ``x`` and ``y`` [MPa]."""

    x: StressValue = 0.0
    y: StressValue = 0.0

    def push(self, x: Array, along: Array) -> Array:
        """Return the forces (2, n) on pieces of the boundary [N/mm]."""
        traction = _components(f"traction.{self.boundary}", self, _VECTOR, x, "MPa")
        return traction * np.linalg.norm(along, axis=0)


@LOADS.word("travelling_pressure")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TravellingPressure(BoundaryLoad):
    """A Hertz pressure with proportional shear that moves along a boundary facing upwards.

    Attributes
    ----------
    half_width, peak : a [mm] and p0 [MPa]
    position : position of its centre along x [mm]
    shear_ratio : ratio of the shear along +x to the pressure
    """

    half_width: Length
    peak: Annotated[float, Interval(ge=0.0), Unit("MPa")]
    position: Amplitude = _NOUGHT
    shear_ratio: Amplitude = _NOUGHT

    def now(self, time: float) -> tuple[float, float, float]:
        """Return the factor of the pressure, its centre [mm] and the shear ratio at a time."""
        return self.factor(time), self.position.at(time), self.shear_ratio.at(time)

    def at(self, time: float, x: Array) -> tuple[Array, float]:
        """Return the pressure at positions x [MPa] and the ratio of shear to it."""
        factor, centre, ratio = self.now(time)
        inside = 1 - ((x - centre) / self.half_width) ** 2
        return factor * self.peak * np.sqrt(np.maximum(inside, 0.0)), ratio

    def check_at(self, time: float, edges: Array) -> None:
        """Raise `ModelError` if it reaches beyond the edges, or is narrower than one of them."""
        factor, centre, _ = self.now(time)
        if not factor:
            return
        name, width = f"{self.name}.{self.boundary}", 2 * self.half_width
        low, high = centre - self.half_width, centre + self.half_width
        first, last = edges[0].min(axis=1), edges[0].max(axis=1)
        on = np.clip(last, low, high) - np.clip(first, low, high)
        if on.sum() < width * (1 - _ROUNDED):
            raise ModelError(
                f"{name}.position", float(f"{centre:.6g}"),
                f"must keep the pressure, from {low:.6g} to {high:.6g} mm at time {time:.6g}, on "
                f"the boundary, from {first.min():.6g} to {last.max():.6g} mm",
            )  # fmt: skip
        longest = float((last - first)[on > _ROUNDED * width].max())
        if width < longest * (1 - _ROUNDED):
            allowed = f"must be at least {longest / 2:.6g} mm, half of an edge under the pressure"
            raise ModelError(f"{name}.half_width", self.half_width, allowed)

    def push_at(self, time: float, x: Array, along: Array) -> Array:
        """Return the forces (2, n) on pieces of the boundary at a time [N/mm]."""
        pressure, ratio = self.at(time, x[0])
        return pressure * (np.stack([-along[1], along[0]]) - ratio * along)


@LOADS.word("body_force")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyForce(Load):
    """A force per volume in fixed directions: ``x`` and ``y`` [N/mm3]."""

    x: Annotated[Value, Unit("N/mm3")] = 0.0
    y: Annotated[Value, Unit("N/mm3")] = 0.0

    def body_force(self, x: Array) -> Array:
        """Return the force per volume (2, n) at positions x [N/mm3]."""
        return _components("body_force", self, _VECTOR, x, "N/mm3")


Density = Annotated[float, Interval(gt=0.0), Unit("t/mm3")]
Axis = Literal["y", "z"]


@LOADS.word("gravity")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gravity(Load):
    """The weight of a body.

    Attributes
    ----------
    density : mass per volume [t/mm3]; steel has 7.85e-9
    x, y : acceleration of a falling body [mm/s2]
    """

    density: Density
    x: Annotated[float, Unit("mm/s2")] = 0.0
    y: Annotated[float, Unit("mm/s2")] = -9806.65

    def check(self, kinematics: Kinematics) -> None:
        """Raise `ModelError` for weight across the axis."""
        if kinematics == "axisymmetric" and self.x:
            raise ModelError("gravity.x", self.x, "must be 0 in an axisymmetric body: x is radial")

    def body_force(self, x: Array) -> Array:
        """Return the force per volume (2, n) at positions x [N/mm3]."""
        force = self.density * np.array([[self.x], [self.y]])
        return np.broadcast_to(force, x.shape)


@LOADS.word("centrifugal")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Centrifugal(Load):
    """The centrifugal force of a body that rotates. The load factor multiplies the force.

    Attributes
    ----------
    density : mass per volume [t/mm3]; steel has 7.85e-9
    speed : angular speed at load factor 1 [rad/s]; load factor 0.5 corresponds to 0.707 of it
    axis : direction of the axis of rotation, ``y`` or ``z`` (normal to the plane); an axisymmetric
        body rotates about its own axis
    centre : a point of the axis [mm]
    """

    density: Density
    speed: Annotated[float, Interval(ge=0.0), Unit("rad/s")]
    axis: Axis = "y"
    centre: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    follows: ClassVar[bool] = True

    def check(self, kinematics: Kinematics) -> None:
        """Raise `ModelError` for another axis than its own."""
        if kinematics == "axisymmetric" and (self.axis != "y" or self.centre[0]):
            given = self.axis if self.axis != "y" else self.centre
            name = "axis" if self.axis != "y" else "centre"
            raise ModelError(
                f"centrifugal.{name}", given, "an axisymmetric body rotates about x = 0: axis y"
            )

    def body_force(self, x: Array) -> Array:
        """Return the force per volume (2, n) at positions x [N/mm3]."""
        arm = x - np.reshape(self.centre, (2, 1))
        across = np.array([[1.0], [self.axis == "z"]])
        return self.density * self.speed**2 * across * arm


@LOADS.word("displacement")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Displacement(BoundaryLoad):
    """A prescribed displacement of a boundary: ``x``, ``y``, and ``z`` of a body in space [mm].

    A component that is None remains free.
    """

    x: Coordinate | None = None
    y: Coordinate | None = None
    z: Coordinate | None = None
    outside: ClassVar[bool] = False

    @property
    def components(self) -> dict[int, float]:
        """The prescribed components: 0 (x), 1 (y) or 2 (z) -> displacement [mm]."""
        given = enumerate((self.x, self.y, self.z))
        return {axis: value for axis, value in given if value is not None}

    def check(self, kinematics: Kinematics) -> None:
        """Raise `ModelError` if no component is given."""
        if not self.components:
            raise ModelError(f"displacement.{self.boundary}", None, "must give x, y or both [mm]")


@LOADS.word("temperature")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Temperature(Load):
    """A temperature rise: thermal expansion, and optionally loss of stiffness and strength.

    Attributes
    ----------
    rise : rise of temperature [K]
    expansion : coefficient of linear thermal expansion [1/K]
    modulus_drop, yield_drop : relative loss of Young's modulus and of the yield stress per kelvin
        [1/K]. Every slope of the tension curve decreases with Young's modulus
    """

    rise: Annotated[Value, Unit("K")]
    expansion: PerKelvin
    modulus_drop: PerKelvin = 0.0
    yield_drop: PerKelvin = 0.0

    def at(self, x: Array) -> Array:
        """Return the rise of temperature (n,) at positions (2, n) [K]."""
        return _values("temperature.rise", self.rise, x, "K")

    def eigenstrain(self, x: Array) -> Array:
        """Return the thermal strain xx, yy, zz, xy (4, n) at positions (2, n)."""
        strain = np.zeros((4, x.shape[1]))
        strain[:3] = self.expansion * self.at(x)
        return strain

    def softening(self, x: Array) -> tuple[Array, Array] | None:
        """Return the shares of Young's modulus and yield stress lost, (n,) each; None without."""
        if not (self.modulus_drop or self.yield_drop):
            return None
        rise = self.at(x)
        return self.modulus_drop * rise, self.yield_drop * rise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Removal(Load):
    """The removal of the elements of a region of the body, for example by machining.

    The load factor is the removed share of their stiffness, and of their forces on other elements.
    At 1 a negligible stiffness remains (`solver.fem.loads`). The amplitude is required and must
    not decrease.

    Attributes
    ----------
    region : name of a set of elements in the ``subdomains`` of the mesh
    """

    region: str

    def check(self, kinematics: Kinematics) -> None:
        """Raise `ModelError` for a load factor that is no share, or decreases."""
        if self.amplitude is None:
            raise ModelError("removal.amplitude", None, "must be given: solve takes loads back")
        share = np.asarray(self.amplitude.value)
        for worst in (share.min(), share.max()):
            if not 0 <= worst <= 1:
                raise ModelError("removal.amplitude", float(worst), "must be a share, from 0 to 1")
        if (np.diff(share) < 0).any():
            raise ModelError("removal.amplitude", share.tolist(), "must not decrease")

    @property
    def removes(self) -> str:
        """The region that it removes."""
        return self.region


@LOADS.word("initial_stress")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InitialStress(Load):
    """Stress present before any load, for example from manufacture.

    It is brought to equilibrium before any load acts: a field that is not in balance deforms the
    body and changes. It has no amplitude.

    Attributes
    ----------
    xx, yy, zz, xy : components [MPa]
    stress : instead of these, a function (positions (2, n) [mm]) -> xx, yy, zz, xy (4, n) [MPa]
    """

    xx: StressValue = 0.0
    yy: StressValue = 0.0
    zz: StressValue = 0.0
    xy: StressValue = 0.0
    stress: Field | None = None
    amplitude: Amplitude | None = _ALWAYS
    varies: ClassVar[bool] = False

    @classmethod
    def on_grid(cls, x: Array, y: Array, stress: Array) -> InitialStress:
        """Return a stress given on a grid, for example measured, and interpolated linearly.

        Parameters
        ----------
        x, y : (n_x,), (n_y,) increasing positions [mm]; the grid must cover the body
        stress : (4, n_y, n_x) components xx, yy, zz, xy [MPa]
        """
        name, values = "initial_stress.stress", np.asarray(stress, dtype=float)
        if values.shape != (4, len(y), len(x)):
            raise ModelError(name, values.shape, f"must have the shape {(4, len(y), len(x))}")
        try:
            along = scipy.interpolate.RegularGridInterpolator((y, x), np.moveaxis(values, 0, -1))
        except ValueError as error:
            raise ModelError(
                name, "this grid", f"must have increasing positions: {error}"
            ) from None

        def between(at: Array) -> Array:
            try:
                return np.asarray(along(at[::-1].T).T)
            except ValueError:
                held = f"x {x[0]:g} to {x[-1]:g}, y {y[0]:g} to {y[-1]:g} mm"
                raise ModelError(name, held, "the grid must cover the whole body") from None

        return cls(stress=between)

    def check(self, kinematics: Kinematics) -> None:
        """Raise `ModelError` for components beside a function of position, or an amplitude."""
        each = {name: getattr(self, name) for name in _TENSOR}
        if self.stress is not None and any(each.values()):
            allowed = "must be left out if stress, a function of position, is given"
            raise ModelError("initial_stress", each, allowed)
        if self.amplitude is not _ALWAYS:
            raise ModelError("initial_stress.amplitude", self.amplitude, "must not be given")

    def initial_stress(self, x: Array) -> Array:
        """Return xx, yy, zz, xy (4, n) at positions (2, n) [MPa]."""
        if self.stress is not None:
            return checked("initial_stress.stress", self.stress(x), (4, x.shape[1]), "MPa")
        return _components("initial_stress", self, _TENSOR, x, "MPa")


def _components(field: str, load: Load, names: tuple[str, ...], x: Array, unit: str) -> Array:
    """Return the values (n_names, n) of fields of a load at positions x."""
    return np.stack([_values(f"{field}.{name}", getattr(load, name), x, unit) for name in names])


def _values(field: str, value: Value, x: Array, unit: str) -> Array:
    """Return a `Value` (n,) at positions x, or raise `ModelError`."""
    try:
        found = value(x) if callable(value) else value
    except ModelError as error:  # of a table
        raise ModelError(field, error.value, error.allowed) from None
    return checked(field, found, (x.shape[1],), unit)


def checked(field: str, value: object, shape: tuple[int, ...], unit: str) -> Array:
    """Return a value as a finite array of this shape, or raise `ModelError`."""
    found = np.asarray(value, dtype=float)
    try:
        found = np.broadcast_to(found, shape)
    except ValueError:
        raise ModelError(field, found.shape, f"must give an array of the shape {shape}") from None
    if not np.isfinite(found).all():
        raise ModelError(field, "nan or inf", f"must be finite at all points [{unit}]")
    return found
