"""Return mapping to a von Mises surface that grows along a curve and moves by back stresses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from solver.materials.back_stress import ArmstrongFrederick, BackStress
from solver.materials.curves import Curve
from solver.materials.elasticity import Elasticity
from solver.materials.radial_return import SQRT23
from solver.materials.scalar import falling_root
from solver.materials.state import PlasticState, Response
from solver.tensors import deviator, projections, von_mises
from solver.typing import Array, Ints

_ROUNDING = 8 * float(np.finfo(float).eps)
"""Ratio of residual to trial stress; up to it the residual is rounding."""
_SMALL = 1e-10
"""Ratio of residual to trial stress up to which a point counts as solved if further steps do not
reduce the residual."""
_MAX_ITERATIONS = 100
_BLOCK = 300
"""Number of points solved together, so that their arrays stay in the cache of the processor."""


@dataclass(frozen=True, slots=True)
class ChabocheState(PlasticState):
    """Internal variables, with the back stresses (n_back, n_components, n_points) [MPa].

    Each is 2/3 C times a strain, the plastic strain less the faded part, and `stretched` scales it
    like a strain.
    """

    back: Array
    TENSORS: ClassVar[tuple[str, ...]] = ("plastic_strain", "back")


class FlowStep(NamedTuple):
    """An increment of plastic flow at n points.

    ``growth`` (n,) dp; ``flow`` (n_components, n) increment of plastic strain; ``back`` (n_back,
    n_components, n) new back stresses [MPa]; ``softening`` (n_components, n_components, n) elastic
    stiffness minus tangent [MPa].
    """

    growth: Array
    flow: Array
    back: Array
    softening: Array


def back_stress_return(
    strain: Array,
    state: PlasticState,
    elasticity: Elasticity,
    curve: Curve,
    rules: Sequence[BackStress],
) -> Response:
    """Return stress, consistent tangent and new state for all strain components given.

    Fading back stresses make the tangent unsymmetric.

    Parameters
    ----------
    strain : (n_components, n_points) total Mandel strain
    state : internal variables of the last converged state, left unchanged
    """
    assert isinstance(state, ChabocheState)
    n_components, n_points = strain.shape
    G, C = elasticity.shear_modulus, elasticity.stiffness(n_components)
    stress = C @ (strain - state.plastic_strain)
    tangent = np.repeat(C[:, :, None], n_points, axis=2)
    relative = stress - state.back.sum(axis=0)
    yielding = von_mises(relative) - curve.flow_stress(state.accumulated) > 0
    at = np.flatnonzero(yielding)
    if not len(at):
        return Response(stress, tangent, state, yielding)

    known = all(type(rule) is ArmstrongFrederick for rule in rules)
    some, any_rules = state.at(at), cast("Any", rules)
    step = (fading_return if known else general_return)(
        deviator(stress[:, at]), some.back, some.accumulated, any_rules, curve, G
    )
    plastic_strain, accumulated = state.plastic_strain.copy(), state.accumulated.copy()
    plastic_strain[:, at] += step.flow
    accumulated[at] += step.growth
    stress[:, at] -= 2 * G * step.flow
    back = state.back.copy()
    back[:, :, at] = step.back
    tangent[:, :, at] -= step.softening
    after = ChabocheState(plastic_strain, accumulated, back)
    return Response(stress, tangent, after, yielding)


def fading_return(
    s: Array,
    back: Array,
    accumulated: Array,
    rules: Sequence[ArmstrongFrederick],
    curve: Curve,
    G: float,
) -> FlowStep:
    """Return the flow from a trial deviator (n_components, n) by one scalar equation per point.

    With the back stresses X at the beginning of the increment, flow has the direction of

        xi(dp) = s - sum of X exp(-gamma dp)

    and ``sqrt(3/2) |xi| = R(p + dp) + 3 G dp + sum of C / gamma (1 - exp(-gamma dp))`` gives dp.
    """
    constants = [(rule.modulus, rule.recall) for rule in rules]
    C, gamma = np.reshape(constants, (-1, 2)).T[:, :, None]

    def at(growth: Array) -> tuple[Array, Array, Array, Array]:
        faded = np.exp(-gamma * growth)
        xi = s - (back * faded[:, None]).sum(axis=0)
        turn = (back * (gamma * faded)[:, None]).sum(axis=0)
        q = von_mises(xi)
        slope = 3 * G + (C * faded).sum(axis=0) + curve.slope(accumulated + growth)
        return xi, turn, q, slope - 1.5 * (xi * turn).sum(axis=0) / q

    def excess(growth: Array) -> tuple[Array, Array]:
        _, _, q, slope = at(growth)
        raised = sum(rule.in_tension(growth) for rule in rules)
        return q - curve.flow_stress(accumulated + growth) - 3 * G * growth - raised, -slope

    nothing = np.zeros(s.shape[1])
    begun = excess(nothing)
    first = begun[0]
    # after heating a back stress may exceed C / gamma: as it fades, the excess grows
    for X, (modulus, recall) in zip(back, constants, strict=True):
        if recall:
            first = first + np.maximum(von_mises(X) - modulus / recall, 0.0)
    growth = falling_root(  # which begins at its lower end, known from above
        lambda x: begun if x is nothing else excess(x),
        nothing, first / (3 * G) * (1 + 1e-9), von_mises(s),
    )  # fmt: skip
    xi, turn, _, slope = at(growth)
    size = np.sqrt((xi**2).sum(axis=0))
    u = xi / size
    normal = u / SQRT23
    pairs = zip(rules, back, strict=True)
    moved = [rule.evolve(X, growth, normal) for rule, X in pairs]

    aside = turn - (u * turn).sum(axis=0) * u
    along = u[:, None] * u[None]
    mixed = aside[:, None] * u[None]
    shrunk = 2 * G * growth / (SQRT23 * size)
    softening = (
        2
        * G
        * (
            shrunk * (projections(len(s))[1][:, :, None] - along + mixed / (SQRT23 * slope))
            + 3 * G / slope * along
        )
    )
    return FlowStep(growth, growth * normal, np.reshape(moved, back.shape), softening)


def general_return(
    s: Array,
    back: Array,
    accumulated: Array,
    rules: Sequence[BackStress],
    curve: Curve,
    G: float,
) -> FlowStep:
    """Return the flow from a trial deviator (n_components, n) for any rules of back stresses.

    1. unknowns: relative stress xi and growth dp; N = 3/2 xi / q, with q its von Mises stress
    2. ``xi - s + 2 G dp N + sum of X(dp, N) = 0`` and ``q - R(p + dp) = 0``
    3. Newton's method from the flow without hardening; a step that does not reduce the residual, or
       makes dp negative, is halved
    4. the tangent follows from the derivative of xi and dp by s, from the same equations

    If no solution is found, dp is NaN and the increment does not converge.
    """
    n, count = s.shape
    if count > _BLOCK:
        blocks = (slice(first, first + _BLOCK) for first in range(0, count, _BLOCK))
        steps = (
            general_return(s[:, at], back[..., at], accumulated[at], rules, curve, G)
            for at in blocks
        )
        return FlowStep(*(np.concatenate(each, axis=-1) for each in zip(*steps, strict=True)))

    scale, xi = von_mises(s), s - back.sum(axis=0)
    q = von_mises(xi)
    growth = q - curve.flow_stress(accumulated)
    for rule, X in zip(rules, back, strict=True):
        growth += np.maximum(von_mises(X) - rule.limit, 0.0)  # X may exceed it after heating
    growth /= 3 * G
    found = np.concatenate([xi / q * curve.flow_stress(accumulated + growth), [growth]])
    least, share = np.full(count, np.inf), np.ones(count)
    step, going = np.zeros_like(found), np.arange(count)

    def at(points: Ints, x: Array) -> _Equations:
        own = s[:, points], back[:, :, points], accumulated[points]
        return _Equations(*own, x[:n], x[n], rules, curve, G)

    for _ in range(_MAX_ITERATIONS):
        trial = found[:, going] - share[going] * step[:, going]
        size = np.sqrt((at(going, trial).residual() ** 2).sum(axis=0))
        better = (size < least[going]) & (trial[n] >= 0)
        some = going[better]
        found[:, some], least[some] = trial[:, better], size[better]
        share[going] = np.where(better, 1.0, 0.5 * share[going])
        small = least[going] <= np.where(better, _ROUNDING, _SMALL) * scale[going]
        going = going[~small]
        if not len(going):
            break
        here = at(going, found[:, going])
        step[:, going] = _solved(here.slope(), here.residual()[:, None])[:, 0]
    found[n, least > _SMALL * scale] = np.nan

    end = at(np.arange(count), found)
    by_s = _solved(end.slope(), np.repeat(np.eye(n + 1, n)[:, :, None], count, axis=2))
    turned = np.einsum("ijp,jkp->ikp", end.turning, by_s[:n])
    turned = end.normal[:, None] * by_s[n] + end.growth * turned
    softening = 4 * G**2 * np.einsum("ijp,jk->ikp", turned, projections(n)[1])
    return FlowStep(end.growth, end.growth * end.normal, end.moved(), softening)


class _Equations:
    """The equations of `general_return` at points, for values of its unknowns."""

    def __init__(
        self, s: Array, back: Array, accumulated: Array, xi: Array, growth: Array,
        rules: Sequence[BackStress], curve: Curve, G: float,
    ) -> None:  # fmt: skip
        self._s, self._back, self._p, self._rules = s, back, accumulated + growth, rules
        self._xi, self._curve, self._G = xi, curve, G
        self.growth, self._q = growth, von_mises(xi)
        self.normal = 1.5 * xi / self._q

    def moved(self) -> Array:
        """Return the back stresses (n_back, n_components, n) [MPa]."""
        each = zip(self._rules, self._back, strict=True)
        return np.stack([rule.moved(X, self.growth, self.normal) for rule, X in each])

    def residual(self) -> Array:
        """Return the residual of the equations (n_components + 1, n) [MPa]."""
        flow = 2 * self._G * self.growth * self.normal
        aside = self._xi - self._s + flow + self.moved().sum(axis=0)
        return np.concatenate([aside, [self._q - self._curve.flow_stress(self._p)]])

    @property
    def turning(self) -> Array:
        """Derivative of N by xi (n_components, n_components, n) [1/MPa]."""
        N = self.normal
        return (1.5 * np.eye(len(N))[:, :, None] - N[:, None] * N[None]) / self._q

    def slope(self) -> Array:
        """Return the derivative of the residual (n_components + 1, n_components + 1, n)."""
        n, count = self._xi.shape
        one = np.eye(n)[:, :, None]
        by_growth = 2 * self._G * self.normal
        by_normal = 2 * self._G * self.growth * one
        for rule, X in zip(self._rules, self._back, strict=True):
            more, turn = rule.slopes(X, self.growth, self.normal)
            by_growth, by_normal = by_growth + more, by_normal + turn
        out = np.empty((n + 1, n + 1, count))
        out[:n, :n] = one + np.einsum("ijp,jkp->ikp", by_normal, self.turning)
        out[:n, n], out[n, :n] = by_growth, self.normal
        out[n, n] = -self._curve.slope(self._p)
        return out


def _solved(matrices: Array, right: Array) -> Array:
    """Return solutions (n, m, n_points) of systems (n, n, n_points) with m right-hand sides."""
    found = np.linalg.solve(np.moveaxis(matrices, -1, 0), np.moveaxis(right, -1, 0))
    return np.asarray(np.moveaxis(found, 0, -1), dtype=float)
