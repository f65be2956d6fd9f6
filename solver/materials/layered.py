"""Layered (overlay) material: perfectly plastic layers that share one strain.

Each layer has its own yield stress. Together they harden along straight lines. After reversal they
yield early, as metals do (the Bauschinger effect), along twice the curve of first loading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from solver.errors import ModelError
from solver.materials.curves import Voce
from solver.materials.elastic_plastic import Chaboche
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class LayeredState(PlasticState):
    """Internal variables of all layers together (weighted means) and of each layer.

    Attributes
    ----------
    layer_strain : (n_layers, n_components, n_points) plastic strain of the layers that yield
    layer_accumulated : (n_layers, n_points) their equivalent plastic strain
    """

    layer_strain: Array
    layer_accumulated: Array
    TENSORS: ClassVar[tuple[str, ...]] = ("plastic_strain", "layer_strain")


@dataclass(frozen=True, kw_only=True)
class Layered(Law):
    """Besseling's material of layers under one strain.

    Attributes
    ----------
    elasticity : Hooke's law of all layers
    weights : (n_layers,) shares of the layers that yield; the rest, up to 1, stays elastic
    yields : (n_layers,) their yield stresses [MPa], increasing

    Raises
    ------
    ModelError
        if weights or yield stresses are not as above

    References
    ----------
    J.F. Besseling, J. Appl. Mech. 25 (1958) 529-536. D.R.J. Owen, A. Prakash, O.C. Zienkiewicz,
    Comput. Struct. 4 (1974) 1251-1267.
    """

    elasticity: Elasticity
    weights: tuple[float, ...]
    yields: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.weights or len(self.weights) != len(self.yields):
            lengths = f"{len(self.weights)} and {len(self.yields)}"
            raise ModelError("layers", lengths, "must have as many weights as yield stresses")
        if not (min(self.weights) > 0 and sum(self.weights) <= 1 + 1e-12):
            raise ModelError("weights", self.weights, "must be positive, and at most 1 together")
        rises = self.yields[0] > 0 and (np.diff(self.yields) > 0).all()
        if not (rises and np.isfinite(self.yields).all()):
            raise ModelError("yields", self.yields, "must be finite, positive and increase [MPa]")

    @classmethod
    def of_curve(
        cls,
        elasticity: Elasticity,
        strain: Sequence[float],
        stress: Sequence[float],
        slope: float = 0.0,
    ) -> Layered:
        """Return the layers whose curve in tension consists of straight lines between these points.

        The first point is that of first yield: its strain is stress / E. In tension a layer that
        flows contracts more in the lateral direction than one that does not, so the shares of the
        layers are not the ratios of slopes. If the slope after a point is T, the layers that flow
        have the share ``(E - T) / (E - (1 - 2 nu) / 3 T)``. A layer that begins to flow at strain e
        and stress s has the yield stress ``(3 E e - (1 - 2 nu) s) / (2 (1 + nu))``.

        Parameters
        ----------
        strain, stress : (n,) total strain, and stress in tension [MPa]
        slope : slope of stress over total strain after the last point [MPa]

        Raises
        ------
        ModelError
            if the first point is not at first yield, or the slope does not fall from line to line
        """
        E, nu = elasticity.youngs_modulus, elasticity.poisson_ratio
        e, s = np.asarray(strain, dtype=float), np.asarray(stress, dtype=float)
        if e.ndim != 1 or e.shape != s.shape or not len(e):
            shapes = f"{e.shape} and {s.shape}"
            raise ModelError("curve", shapes, "needs as many strains as stresses")
        if not (s[0] > 0 and abs(E * e[0] - s[0]) <= 1e-6 * s[0]):
            allowed = f"must begin at the end of the elastic line: {s[0] / E:.6g} at {s[0]:g} MPa"
            raise ModelError("curve.strain", float(e[0]), allowed)
        grows = bool((np.diff(e) > 0).all())
        slopes = np.append(np.diff(s) / np.diff(e) if grows else np.diff(s), slope)
        falls = grows and (np.diff(slopes, prepend=E) < 0).all()
        if not (falls and slope >= 0):
            allowed = "must be a curve whose slope falls from line to line, and is not negative"
            raise ModelError("curve.stress", list(map(float, s)), allowed)
        flowing = (E - slopes) / (E - (1 - 2 * nu) / 3 * slopes)
        yields = (3 * E * e - (1 - 2 * nu) * s) / (2 * (1 + nu))
        return cls(
            elasticity=elasticity,
            weights=tuple(np.diff(flowing, prepend=0.0).tolist()),
            yields=tuple(yields.tolist()),
        )

    # -- layers --------------------------------------------------------------------------------

    @cached_property
    def layers(self) -> tuple[tuple[float, Law], ...]:
        """Weight and law of each layer that yields."""
        return tuple(
            (weight, Chaboche(elasticity=self.elasticity, curve=Voce(yield_stress=stress)))
            for weight, stress in zip(self.weights, self.yields, strict=True)
        )

    @property
    def elastic_weight(self) -> float:
        """Share of the layer that never yields."""
        rest = 1 - sum(self.weights)
        return rest if rest > 1e-12 else 0.0

    def states(self, state: PlasticState) -> list[PlasticState]:
        """Return the internal variables of each layer."""
        assert isinstance(state, LayeredState)
        both = zip(state.layer_strain, state.layer_accumulated, strict=True)
        return [PlasticState(*each) for each in both]

    def together(self, layers: Sequence[PlasticState]) -> LayeredState:
        """Return the internal variables of all layers together from those of each."""
        strain = np.stack([layer.plastic_strain for layer in layers])
        accumulated = np.stack([layer.accumulated for layer in layers])
        weights = np.array(self.weights)
        return LayeredState(
            plastic_strain=np.tensordot(weights, strain, axes=1),
            accumulated=np.tensordot(weights, accumulated, axes=1),
            layer_strain=strain,
            layer_accumulated=accumulated,
        )

    def _stresses(self, stress: Array, state: PlasticState) -> list[Array]:
        """Return the stress of each layer from the total stress, as they share one strain."""
        C = self.stiffness(len(stress))
        return [
            stress + C @ (state.plastic_strain - layer.plastic_strain)
            for layer in self.states(state)
        ]

    # -- the law, see `Law` --------------------------------------------------------------------

    @property
    def hardens(self) -> bool:
        """Whether stress grows without bound: one layer never yields."""
        return self.elastic_weight > 0

    @property
    def ultimate_shear_stress(self) -> float:
        """Shear stress equivalent to the weighted sum of the yield stresses [MPa]."""
        most = float(np.dot(self.weights, self.yields))
        return math.inf if self.hardens else self.surface.shear(most)

    def initial(self, n_points: int, n_components: int) -> LayeredState:
        """Return the state of layers that have never yielded."""
        virgin = PlasticState.virgin(n_points, n_components)
        return self.together([virgin] * len(self.weights))

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the yield stress of the weakest layer (n_points,) [MPa]."""
        return np.full(state.accumulated.shape, self.yields[0])

    def strength(self, state: PlasticState) -> Array:
        """Return the stress of a tension test at this plastic strain (n_points,) [MPa].

        All layers are assumed to contract alike, which is exact if the volume is constant.
        """
        stiff = 3 * self.elasticity.shear_modulus
        weights, yields = np.array(self.weights), np.array(self.yields)
        strain = np.append(yields, 2 * yields[-1]) / stiff
        plastic = np.maximum(strain[:, None] - yields / stiff, 0.0) @ weights
        stress = np.minimum(stiff * strain[:, None], yields) @ weights
        stress += self.elastic_weight * stiff * strain
        slope = (stress[-1] - stress[-2]) / (plastic[-1] - plastic[-2])
        beyond = np.maximum(state.accumulated - plastic[-1], 0.0)
        return np.interp(state.accumulated, plastic, stress) + slope * beyond

    def yield_value(self, stress: Array, state: PlasticState) -> Array:
        """Return the largest yield function of all layers (n_points,) [MPa]."""
        each = zip(self.layers, self._stresses(stress, state), self.states(state), strict=True)
        return np.max([law.yield_value(own, layer) for (_, law), own, layer in each], axis=0)

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work that the layers turn into heat (n_points,) [N mm/mm3]."""
        total = np.zeros(response.stress.shape[1])
        stresses = self._stresses(response.stress, response.state)
        layers = zip(
            self.weights, stresses, self.states(before), self.states(response.state), strict=True
        )
        for weight, stress, old, new in layers:
            total += weight * (stress * (new.plastic_strain - old.plastic_strain)).sum(axis=0)
        return total

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the largest error (n_points,) of the layers, means and total stress [MPa]."""
        C = self.stiffness(len(stress))
        worst = np.abs(stress - C @ (strain - after.plastic_strain)).max(axis=0)
        for state in (before, after):  # the means are those of the layers
            together = self.together(self.states(state))
            error = np.abs(state.plastic_strain - together.plastic_strain).max(axis=0)
            error = np.maximum(error, np.abs(state.accumulated - together.accumulated))
            worst = np.maximum(worst, 2 * self.elasticity.shear_modulus * error)
        states = zip(self.layers, self.states(before), self.states(after), strict=True)
        for (_, law), old, new in states:
            own = law.misfit(strain, C @ (strain - new.plastic_strain), old, new)
            worst = np.maximum(worst, own)
        return worst

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return the weighted stresses, tangents and states of the layers."""
        C = self.stiffness(len(strain))
        stress = self.elastic_weight * (C @ strain)
        tangent = np.repeat((self.elastic_weight * C)[:, :, None], strain.shape[1], axis=2)
        yielding = np.zeros(strain.shape[1], dtype=bool)
        states = []
        for (weight, law), layer in zip(self.layers, self.states(state), strict=True):
            own = law.respond(strain, layer)
            stress += weight * own.stress
            tangent += weight * own.tangent
            yielding |= own.yielding
            states.append(own.state)
        return Response(stress, tangent, self.together(states), yielding)
