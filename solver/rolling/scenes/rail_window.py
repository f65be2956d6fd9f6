"""The prism of a scene: its zone, and the window around the load, in multiples of the contact."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.rail_scene import PrismParameters
from solver.scenes.scene import Effort
from solver.tensors import SQRT2

_FIRST, _FACTOR = 0.5, 2.2e-5
"""Processor time of a set-up [s]: a constant, and the part per wave and unknown of the zone."""
_LEAST_BYTES, _BYTES = 1.4e8, 4400.0
"""Memory of a path [bytes]: a constant, and the part per wave and unknown of the zone."""
_STILL, _POINT = 0.01, 1.5e-6
"""Processor time of an elastic pass [s]: a constant, and the part per point and station of the
window."""
_YIELDS = 28.0
"""Work of all yielding under a wheel that rolls again and again, over that of an elastic pass. Half
of it is in the first pass, a quarter in the second, and so on."""


_AHEAD, _BEHIND, _LENGTH = 2.2, 2.6, 7.0
"""Length of the window ahead and behind, and the length after which waves repeat, over half the
length where the load is expected to act."""
_WIDE = 4 / 3
"""Least length after which waves repeat, over half the width of the zone: the far field includes
the loads beyond it by their resultants alone. The pressure of a Hertz ellipse with a ratio of
semi-axes of 25 then has an error of 0.1 %; with half the length it has 1.4 %, with a third 4 %.
Of loads at a distance from each other waves repeat after twice the length, with no far field:
plastic strain fades over it, see docs/measured.md."""
_LEAST = 4
"""Least number of elements in half a zone or reach."""
_UPPER = 0.35
"""Depth down to which rows of elements are divided, over the mean semi-axis of the contact."""
_XY = 3
_WEAK, _SHEARED, _PARTS = 0.05, 0.01, 20
"""Hardening is weak if the shear stress rises by less than this share of its value at first yield,
up to this equivalent plastic strain, in this number of increments."""


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
class PrismGeometry(ABC):
    """All values that decide the set-up of a prism; runs with equal geometry share it.

    Attributes
    ----------
    elasticity : elastic constants of the prism
    half_width, depth, size, split : of the zone that may yield, see `Zone` [mm]
    spacing : distance of stations [mm]
    reach : half the length where the load is expected to act [mm]; it may act as far as the window
        allows, since yielding makes a contact longer ahead
    apart : distance of equal loads, a multiple of ``spacing`` [mm]; None of a load that is alone
    """

    elasticity: Elasticity
    half_width: float
    depth: float
    size: float
    split: int
    spacing: float
    reach: float
    apart: float | None = None

    @property
    @abstractmethod
    def elements(self) -> int:
        """Number of elements of the zone."""

    @property
    def waves(self) -> int:
        """Number of stations in half the length after which waves repeat."""
        length = max(_LENGTH, _WIDE * self.half_width / self.reach)
        least = self.stations(length if self._between else length / 2)
        step = self._between // math.gcd(2, self._between) or 1
        return step * math.ceil(least / step)

    @property
    def _between(self) -> int:
        """Number of stations from load to load; 0 of a load that is alone."""
        return round((self.apart or 0.0) / self.spacing)

    @property
    def window(self) -> tuple[int, int]:
        """Number of stations of the window ahead of the load and behind, none nearer to others."""
        ahead, behind = self.stations(_AHEAD), self.stations(_BEHIND)
        if self._between:
            half = self._between // 2
            return min(ahead, half), min(behind, self._between - half)
        return ahead, behind

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
        levels : levels of the far field of a load that is alone
        length : after which waves repeat [mm]; by default long enough for a pass
        span : length of a prism clamped at both ends [mm]; None if it is endless
        """
        ahead, behind = self.window
        return PrismTrack(
            section,
            np.arange(len(section.weights)) < self.elements,
            "running",
            length=length or 2 * self.waves * self.spacing,
            spacing=self.spacing,
            ahead=ahead * self.spacing,
            behind=behind * self.spacing,
            reach=min(self.stations(_AHEAD) // 2, ahead) * self.spacing,
            levels=0 if self._between else levels,
            loads=2 * self.waves // self._between if self._between else 1,
            span=span,
        )

    def effort(
        self, section: Section, passes: Sequence[float], turns: int = 1, *, scattered: bool = False
    ) -> Effort:
        """Return the work of passes of ``turns`` loads in turn over the section, on one core.

        If the loads are scattered, ever heavier ones come along, ever more rarely.
        """
        count, window = int(max(passes)), sum(self.window) + 1
        zone = len(np.unique(section.dofs[: self.elements]))
        factorised = (self.waves + 1) * zone
        still = _STILL + _POINT * section.weights[: self.elements].size * window
        yields = _YIELDS * turns * (1 - 0.5 ** (count / turns))
        return Effort(
            elements=len(section.weights),
            unknowns=len(section.free),
            increments=count,
            most_increments=count,
            seconds=still * (count + yields * (1 + math.log(count) * scattered)),
            set_up=_FIRST + _FACTOR * factorised,
            memory=_LEAST_BYTES + _BYTES * factorised,
        )

    def stations(self, ratio: float) -> int:
        """Return the number of stations that cover a ratio of the reach."""
        # a whole number is not rounded up, whatever the unit of length makes of its last digit
        return math.ceil(round(ratio * self.reach / self.spacing, 6))
