"""Internal variables of a material law, and its response."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class PlasticState:
    """Internal variables at the points of a body; never changed, only replaced.

    A law with more internal variables inherits from this class and adds its arrays, points last.

    Attributes
    ----------
    plastic_strain : (n_components, n_points) Mandel
    accumulated : (n_points,) sum of the plastic multipliers: plastic strain grows by the
        multiplier times `Law.flow_direction`. With von Mises it is the equivalent plastic
        strain, the sum of sqrt(2/3) |d plastic_strain|
    """

    plastic_strain: NDArray[np.float64]
    accumulated: NDArray[np.float64]

    @classmethod
    def virgin(cls, n_points: int, n_components: int = 4) -> PlasticState:
        """Return the state of a material that has never yielded."""
        return PlasticState(np.zeros((n_components, n_points)), np.zeros(n_points))

    def at(self, points: NDArray[np.int64]) -> Self:
        """Return the internal variables of some points."""
        return replace(self, **{f.name: getattr(self, f.name)[..., points] for f in fields(self)})

    def where(self, points: NDArray[np.bool_], other: PlasticState) -> Self:
        """Return these internal variables at some points (n_points,), others at the rest."""
        names = [f.name for f in fields(self)]
        mixed = {n: np.where(points, getattr(self, n), getattr(other, n)) for n in names}
        return replace(self, **mixed)

    def stretched(self, factor: NDArray[np.float64]) -> Self:
        """Return the internal variables with all strains multiplied by factors (n_points,)."""
        return replace(self, **{f.name: getattr(self, f.name) * factor for f in fields(self)})


class Response(NamedTuple):
    """The response of a law to a strain.

    ``stress`` (n_components, n_points) Mandel [MPa]; ``tangent`` (n_components, n_components,
    n_points), the derivative of stress by strain [MPa]; ``state`` the new internal variables;
    ``yielding`` (n_points,) bool, where the tangent is not the elastic stiffness.
    """

    stress: NDArray[np.float64]
    tangent: NDArray[np.float64]
    state: PlasticState
    yielding: NDArray[np.bool_]
