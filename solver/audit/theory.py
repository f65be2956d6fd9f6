"""Where small-strain theory ends: what it leaves out, and the plastic strain of bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.materials.state import PlasticState
from solver.model.singular import SingularPoint
from solver.typing import Array

LARGE = 0.05
"""Largest share that small-strain theory may leave out."""


class Neglected(NamedTuple):
    """The share of stress or strain that small-strain theory leaves out, and where."""

    share: float = 0.0
    text: str = ""

    @property
    def outside(self) -> tuple[str, ...]:
        """A message if it is too much."""
        return () if self.share <= LARGE else (self.text,)


class Strained(NamedTuple):
    """The largest equivalent plastic strain, its body and its place [mm]."""

    value: float = 0.0
    body: str = ""
    x: float = np.nan
    y: float = np.nan

    @property
    def neglected(self) -> Neglected:
        """Half of the strain: the share by which engineering and logarithmic strain differ."""
        return Neglected(
            self.value / 2,
            f"equivalent plastic strain reaches {self.value:.0%} in {self.body} at "
            f"({self.x:z.4g}, {self.y:z.4g}): small-strain theory does not hold there, reduce the "
            "load",
        )


def equivalent(state: PlasticState) -> Array:
    """Return the equivalent (...) of the plastic strain tensor, sqrt(2/3) times its norm.

    The accumulated plastic strain grows in every cycle, also where strain stays small.
    """
    return np.asarray(np.sqrt(2 / 3) * np.linalg.norm(state.plastic_strain, axis=0))


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


def accumulated_strain(system: System, converged: Converged) -> float:
    """Return the largest accumulated plastic strain."""
    each = _yielding(system, converged.state)
    bodies = [(name, X, plastic.accumulated) for name, X, plastic in each]
    return largest_strain(bodies, system.model.singular).value


def plastic_strain(system: System, states: Iterable[Converged]) -> Strained:
    """Return the largest equivalent of the plastic strain tensor in some states."""
    each = (body for converged in states for body in _yielding(system, converged.state))
    bodies = ((name, X, equivalent(plastic)) for name, X, plastic in each)
    return largest_strain(bodies, system.model.singular)


def _yielding(system: System, state: State) -> list[tuple[str, Array, PlasticState]]:
    """Return name, positions (2, n) [mm] and internal variables of the bodies that may yield."""
    return [
        (part.body.name, system.positions(part.body.name), state.plastic[number])
        for number, part in enumerate(system.parts)
        if not part.body.material.elastic
    ]
