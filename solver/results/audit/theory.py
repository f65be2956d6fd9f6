"""Where small-strain theory ends: the largest plastic strain away from singular points."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.model.singular import SingularPoint

    Array = NDArray[np.float64]

LARGE_STRAIN = 0.10
"""Largest equivalent plastic strain for small-strain theory. At it engineering and logarithmic
strain, which agree for small strain, differ by 5 %."""


class Strained(NamedTuple):
    """The largest equivalent plastic strain, its body and its place [mm]."""

    value: float = 0.0
    body: str = ""
    x: float = np.nan
    y: float = np.nan

    @property
    def outside(self) -> tuple[str, ...]:
        """A message if the strain is outside small-strain theory."""
        if self.value <= LARGE_STRAIN:
            return ()
        return (
            f"equivalent plastic strain reaches {self.value:.0%} in {self.body} at "
            f"({self.x:z.4g}, {self.y:z.4g}): small-strain theory does not hold there, reduce the "
            "load",
        )


def largest_strain(
    bodies: Iterable[tuple[str, Array, Array]], singular: Sequence[SingularPoint] = ()
) -> Strained:
    """Return the largest strain outside the radii of singular points.

    Parameters
    ----------
    bodies : name, positions (2, n) [mm] and equivalent plastic strain (n,) of each
    """
    most = Strained()
    for name, X, strain in bodies:
        judged = np.ones(len(strain), dtype=bool)
        for point in singular:
            judged &= ~point.reaches(X)
        if judged.any():
            at = int(np.where(judged, strain, -1.0).argmax())
            most = max(most, Strained(float(strain[at]), name, float(X[0, at]), float(X[1, at])))
    return most


def strain_of(system: System, converged: Converged) -> Strained:
    """Return the largest strain in the bodies of a system that may yield."""
    plastic = converged.state.plastic
    bodies = [
        (part.body.name, system.positions(part.body.name), plastic[number].accumulated)
        for number, part in enumerate(system.parts)
        if not part.body.material.elastic
    ]
    return largest_strain(bodies, system.model.singular)
