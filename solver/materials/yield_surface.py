"""Shapes of yield surfaces: the stress at which a material yields, and the direction of flow."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np

from solver.materials.curves import Curve
from solver.materials.scalar import falling_root
from solver.tensors import PAIRS, deviator, dyad, principal, von_mises
from solver.typing import Array

Tension = TypeVar("Tension", float, Array)
_NOTHING = 1e-300
_FACE = np.array([1.0, 0.0, -1.0])
_EDGES = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
"""Flow on the second face at the edges s2 = s3 and s1 = s2; `_FACE` is that on face s1 - s3."""


class Returned(NamedTuple):
    """The plastic increment in principal values.

    ``flow`` (3, n) plastic strains; ``growth`` (n,) multiplier; ``derivative`` (3, 3, n) of stress
    by trial stress.
    """

    flow: Array
    growth: Array
    derivative: Array


class YieldSurface(ABC):
    """The shape of a yield surface centred at zero; its size comes from the law.

    Attributes
    ----------
    has_corners : whether stress may stay at a corner or on an edge. The tangent is small or zero
        there, though the body may carry more load: increments then blend it with elastic stiffness
    """

    __slots__ = ()
    has_corners: ClassVar[bool] = False

    @abstractmethod
    def shear(self, tension: Tension) -> Tension:
        """Return the pure shear stress that is equivalent to a tensile stress [MPa]."""

    @abstractmethod
    def equivalent(self, stress: Array) -> Array:
        """Return the equivalent tensile stress (n_points,) of a stress [MPa]."""

    @abstractmethod
    def normal(self, stress: Array) -> Array:
        """Return the derivative (n_components, n_points) of `equivalent` by Mandel stress."""

    @abstractmethod
    def power(self, strain: Array) -> Array:
        """Return the largest work (n_points,) of a stress inside on the deviator of Mandel strain.

        The surface has the tensile stress 1.
        """

    def flow_rule_error(self, stress: Array, flow: Array, growth: Array, unit: float) -> Array:
        """Return the deviation (n_points,) of a flow from the associated flow rule, a strain.

        Override it for a surface with edges, where more than one direction is permitted.

        Parameters
        ----------
        stress : (n_components, n_points) Mandel stress relative to the back stress [MPa]
        flow : (n_components, n_points) increment of plastic strain, Mandel
        growth : (n_points,) plastic multiplier
        unit : difference of stress that counts as much as a strain of 1 [MPa]
        """
        return np.asarray(np.abs(flow - growth * self.normal(stress)).max(axis=0))


class IsotropicSurface(YieldSurface):
    """A yield surface given by principal stresses (3, n), the largest first [MPa]."""

    __slots__ = ()

    @property
    @abstractmethod
    def over_mises(self) -> float:
        """Upper bound of the ratio of its equivalent stress to that of von Mises."""

    @abstractmethod
    def of_principal(self, values: Array) -> Array:
        """Return the equivalent stress (n,) of principal stresses [MPa]."""

    def equivalent(self, stress: Array) -> Array:
        """Return the equivalent tensile stress (n_points,) of Mandel stress [MPa]."""
        return self.of_principal(principal(stress)[0])

    @abstractmethod
    def returned(self, trial: Array, before: Array, G: float, curve: Curve) -> Returned:
        """Return the plastic increment for principal trial stresses beyond the surface.

        Parameters
        ----------
        trial : (3, n) principal trial stresses [MPa]
        before : (n,) p, the accumulated plastic strain
        """


@dataclass(frozen=True, slots=True)
class VonMises(YieldSurface):
    """The von Mises surface: yield depends only on the size of the deviator."""

    def shear(self, tension: Tension) -> Tension:
        """Return k = tension / sqrt(3) [MPa]."""
        return tension / math.sqrt(3)

    def equivalent(self, stress: Array) -> Array:
        """Return q = sqrt(3/2 s:s) (n_points,) of Mandel stress (n_components, n_points) [MPa]."""
        return von_mises(stress)

    def normal(self, stress: Array) -> Array:
        """Return 3/2 s / q (n_components, n_points); zero where there is no deviator."""
        s = deviator(stress)
        return np.asarray(1.5 * s / np.maximum(np.sqrt(1.5 * (s**2).sum(axis=0)), _NOTHING))

    def power(self, strain: Array) -> Array:
        """Return sqrt(2/3 e:e) (n_points,) of the deviator e of Mandel strain."""
        return np.asarray(np.sqrt(2 / 3 * (deviator(strain) ** 2).sum(axis=0)))


@dataclass(frozen=True, slots=True)
class Tresca(IsotropicSurface):
    """The Tresca surface: yield depends only on the largest shear stress.

    In principal stresses it is a hexagonal prism. On its edges, where two principal stresses are
    equal, any flow between the normals of the two faces is associated.
    """

    has_corners: ClassVar[bool] = True

    @property
    def over_mises(self) -> float:
        """The ratio at pure shear."""
        return 2 / math.sqrt(3)

    def shear(self, tension: Tension) -> Tension:
        """Return k = tension / 2 [MPa]."""
        return tension / 2

    def of_principal(self, values: Array) -> Array:
        """Return s1 - s3 (n,) [MPa]."""
        return np.asarray(values[0] - values[2])

    def normal(self, stress: Array) -> Array:
        """Return e1 e1 - e3 e3 (n_components, n_points); on an edge, the normal of one face."""
        _, directions = principal(stress)
        return dyad(directions, 0, 0, len(stress)) - dyad(directions, 2, 2, len(stress))

    def power(self, strain: Array) -> Array:
        """Return the largest absolute principal value (n_points,) of the deviator of strain."""
        values, _ = principal(deviator(strain))
        return np.asarray(np.abs(values).max(axis=0))

    def returned(self, trial: Array, before: Array, G: float, curve: Curve) -> Returned:
        """Return to the face or, where the result is not on it, to the edge.

        1. return to the face, flow (1, 0, -1): 4 G dp + R(p + dp) = s1 - s3
        2. if that changes the order of the stresses, return to the edge: flow on two faces with
           multipliers a and b, dp = a + b. With the differences f1 and f2 of trial stresses on
           them: 3 G dp + R(p + dp) = (f1 + f2) / 2 and a - b = (f1 - f2) / (2 G)

        References
        ----------
        E.A. de Souza Neto, D. Peric, D.R.J. Owen, Computational Methods for Plasticity (2008),
        section 8.1.
        """
        growth, slope = grown(4 * G, trial[0] - trial[2], before, curve)
        face = growth * _FACE[:, None]
        inside = (np.diff(trial - 2 * G * face, axis=0) <= 0).all(axis=0)
        out = np.outer(_FACE, _FACE)[:, :, None] * (2 * G / (4 * G + slope))

        derivative = np.eye(3)[:, :, None] - out
        at = np.flatnonzero(~inside)
        if len(at):
            edge = _on_edge(trial[:, at], before[at], G, curve)
            face[:, at], growth[at], derivative[:, :, at] = edge
        return Returned(face, growth, derivative)

    def flow_rule_error(self, stress: Array, flow: Array, growth: Array, unit: float) -> Array:
        """Return the deviation (n_points,) of a flow from the associated flow rule, a strain.

        For associated flow:

        - its off-diagonal components in the principal directions of stress are zero, except
          between two equal principal stresses
        - its volume is zero, and its largest absolute principal value is the multiplier
        - its middle principal value is zero, except on the edge that it points to
        - stress does the work of the flow stress on it
        """
        values, directions = principal(stress)
        high, middle, low = principal(flow)[0]
        worst = np.abs(flow[:3].sum(axis=0))
        worst = np.maximum(worst, np.abs(np.maximum(high, -low) - growth))
        edge = np.where(middle > 0, values[0] - values[1], values[1] - values[2])
        worst = np.maximum(worst, np.minimum(np.abs(middle), edge / unit))
        for i, j in PAIRS:
            mixed = np.abs((flow * dyad(directions, i, j, len(stress))).sum(axis=0))
            worst = np.maximum(worst, np.minimum(mixed, (values[i] - values[j]) / unit))
        size = np.maximum(values[0] - values[2], _NOTHING)
        lacking = growth - (stress * flow).sum(axis=0) / size
        return np.asarray(np.maximum(worst, lacking))


def _on_edge(trial: Array, before: Array, G: float, curve: Curve) -> Returned:
    """Return to the nearer edge."""
    other = np.where(trial[0] + trial[2] > 2 * trial[1], _EDGES[0][:, None], _EDGES[1][:, None])
    first, second = trial[0] - trial[2], (other * trial).sum(axis=0)
    both, slope = grown(3 * G, 0.5 * (first + second), before, curve)
    mean, half = 0.5 * (_FACE[:, None] + other), 0.5 * (_FACE[:, None] - other)
    edge = both * mean + (first - second) / (2 * G) * half
    stiff = 2 * G / (3 * G + slope)
    out = stiff * mean[:, None] * mean[None] + 2 * half[:, None] * half[None]
    return Returned(edge, both, np.eye(3)[:, :, None] - out)


def grown(stiff: float | Array, trial: Array, before: Array, curve: Curve) -> tuple[Array, Array]:
    """Return dp (n,) that solves ``stiff dp + R(p + dp) = trial``, and the slopes of R (n,) [MPa].

    Parameters
    ----------
    stiff : fall of the elastic stress per unit of the multiplier [MPa]
    trial : (n,) stress without plastic flow, not below R(p) [MPa]
    before : (n,) p, the accumulated plastic strain
    """

    def excess(growth: Array) -> tuple[Array, Array]:
        p = before + growth
        return trial - stiff * growth - curve.flow_stress(p), -stiff - curve.slope(p)

    most = np.maximum(trial - curve.flow_stress(before), 0.0) / stiff
    growth = falling_root(excess, np.zeros_like(most), most * (1 + 1e-9), np.abs(trial))
    return growth, curve.slope(before + growth)
