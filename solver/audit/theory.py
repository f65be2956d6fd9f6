"""Limits of small-strain theory: the share that it neglects, and the plastic strain of bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.large import LargeDiscretisation
from solver.materials.state import PlasticState
from solver.model.singular import SingularPoint
from solver.tensors import principal
from solver.typing import Array

LARGE = 0.05
"""Largest share of stress or strain that small-strain theory may neglect."""

_ELASTIC = 0.25
"""Largest elastic strain of bodies of large strain."""


class Neglected(NamedTuple):
    """The share of stress or strain that small-strain theory neglects, and a message on it."""

    share: float = 0.0
    text: str = ""

    @property
    def outside(self) -> tuple[str, ...]:
        """The message if the share is too large."""
        return () if self.share <= LARGE else (self.text,)


class Strained(NamedTuple):
    """The largest equivalent plastic strain, its body and its place [mm]."""

    value: float = 0.0
    body: str = ""
    x: float = np.nan
    y: float = np.nan

    @property
    def neglected(self) -> Neglected:
        """Half of the strain: the relative difference of engineering and logarithmic strain."""
        return Neglected(
            self.value / 2,
            f"equivalent plastic strain reaches {self.value:.0%} in {self.body} at "
            f"({self.x:z.4g}, {self.y:z.4g}): small-strain theory does not hold there, reduce the "
            "load",
        )


def equivalent(state: PlasticState) -> Array:
    """Return the equivalent plastic strain (...), sqrt(2/3) times the norm of the present tensor.

    (The accumulated plastic strain would also grow in cycles of small strain.)
    """
    return np.asarray(np.sqrt(2 / 3) * np.linalg.norm(state.plastic_strain, axis=0))


def largest_strain(
    bodies: Iterable[tuple[str, Array, Array]], singular: Sequence[SingularPoint] = ()
) -> Strained:
    """Return the largest strain outside the radii of singular points.

    Parameters
    ----------
    bodies : for each body name, positions (2, n) [mm] and equivalent plastic strain (n,)
    """
    most = Strained()
    for name, X, strain in bodies:
        outside = np.ones(len(strain), dtype=bool)
        for point in singular:
            outside &= ~point.reaches(X)
        if outside.any():
            at = int(np.where(outside, strain, -1.0).argmax())
            most = max(most, Strained(float(strain[at]), name, float(X[0, at]), float(X[1, at])))
    return most


def accumulated_strain(system: System, converged: Converged) -> float:
    """Return the largest accumulated plastic strain."""
    each = _yielding(system, converged.state)
    bodies = [(name, X, plastic.accumulated) for name, X, plastic in each]
    return largest_strain(bodies, system.model.singular).value


def plastic_strain(system: System, states: Iterable[Converged]) -> Strained:
    """Return the largest equivalent plastic strain (of the tensor) where strain is small."""
    each = (body for converged in states for body in _yielding(system, converged.state))
    bodies = []
    for name, X, plastic in each:
        large = system.full(name).body.large_elements
        strain = equivalent(plastic).reshape(len(large), -1)
        bodies.append((name, X, np.where(large[:, None], 0.0, strain).ravel()))
    return largest_strain(bodies, system.model.singular)


def elastic_strain(system: System, states: Iterable[Converged]) -> Neglected:
    """Return what Hooke's law of logarithmic strain neglects in bodies of large strain.

    It is good to elastic strains of about 0.25: L. Anand, J. Appl. Mech. 46 (1979) 78-82.
    """
    most = Strained()
    for converged in states:
        bodies = []
        for number, part in enumerate(system.parts):
            if isinstance(part, LargeDiscretisation):
                stress = converged.responses[number].stress
                law = part.law(converged.state.time)
                own = np.abs(principal(law.elasticity.strain(stress) / law.stiff)[0]).max(axis=0)
                bodies.append((part.body.name, part.positions, own))
        most = max(most, largest_strain(bodies, system.model.singular))
    return Neglected(
        LARGE * most.value / _ELASTIC,
        f"elastic strain reaches {most.value:.0%} in {most.body} at ({most.x:z.4g}, "
        f"{most.y:z.4g}): the elastic law of large strain holds to about {_ELASTIC:.0%}, reduce "
        "the load",
    )


def _yielding(system: System, state: State) -> list[tuple[str, Array, PlasticState]]:
    """Return name, positions (2, n) [mm] and internal variables of the bodies that may yield."""
    return [
        (part.body.name, system.positions(part.body.name), state.plastic[number])
        for number, part in enumerate(system.parts)
        if not part.body.material.elastic
    ]
