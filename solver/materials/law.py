"""The contract of a material law: all that bodies, contact and audit use.

A law gives stress, tangent and new internal variables for a strain (`Law.respond`). It never
changes the state it is given; the new state replaces it only when the increment has converged.
Arrays have their components first and their points last, and the number of components is that of
the arrays: 4 in two dimensions, 6 in three (`solver.tensors`).

A new law must define `elasticity`, `flow_stress` and `respond`. All else has a default for
associated flow on a von Mises surface and isotropic hardening that saturates. Override:

- `back_stress` and `strength` for kinematic hardening
- `hardens` if stress grows without bound, `ultimate_shear_stress` if there is no hardening
- `surface` for another yield condition
- `symmetric` if the tangent is not symmetric
- `linear_hardening` if the closed forms of linear hardening may replace `respond`

A law with more internal variables returns them from `initial`; its state names those that are
tensors (`PlasticState.TENSORS`), so that they can be mirrored for passes in the other direction.
A subclass may define what is marked as an attribute here as a property or a dataclass field.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.materials.radial_return import LinearHardening
from solver.materials.state import PlasticState, Response
from solver.materials.yield_surface import VonMises, YieldSurface
from solver.typing import Array, Ints

T = TypeVar("T")

_ROUNDING = 8 * float(np.finfo(float).eps)


class attribute(Generic[T]):  # noqa: N801
    """A property that a subclass may replace by a field of its dataclass.

    With a plain property, ``dataclass`` would take the property for the field's default value,
    and the field could not be set.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__

    def __get__(self, instance: Any, owner: type) -> T:
        """Return the value for an instance; the class itself has none."""
        if instance is None:
            raise AttributeError(f"{owner.__name__}.{self._compute.__name__}")
        return self._compute(instance)


class Law(ABC):
    """An elastic-plastic law for small strains, independent of the rate of loading."""

    __slots__ = ()

    # -- parts ---------------------------------------------------------------------------------

    @attribute
    def elasticity(self) -> Elasticity:
        """The elastic constants."""
        raise NotImplementedError(f"{type(self).__name__} must give its elasticity")

    @attribute
    def surface(self) -> YieldSurface:
        """The shape of the yield surface."""
        return VonMises()

    @abstractmethod
    def flow_stress(self, state: PlasticState) -> Array:
        """Return the size of the yield surface (n_points,), as a tensile stress [MPa].

        An elastic law returns inf.
        """

    def back_stress(self, state: PlasticState) -> Array:
        """Return the centre of the yield surface (n_components, n_points), Mandel [MPa]."""
        return np.zeros_like(state.plastic_strain)

    @attribute
    def linear_hardening(self) -> LinearHardening | None:
        """Linear hardening, if the law is von Mises' with linear hardening; None otherwise.

        Its responses then have closed forms, and its flow along rows is compiled.
        """
        return None

    # -- response ------------------------------------------------------------------------------

    def initial(self, n_points: int, n_components: int) -> PlasticState:
        """Return the internal variables before any load; override it for more of them."""
        return PlasticState.virgin(n_points, n_components)

    @abstractmethod
    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, consistent tangent and new internal variables.

        Parameters
        ----------
        strain : (n_components, n_points) total Mandel strain at the end of the increment
        state : internal variables at its beginning, left unchanged
        """

    def stiffness(self, n_components: int) -> Array:
        """Return the elastic stiffness (n_components, n_components) on Mandel strain [MPa]."""
        return self.elasticity.stiffness(n_components)

    @attribute
    def stiff(self) -> float | Array:
        """Young's modulus at the points over that of `elasticity`."""
        return 1.0

    def at(self, points: Ints) -> Law:
        """Return the law of some points: the law itself if it is the same at all points."""
        return self

    # -- strength ------------------------------------------------------------------------------

    @attribute
    def yield_stress(self) -> float:
        """Tensile stress at first yield [MPa]; inf if it never yields."""
        return float(self.flow_stress(self.initial(1, 4))[0])

    @attribute
    def shear_yield_stress(self) -> float:
        """Shear stress at first yield [MPa]."""
        return self.surface.shear(self.yield_stress)

    @attribute
    def elastic(self) -> bool:
        """Whether the material never yields."""
        return math.isinf(self.yield_stress)

    @attribute
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric; otherwise bodies use its symmetric part."""
        return True

    @attribute
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without bound, so that no limit load exists."""
        return False

    @attribute
    def ultimate_shear_stress(self) -> float:
        """Upper bound of the shear stress at any plastic strain [MPa]; inf if none is known."""
        return math.inf

    def strength(self, state: PlasticState) -> Array:
        """Return the stress (n_points,) of the tension curve at this plastic strain [MPa]."""
        return self.flow_stress(state)

    # -- conditions ----------------------------------------------------------------------------

    def yield_value(self, stress: Array, state: PlasticState) -> Array:
        """Return the yield function (n_points,) [MPa]: negative inside the yield surface."""
        relative = stress - self.back_stress(state)
        return self.surface.equivalent(relative) - self.flow_stress(state)

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work (n_points,) that an increment turns into heat [N mm/mm3]."""
        flow = response.state.plastic_strain - before.plastic_strain
        back = self.back_stress(response.state)
        return np.asarray(((response.stress - back) * flow).sum(axis=0))

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the error of an increment by this law (n_points,) [MPa].

        The conditions are evaluated, not solved: this checks `respond` without calling it. With dp
        the growth of the accumulated plastic strain, backward Euler requires:

        - stress = C : (strain - plastic strain)
        - the yield value is not above 0, and is 0 where dp > 0
        - plastic strain grew by dp times the flow direction at the end, dp >= 0

        The largest error counts; an error of strain is multiplied by 2 G. Stress is the difference
        of terms as large as C : strain. Their rounding turns the flow direction; at very large
        strain this exceeds any error of interest, so the error of flow is reduced by it.

        Parameters
        ----------
        strain, stress : (n_components, n_points) Mandel, at the end of the increment
        before, after : internal variables at its beginning and end
        """
        C, G = self.stiffness(len(stress)), self.elasticity.shear_modulus
        worst = np.abs(stress - C @ (strain - after.plastic_strain)).max(axis=0)
        beyond = self.yield_value(stress, after)
        dp = after.accumulated - before.accumulated
        worst = np.maximum(worst, np.where(dp > 0, np.abs(beyond), np.maximum(beyond, 0.0)))
        flow = after.plastic_strain - before.plastic_strain
        turned = _ROUNDING * 2 * G * np.abs(strain).max(axis=0) / self.flow_stress(after)
        relative = stress - self.back_stress(after)
        aside = self.surface.flow_rule_error(relative, flow, dp, 2 * G)
        aside = np.maximum(aside - dp * turned, 0.0)
        return np.asarray(np.maximum(worst, 2 * G * np.maximum(aside, -dp)))


class Wrapped(Law):
    """A law that takes from the wrapped law all members that a subclass does not define.

    A subclass defines at least `respond`.
    """

    __slots__ = ()

    law: Law

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the flow stress (n_points,) of the wrapped law [MPa]."""
        return self.law.flow_stress(state)

    @property
    def linear_hardening(self) -> LinearHardening | None:
        """None: the response of the law inside is not that of this law."""
        return None


def _forwarded(name: str, member: object) -> Any:
    if isinstance(member, attribute):
        return property(lambda self: getattr(self.law, name), doc=member.__doc__)

    def call(self: Wrapped, *args: Any, **options: Any) -> Any:
        method: Callable[..., Any] = getattr(self.law, name)
        return method(*args, **options)

    call.__name__, call.__doc__ = name, member.__doc__
    return call


for _name, _member in vars(Law).items():
    if not _name.startswith("_") and _name not in {*vars(Wrapped), "respond"}:
        setattr(Wrapped, _name, _forwarded(_name, _member))
