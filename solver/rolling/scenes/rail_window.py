"""The prism of a scene: its zone, and the window around the load, in shares of the contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.materials.law import Law
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.rail_effort import PrismSize
from solver.rolling.scenes.rail_parameters import PrismParameters
from solver.tensors import SQRT2

_AHEAD, _BEHIND, _LENGTH = 2.2, 2.6, 7.0
"""The window ahead and behind, and the length after which waves repeat, over half the length where
the load is expected to act."""
_WIDE = 4 / 3
"""Least length after which waves repeat, over half the width of the zone: the far field takes the
loads beyond it by their resultants alone. The pressure of a Hertz ellipse with a ratio of semi-axes
of 25 then has an error of 0.1 %; with half the length it has 1.4 %, with a third 4 %."""
_LEAST = 4
"""Least number of elements in half a zone or reach."""
_UPPER = 0.35
"""Depth of the rows of elements that are divided, over the mean semi-axis of the contact."""
_XY = 3
_WEAK, _SHEARED, _PARTS = 0.05, 0.01, 20
"""Rise of the shear stress over its value at first yield below which hardening is weak, the
equivalent plastic strain at which it is taken, and the increments to there."""


def whole(length: float, size: float) -> float:
    """Return the length of the fewest elements that cover ``length``, at least 4 of them [mm]."""
    return size * max(_LEAST, math.ceil(round(length / size, 6)))


def split_rows(parameters: PrismParameters, mean: float, layer: float) -> int:
    """Return the number of uppermost rows of elements that are divided into two.

    Where hardening is weak the plastic zone ends steeply above, at a depth of about a fifth of the
    contact's mean semi-axis: rows as thick as the others are too coarse for residual stress there.

    Parameters
    ----------
    mean : root of the product of the semi-axes [mm]
    layer : thickness of a row [mm]
    """
    if parameters.accuracy == "draft" or not _weak(parameters.material()):
        return 0
    return math.ceil(round(_UPPER * mean / layer, 6))


def _weak(law: Law) -> bool:
    """Return whether a material hardens little in shear."""
    if law.elastic:
        return False
    first = SQRT2 * law.shear_yield_stress
    start = first / (2 * law.elasticity.shear_modulus)
    strain, state = np.zeros((6, 1)), law.initial(1, 6)
    for part in range(_PARTS + 1):
        strain[_XY] = start + part / _PARTS * math.sqrt(1.5) * _SHEARED
        response = law.respond(strain.copy(), state)
        state = response.state
    return float(response.stress[_XY, 0]) < (1 + _WEAK) * first


@dataclass(frozen=True, slots=True, kw_only=True)
class PrismWindow:
    """Where a prism may yield, across and along.

    Attributes
    ----------
    columns, elements : elements of the zone that may yield, along its surface and in all
    half_width : half the width of the zone, along its surface [mm]
    spacing : distance of stations [mm]
    reach : half the length where the load is expected to act [mm]; it may act as far as the window
        allows, since yielding makes a contact longer ahead
    """

    columns: int
    elements: int
    half_width: float
    spacing: float
    reach: float

    @property
    def length(self) -> float:
        """Length after which waves repeat, an even number of stations [mm]."""
        return 2 * self._waves * self.spacing

    @property
    def _waves(self) -> int:
        """Number of stations in half the length after which waves repeat."""
        return self._stations(max(_LENGTH, _WIDE * self.half_width / self.reach) / 2)

    @property
    def size(self) -> PrismSize:
        """Numbers that tell the work of a pass."""
        return PrismSize(
            columns=self.columns,
            elements=self.elements,
            window=self._stations(_AHEAD) + self._stations(_BEHIND) + 1,
            waves=self._waves + 1,
        )

    def track(
        self,
        section: Section,
        levels: int,
        *,
        length: float | None = None,
        span: float | None = None,
    ) -> PrismTrack:
        """Return the prism of a section whose first elements are those of the zone.

        Parameters
        ----------
        levels : levels of the far field
        length : after which waves repeat [mm]; by default long enough for a pass
        span : length of a prism clamped at both ends [mm]; None if it is endless
        """
        return PrismTrack(
            section,
            np.arange(len(section.weights)) < self.elements,
            "running",
            length=length or self.length,
            spacing=self.spacing,
            ahead=self._stations(_AHEAD) * self.spacing,
            behind=self._stations(_BEHIND) * self.spacing,
            reach=self._stations(_AHEAD) // 2 * self.spacing,
            levels=levels,
            span=span,
        )

    def _stations(self, ratio: float) -> int:
        """Return the number of stations that cover a ratio of the reach."""
        # a whole number is not rounded up, whatever the unit of length makes of its last digit
        return math.ceil(round(ratio * self.reach / self.spacing, 6))
