"""Stress in the section of a prism before the first pass, by the word that names it in studies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Checked, Pairs, check, described
from solver.parts import Parts
from solver.typing import Array

_XX = 0


class SectionStress(Checked, ABC):
    """A stress that is constant along x."""

    __slots__ = ()

    @abstractmethod
    def stress(self, points: Array, area: Array) -> Array:
        """Return xx, yy, zz, xy, yz, zx (6, n) at points of a section [MPa].

        Parameters
        ----------
        points : (2, n) positions z, y; the top is at y = 0 [mm]
        area : (n,) area of the section that each point represents [mm2]
        """


INITIAL_STRESS: Parts[SectionStress] = Parts("initial_stress")
"""The stresses by word."""


@INITIAL_STRESS.word("none")
@dataclass(frozen=True, slots=True, kw_only=True)
class NoStress(SectionStress):
    """There is no stress before the first pass."""

    def stress(self, points: Array, area: Array) -> Array:
        """Return zero."""
        return np.zeros((6, points.shape[1]))


@INITIAL_STRESS.word("roller_straightened")
@dataclass(frozen=True, slots=True, kw_only=True)
class RollerStraightened(SectionStress):
    """Stress along x that roller straightening leaves: tension in head and foot, not in the web.

    It is a parabola over the height, without force and moments.
    """

    straightening_stress: Annotated[float, Interval(ge=-1e4, le=1e4), Unit("MPa")] = described(
        180.0, "stress xx at the top of the rail, with roller_straightened"
    )

    def stress(self, points: Array, area: Array) -> Array:
        """Return the parabola."""
        z, y = points
        plain = np.stack([np.ones_like(z), y, z])
        by_area = plain * area
        shares = np.linalg.solve(by_area @ plain.T, by_area @ y**2)
        stress = np.zeros((6, len(z)))
        # at the top, y = z = 0, it is -shares[0]
        stress[_XX] = self.straightening_stress * (shares @ plain - y**2) / shares[0]
        return stress


@INITIAL_STRESS.word("over_height")
@dataclass(frozen=True, slots=True, kw_only=True)
class OverHeight(SectionStress):
    """Stress along x given over the height, linear in between, constant above and below."""

    stress_over_height: Pairs = described(
        (), "points [y in mm, stress xx in MPa], y rising from the foot to 0 at the top, with "
        "over_height",
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Raise `ModelError` unless there are points whose y rises."""
        check(self)
        y, _ = self._points
        if not len(y) or (np.diff(y) <= 0).any():
            allowed = "must be given with over_height: points [y in mm, stress in MPa], y rising"
            raise ModelError("stress_over_height", self.stress_over_height, allowed)

    @property
    def _points(self) -> Array:
        return np.reshape(np.array(self.stress_over_height, dtype=float), (-1, 2)).T

    def stress(self, points: Array, area: Array) -> Array:
        """Return the stress of the table."""
        stress = np.zeros((6, points.shape[1]))
        stress[_XX] = np.interp(points[1], *self._points)
        return stress
