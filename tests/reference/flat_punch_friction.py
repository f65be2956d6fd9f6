"""Stick and slip under a rigid flat punch that a growing normal force presses on a half-plane.

Plane strain, Coulomb friction f, half-width a = 1. The contact is complete from the start and all
fields grow in proportion to the force, so the boundary c between stick (|x| < c) and slip
(c < |x| < a) stays where it is, and the surface in the stick zone has never moved sideways. The
half-plane slides inward under the punch; the shear traction q on it points outward.

The traction is unknown on panels that shrink towards c and a, as a series of Legendre polynomials
on each; the equations hold at Gauss points (collocation).

References
----------
D.A. Spence, Proc. Camb. Phil. Soc. 73 (1973) 249-268; J. Elasticity 5 (1975) 297-319.
K.L. Johnson, Contact Mechanics (1985), 2.25: the displacements of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log, pi, sqrt
from typing import Self

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipkm1, expit

Array = NDArray[np.float64]

THINNEST = log(1 / 2e-5)  # logarithm of c^2 / (a^2 - c^2) where 1 - c/a is 1e-5
RATIO = 0.15  # of neighbouring panels
NEAR = 1.5  # in half-lengths of a panel: nearer, the integrals are taken in closed form


def coupling(poisson_ratio: float) -> float:
    """Return beta = (1 - 2 nu) / (2 (1 - nu)): Dundurs' beta of a half-plane and a rigid body."""
    return (1 - 2 * poisson_ratio) / (2 * (1 - poisson_ratio))


def uncoupled_stick_width(friction: float, beta: float) -> float:
    """Return c/a where the shear traction does not act back on the pressure.

    It is exact in the limit of small beta at a given f/beta. The pressure is then that without
    friction, p = P / (pi sqrt(a^2 - x^2)), and a shear traction that is bounded at c exists where
    K(k') / K(k) = beta / f, with k = c/a, k' = sqrt(1 - k^2) and K the complete elliptic integral.
    """
    return sqrt(expit(_uncoupled(friction, beta)))


def _uncoupled(friction: float, beta: float) -> float:
    """Return the logarithm of k^2 / k'^2 that ``uncoupled_stick_width`` asks for."""
    return brentq(
        lambda m: log(ellipkm1(expit(m)) / ellipkm1(expit(-m)) * friction / beta), -700, 700
    )


def _second_kind(degree: int, t: Array) -> Array:
    """Return Legendre functions of the second kind Q_0 .. Q_degree (degree + 1, n), |t| != 1."""
    Q = np.empty((degree + 1, *t.shape))
    Q[0] = np.log(np.abs((1 + t) / (1 - t))) / 2
    Q[1] = t * Q[0] - 1
    for n in range(1, degree):
        Q[n + 1] = ((2 * n + 1) * t * Q[n] - n * Q[n - 1]) / (n + 1)
    return Q


@dataclass(frozen=True, slots=True, kw_only=True)
class Panels:
    """Panels of (0, 1), their Gauss points and the integrals of Legendre polynomials on them."""

    edges: Array
    order: int

    @classmethod
    def graded(cls, stick: float, order: int, levels: int) -> Self:
        """Return panels that shrink towards the points ``stick`` from both sides and 1.

        The smallest are ``levels`` times shrunk from the shorter of stick and slip zone.
        """
        half = (1 - stick) / 2
        smallest = min(stick, half) * RATIO**levels

        def distances(largest: float) -> Array:
            steps = 1 + ceil(log(smallest / largest) / log(RATIO) - 1e-9)
            return np.r_[0, np.geomspace(smallest, largest, steps)]

        left, right = stick - distances(stick)[::-1], stick + distances(half)
        corner = 1 - distances(half)[::-1]
        return cls(edges=np.r_[left, right[1:], corner[1:]], order=order)

    @property
    def points(self) -> Array:
        """Gauss points, ``order`` in each panel."""
        x = leggauss(self.order)[0]
        return (self._middle[:, None] + self._half[:, None] * x).ravel()

    @property
    def _middle(self) -> Array:
        return (self.edges[1:] + self.edges[:-1]) / 2

    @property
    def _half(self) -> Array:
        return np.diff(self.edges) / 2

    def values(self) -> Array:
        """Polynomials at the Gauss points (n, n), one block a panel."""
        block = legvander(leggauss(self.order)[0], self.order - 1)
        return np.kron(np.eye(len(self._half)), block)

    def cumulated(self) -> Array:
        """Integrals of the polynomials from 0 to the Gauss points (n, n)."""
        n, x = self.order, leggauss(self.order)[0]
        P = legvander(x, n)
        inside = np.empty((n, n))
        inside[:, 0] = 1 + x
        for k in range(1, n):
            inside[:, k] = (P[:, k + 1] - P[:, k - 1]) / (2 * k + 1)
        whole = np.zeros((n, n))
        whole[:, 0] = 2
        before = np.tril(np.ones((len(self._half),) * 2), -1)
        return np.kron(np.diag(self._half), inside) + np.kron(before * self._half, whole)

    def logarithmic(self, sign: int) -> Array:
        """Integrals over (-1, 1) of ln|x - s| times the polynomials (n, n).

        The polynomials are continued to (-1, 0) as even (``sign`` 1) or odd (-1) functions.
        """
        x = self.points[:, None]
        right, left = (self._logarithmic(y) for y in (x, -x))
        return right + sign * left

    def _logarithmic(self, x: Array) -> Array:
        n, half = self.order, self._half
        t = (x - self._middle) / half
        near = np.abs(t) < NEAR
        nodes, weights = leggauss(4 * n)
        result = np.empty((*t.shape, n))
        distant = np.log(np.abs(t[~near][:, None] - nodes))
        result[~near] = distant @ (weights[:, None] * legvander(nodes, n - 1))
        y = t[near]
        Q = _second_kind(n, y)
        # by parts, with the integral of P_k, (P_(k+1) - P_(k-1)) / (2 k + 1), zero at both ends
        exact = [2 * (Q[k + 1] - Q[k - 1]) / (2 * k + 1) for k in range(1, n)]
        flat = (1 + y) * np.log(np.abs(1 + y)) + (1 - y) * np.log(np.abs(1 - y)) - 2
        result[near] = np.stack([flat, *exact], axis=-1)
        result[..., 0] += 2 * np.log(half)
        return (result * half[:, None]).reshape(len(x), -1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tractions:
    """Tractions under the punch, by a unit force P on a unit half-width, at points in (0, 1).

    ``overshoot`` is by how much the shear traction at the end of the stick zone exceeds
    friction times pressure there. It is the singular part of the shear traction.
    """

    x: Array
    pressure: Array
    shear: Array
    overshoot: float


def tractions(
    stick: float, friction: float, beta: float, order: int = 6, levels: int = 8
) -> Tractions:
    """Return the tractions with a stick zone prescribed to end at ``stick``.

    Equations (2.25) of Johnson, integrated, times E / (2 (1 - nu^2)):
    beta int_0^x q - (1/pi) int p ln|x - s| = constant, under the whole punch;
    beta int_0^x p + (1/pi) int q ln|x - s| = 0, where it sticks;
    q = f p where it slips; int p = 1. Pressure is even, shear odd in x.
    """
    panels = Panels.graded(stick, order, levels)
    x = panels.points
    n, s = len(x), int(np.count_nonzero(x < stick))
    values, cumulated = panels.values(), panels.cumulated()
    even, odd = (panels.logarithmic(sign) / pi for sign in (1, -1))
    A = np.zeros((n + s + 1, n + s + 1))
    A[:n, :n] = -even
    A[:n, s:n] += friction * beta * cumulated[:, s:]
    A[:n, n:-1] = beta * cumulated[:, :s]
    A[:n, -1] = -1
    A[n:-1, :n] = beta * cumulated[:s]
    A[n:-1, s:n] += friction * odd[:s, s:]
    A[n:-1, n:-1] = odd[:s, :s]
    A[-1, :n:order] = 2 * np.diff(panels.edges)
    solution = np.linalg.solve(A, np.r_[np.zeros(n + s), 1.0])
    p, q = solution[:n], solution[n:-1]
    ends, starts = np.ones(order), (-1.0) ** np.arange(order)
    overshoot = ends @ q[-order:] - friction * starts @ p[s : s + order]
    pressure = values @ p
    shear = np.r_[values[:s, :s] @ q, friction * pressure[s:]]
    return Tractions(x=x, pressure=pressure, shear=shear, overshoot=float(overshoot))


def stick_width(friction: float, poisson_ratio: float) -> float:
    """Return c/a, half the width of the stick zone over half the width of the punch.

    Without friction it is 0. It tends to 1 as friction grows: the slip zone becomes exponentially
    thin, but never vanishes. Where it is thinner than 1e-5 a, the result is 1. For a Poisson ratio
    of 1/2 nothing slips at any friction.
    """
    beta = coupling(poisson_ratio)
    if friction == 0:
        return 0.0
    if beta == 0:
        return 1.0
    return coupled_stick_width(friction, beta)


def coupled_stick_width(friction: float, beta: float, *, order: int = 6, levels: int = 8) -> float:
    """Return c/a for a given beta, found on panels of given fineness.

    Of all prescribed c it is the one at which the shear traction has no singularity. The unknown
    is the logarithm of c^2 / (a^2 - c^2).
    """

    def overshoot(m: float) -> float:
        return tractions(sqrt(expit(m)), friction, beta, order, levels).overshoot

    high = low = min(_uncoupled(friction, beta), THINNEST)
    if overshoot(high) < 0:
        return 1.0
    while overshoot(low) > 0:  # the coupling narrows the stick zone
        high, low = low, low - 1
    return sqrt(expit(brentq(overshoot, low, high, xtol=1e-9)))
