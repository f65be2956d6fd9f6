"""Fatigue criteria as parts: their constants, and how much of its limit a cycle takes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import MISSING, dataclass
from math import inf, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.fatigue.paths import Paths
from solver.fatigue.planes import OnPlanes, critical_planes
from solver.parameters import Checked, Stress, check, described
from solver.parts import Parts
from solver.tensors import principal, to_mandel
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


@dataclass(frozen=True, slots=True, kw_only=True)
class EnduredStrain(PlaneCriterion):
    """A criterion of strain, with the value that the material endures as its constant."""

    needs_strain = True
    yielding = True

    endured: Annotated[float, Interval(gt=0.0, le=1.0), Unit("1")] = described(
        2e-3, "value of the criterion that the material endures"
    )

    @property
    def limit(self) -> float:
        """The value that the material endures."""
        return self.endured


CRITERIA: Parts[Criterion] = Parts("criterion", alike=False)
"""The criteria by word."""
_NEXT = 1e-6
"""Weight of normal stress or strain in a search for the plane of the largest shear: of planes with
equal shear it takes the worst one."""


@CRITERIA.word("crossland")
@dataclass(frozen=True, slots=True, kw_only=True)
class Crossland(TwoLimits):
    """sqrt(J2a) + a p_max <= t, with a = 3 t / f - sqrt(3) of the limits t (torsion), f (bending).

    sqrt(J2a) is the radius of the smallest ball around the path of the deviator over sqrt(2), and
    p the hydrostatic stress.

    References
    ----------
    B. Crossland, Proc. Int. Conf. on Fatigue of Metals, London (1956), 138-149; the ball: I.V.
    Papadopoulos, Int. J. Fatigue 16 (1994) 377-384.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        return 3 * ratio - 3**0.5

    def found(self, paths: Paths) -> tuple[Array, Array]:
        """See `Criterion`."""
        _, radii = paths.deviator_balls
        value = radii / 2**0.5 + self.factor * paths.pressure.max(axis=1)
        return value, np.full((len(paths), 3), np.nan)


@CRITERIA.word("dang_van")
@dataclass(frozen=True, slots=True, kw_only=True)
class DangVan(TwoLimits):
    """max over t of tau(t) + a p(t) <= t, with a = 3 t / f - 3 / 2 of the limits t and f.

    tau is the largest shear stress of the deviator minus the centre of the smallest ball around its
    path: the stress in a grain that has shaken down. The plane is that of tau at the worst instant.

    References
    ----------
    K. Dang Van, B. Griveau, O. Message, EGF 3 (1989) 479-496.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        return 3 * ratio - 1.5

    def path(self, paths: Paths) -> tuple[Array, Array]:
        """Return hydrostatic stress and mesoscopic shear (n, n_instants): its diagram."""
        centres, _ = paths.deviator_balls
        return paths.pressure, paths.largest_shear(centres)

    def found(self, paths: Paths) -> tuple[Array, Array]:
        """See `Criterion`."""
        centres, _ = paths.deviator_balls
        p = paths.pressure
        at = np.arange(len(p)), (paths.largest_shear(centres) + self.factor * p).argmax(axis=1)
        values, directions = principal(to_mandel((paths.stress[at] - centres).T))
        plane = (directions[:, 0] + directions[:, 2]).T / 2**0.5
        return (values[0] - values[2]) / 2 + self.factor * p[at], plane


@CRITERIA.word("findley")
@dataclass(frozen=True, slots=True, kw_only=True)
class Findley(TwoLimits, PlaneCriterion):
    """max over planes of tau_a + k sigma_n,max <= t sqrt(1 + k^2).

    The limits t (torsion) and f (bending) give k from t / f = (k + sqrt(1 + k^2)) / (2 sqrt(1 +
    k^2)): both have the same value on their worst planes.

    References
    ----------
    W.N. Findley, J. Eng. Ind. 81 (1959) 301-306.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        sine = 2 * ratio - 1  # k / sqrt(1 + k^2)
        return sine / sqrt(1 - sine**2) if abs(sine) < 1 else inf

    @property
    def limit(self) -> float:
        """The value in reversed torsion at its limit [MPa]."""
        return self.torsion * sqrt(1 + self.factor**2)

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear + self.factor * on.normal


@CRITERIA.word("matake")
@dataclass(frozen=True, slots=True, kw_only=True)
class Matake(TwoLimits, PlaneCriterion):
    """tau_a + k sigma_n,max <= t, k = 2 t / f - 1, on the plane with the largest tau_a.

    References
    ----------
    T. Matake, Bull. JSME 20 (1977) 257-263.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        return 2 * ratio - 1

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear + self.factor * on.normal

    def searched(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear + _NEXT * on.normal


@CRITERIA.word("fatemi_socie")
@dataclass(frozen=True, slots=True, kw_only=True)
class FatemiSocie(EnduredStrain):
    """max over planes of gamma_a (1 + k sigma_n,max / sigma_y) <= limit, gamma = 2 eps_xy.

    Compression closes the crack: a negative normal stress counts, down to a factor of zero.

    References
    ----------
    A. Fatemi, D.F. Socie, Fatigue Fract. Eng. Mater. Struct. 11 (1988) 149-165.
    """

    sensitivity: Sensitivity = described(0.3, "factor k of normal stress over yield stress")
    yield_stress: Stress = described(400.0, "cyclic yield stress")

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        open_ = np.maximum(1 + self.sensitivity * on.normal / self.yield_stress, 0.0)
        return 2 * on.shear_strain * open_


@CRITERIA.word("smith_watson_topper")
@dataclass(frozen=True, slots=True, kw_only=True)
class SmithWatsonTopper(EnduredStrain):
    """max over planes of sigma_n,max eps_n,a <= limit; no damage where the plane stays closed.

    References
    ----------
    K.N. Smith, P. Watson, T.H. Topper, J. Mater. 5 (1970) 767-778; on planes: D.F. Socie, J. Eng.
    Mater. Technol. 109 (1987) 293-298.
    """

    endured: Stress = described(0.5, "value of the parameter that the material endures")

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return np.maximum(on.normal, 0.0) * on.strain_half


@CRITERIA.word("brown_miller")
@dataclass(frozen=True, slots=True, kw_only=True)
class BrownMiller(EnduredStrain):
    """gamma_a + S (range of eps_n) <= limit on the plane with the largest gamma_a = 2 eps_xy,a.

    References
    ----------
    F.A. Kandil, M.W. Brown, K.J. Miller, Metals Society 280 (1982) 203-210.
    """

    sensitivity: Sensitivity = described(0.3, "factor S of the range of normal strain")

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return 2 * on.shear_strain + self.sensitivity * 2 * on.strain_half

    def searched(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear_strain + _NEXT * on.strain_half
