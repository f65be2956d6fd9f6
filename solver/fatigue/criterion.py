"""A fatigue criterion as a part: its constants, and how much of its limit a cycle takes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import MISSING, dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.fatigue.paths import Paths
from solver.fatigue.planes import OnPlanes, critical_planes
from solver.parameters import Checked, Stress, check, described
from solver.parts import Parts
from solver.typing import Array

_MOST = 10.0
Sensitivity = Annotated[float, Interval(ge=0.0, le=_MOST), Unit("1")]
"""A factor of normal or hydrostatic stress in a criterion."""


class Assessment(NamedTuple):
    """What a criterion finds at n points.

    Attributes
    ----------
    value : the equivalent of the cycle (n,), in the unit of the limit
    utilisation : value over limit (n,); negative where the cycle is all in compression
    plane : normals (n, 3) of the critical planes; NaN of a criterion without planes
    """

    value: Array
    utilisation: Array
    plane: Array

    @property
    def safety_factor(self) -> Array:
        """Limit over value (n,), infinite where the cycle does no damage."""
        harms = self.utilisation > 0
        return np.where(harms, 1 / np.where(harms, self.utilisation, 1.0), np.inf)


class Criterion(Checked, ABC):
    """A fatigue criterion; its fields are constants.

    Attributes
    ----------
    needs_strain : whether it reads strain
    yielding : whether it holds for a cycle that strains plastically and closes
    """

    __slots__ = ()
    needs_strain = False
    yielding = False

    @property
    @abstractmethod
    def limit(self) -> float:
        """The value that the material endures."""

    @abstractmethod
    def found(self, paths: Paths) -> tuple[Array, Array]:
        """Return the equivalent (n,) of a cycle, and normals (n, 3) of critical planes."""

    def assess(self, paths: Paths) -> Assessment:
        """Return what the criterion finds at points.

        Raises
        ------
        ModelError
            if it needs strain and the paths have none
        """
        if self.needs_strain and paths.strain is None:
            raise ModelError("strain", None, f"is needed by {type(self).__name__}")
        value, plane = self.found(paths)
        return Assessment(value, value / self.limit, plane)


class PlaneCriterion(Criterion):
    """A criterion of the plane on which a function is largest."""

    __slots__ = ()

    @abstractmethod
    def on_plane(self, on: OnPlanes) -> Array:
        """Return the equivalent (...) of what acts on planes."""

    def searched(self, on: OnPlanes) -> Array:
        """Return what is largest (...) on the critical plane: the equivalent, unless overridden."""
        return self.on_plane(on)

    def found(self, paths: Paths) -> tuple[Array, Array]:
        """See `Criterion`."""
        normal, on = critical_planes(paths, self.searched, self.on_plane)
        return self.on_plane(on), normal


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoLimits(Criterion):
    """A criterion whose constants follow from the limits in reversed torsion and bending."""

    torsion: Stress = described(MISSING, "fatigue limit in fully reversed torsion, amplitude")
    bending: Stress | None = described(
        None, "fatigue limit in fully reversed bending or tension, amplitude; or give sensitivity"
    )
    sensitivity: Sensitivity | None = described(
        None, "factor of normal or hydrostatic stress, instead of the limit in bending"
    )

    def __post_init__(self) -> None:
        check(self)
        if (self.bending is None) == (self.sensitivity is None):
            raise ModelError("bending", self.bending, "is needed, or sensitivity; not both")
        if self.bending is not None and not 0.0 <= self.factor <= _MOST:
            allowed = f"gives a factor of {self.factor:.3g} with torsion {self.torsion:g}: "
            raise ModelError("bending", self.bending, f"{allowed}it must be 0 to {_MOST:g}")

    @staticmethod
    @abstractmethod
    def of_limits(ratio: float) -> float:
        """Return the factor of normal or hydrostatic stress from torsion over bending limit."""

    @property
    def factor(self) -> float:
        """The factor of normal or hydrostatic stress."""
        if self.bending is not None:
            return self.of_limits(self.torsion / self.bending)
        assert self.sensitivity is not None
        return self.sensitivity

    @property
    def limit(self) -> float:
        """The limit in torsion [MPa]."""
        return self.torsion


CRITERIA: Parts[Criterion] = Parts("criterion", alike=False)
"""The criteria by word."""
