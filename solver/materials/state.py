"""What a yielding material remembers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class PlasticState:
    """Internal variables at the points of a body; never changed, only replaced.

    Attributes
    ----------
    plastic_strain : (n_components, n_points) Mandel, traceless
    accumulated : (n_points,) equivalent plastic strain, the sum of sqrt(2/3) |d plastic_strain|
    """

    plastic_strain: NDArray[np.float64]
    accumulated: NDArray[np.float64]

    @classmethod
    def virgin(cls, n_points: int, n_components: int = 4) -> PlasticState:
        """Return the state of a material that has never yielded."""
        return cls(np.zeros((n_components, n_points)), np.zeros(n_points))


class Response(NamedTuple):
    """What a law returns.

    ``stress`` (n_components, n_points) Mandel [MPa]; ``tangent`` (n_components, n_components,
    n_points) [MPa]; ``state`` the new internal variables; ``yielding`` (n_points,) bool.
    """

    stress: NDArray[np.float64]
    tangent: NDArray[np.float64]
    state: PlasticState
    yielding: NDArray[np.bool_]
