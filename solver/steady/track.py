"""The half-plane over which a steady load passes: meshed and factorised once for many passes."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.surface import extract, travelling_forces
from solver.materials.material import Material
from solver.mesh import graded, grid, with_middle
from solver.model.amplitude import Amplitude
from solver.model.body import Body
from solver.model.motion import TravellingPressure
from solver.steady.load import Given
from solver.steady.rows import Rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.operators import Operator
    from solver.fem.surface import Surface
    from solver.materials.elasticity import Elasticity

    Array = NDArray[np.float64]

_AHEAD, _BEHIND, _DEEP = 3.0, 5.0, 4.0
"""Reach of the window from the load / half-width. A window that ends 3 half-widths behind a load
that pushes errs by 5 MPa in 500 near the surface, as rows at yield still flow there; elements that
grow behind the load make them flow too much, and err by 30."""
_CONTACT = 2.0
"""Half the length of the surface that may come into contact / half-width."""
_FAR = 1600.0
"""Distance of the sides and the bottom / half-width. Half of it moves stress by 1 MPa in 500."""
_FAR_GROWTH = 2.0
"""Ratio of neighbouring element sides outside the window: 0.1 MPa in 500, a sixth of the time."""
_MOST_COLUMNS = 3000


class Track:
    """An elastic half-plane y < 0 with rows of points around a load at x = 0.

    It knows neither the load nor how it yields: passes of any load with the same half-width share
    it, whatever the friction and the hardening.

    Parameters
    ----------
    half_width : a of the contact [mm]
    element_size : side of the elements in the window [mm]
    growth : ratio of neighbouring sides in depth
    elasticity : of the half-plane
    interleaved : make two rows of each, of every other column: their points are one element
        apart, as increments of one element would have it

    Raises
    ------
    ModelError
        if the elements are larger than half the half-width, or too many
    """

    def __init__(
        self,
        half_width: float,
        element_size: float,
        growth: float,
        elasticity: Elasticity,
        *,
        interleaved: bool = False,
    ) -> None:
        a, h = half_width, element_size
        if not 0 < h <= a / 2:
            raise ModelError("element_size", h, f"must be in (0, {a / 2:.3g}], half the half-width")
        columns = math.ceil(_AHEAD * a / h) + math.ceil(_BEHIND * a / h)
        if columns > _MOST_COLUMNS:
            allowed = f"makes {columns} elements along the track; at most {_MOST_COLUMNS}"
            raise ModelError("element_size", h, allowed)
        self.half_width = a
        window = h * np.arange(-math.ceil(_BEHIND * a / h), math.ceil(_AHEAD * a / h) + 1)
        beyond = graded(_FAR * a, h, _FAR_GROWTH, _FAR * a / 2)[1:]
        x = np.concatenate([window[0] - beyond[::-1], window, window[-1] + beyond])
        near = graded(_DEEP * a, h, growth, _DEEP * a)
        below = graded(_FAR * a, near[-1] - near[-2], _FAR_GROWTH, _FAR * a / 2)[1:]
        y = -np.concatenate([near, near[-1] + below])[::-1]
        body = Body(
            name="half_space",
            mesh=with_middle(grid(x, y), "contact", _CONTACT * a),
            material=Material(
                youngs_modulus=elasticity.youngs_modulus, poisson_ratio=elasticity.poisson_ratio
            ),
            supports={"left": "x", "right": "x", "bottom": "xy"},
        )
        self.part = Discretisation(body)
        self.rows = Rows(
            self.part,
            self.operator,
            ahead=window[-1],
            behind=-window[0],
            deep=near[-1],
            interleaved=interleaved,
        )

    @cached_property
    def operator(self) -> Operator:
        """The inverse of the elastic stiffness."""
        return self.part.operators([self.surface], "auto").elastic

    @cached_property
    def surface(self) -> Surface:
        """The part of the top that may come into contact, as a chain of edges downstream."""
        return extract(self.part, "contact")

    def hertz(self, peak: float, shear_ratio: float = 0.0) -> Given:
        """Return a Hertz pressure with proportional shear.

        Parameters
        ----------
        peak : p0 [MPa]
        shear_ratio : shear along +x, the way of the load, / pressure; positive when braking
        """

        def always(value: float) -> Amplitude:
            return Amplitude(np.array([0.0, 1.0]), np.array([value, value]))

        pressure = TravellingPressure(
            boundary="top",
            half_width=self.half_width,
            peak=peak,
            amplitude=always(1.0),
            position=always(0.0),
            shear_ratio=always(shear_ratio),
        )
        return Given(travelling_forces(self.part, pressure, 0.0))


@lru_cache(maxsize=4)
def track_of(
    half_width: float, element_size: float, growth: float, elasticity: Elasticity
) -> Track:
    """Return the track of these measures, made once in a process: see `Track`."""
    return Track(half_width, element_size, growth, elasticity)
