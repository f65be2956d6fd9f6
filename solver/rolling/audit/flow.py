"""The audit of material that flows along rows of points in a steady pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from solver.audit.large_strain import of_material
from solver.audit.report import Audit, broken, warnings
from solver.audit.theory import Neglected, equivalent
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.rolling.passing import Pass
from solver.typing import Array, Ints

Rows = Ints | slice


INFLOW = 0.1
"""Limit of the plastic strain added in the first column, over that of the pass. Points that an
earlier pass left at yield flow as soon as the load approaches, in a window of any size; 5 % change
stress by 1 % of the yield stress."""
_LEAST = 0.05
"""Least plastic strain of a pass, over the yield strain, to which `INFLOW` refers: a pass that adds
less hardly yields, and 1/200 of the yield strain may then be added."""
STEADINESS = 1e-4
"""Limit of the difference of two strains, as stress over the yield stress: far below the error of
any mesh, and far above rounding."""


class AuditedFlow:
    """The flow of material through the window, by the last increment before each column.

    Parameters
    ----------
    at_rest : (n_rows, n_components) strain before the pass, Mandel
    """

    def __init__(self, material: Law, found: Pass[Any], at_rest: Array) -> None:
        self._material, self._found = material, found
        self._at_rest = np.moveaxis(at_rest[:, None], 2, 0)
        self._path = np.moveaxis(at_rest[:, None] + found.strain, 2, 0)
        self._strain = _flat(self._path)
        self._after, self._before = (
            each.unpacked(_flat(each.packed)) for each in (found.states, found.ago)
        )
        stiffness = material.stiffness(len(self._strain))
        self._stress = stiffness @ (self._strain - self._after.plastic_strain)

    def misfit(self) -> float:
        """Return the misfit of the increments to the law [MPa]."""
        off = self._material.misfit(self._strain, self._stress, self._before, self._after)
        return largest(off)

    def retraced(self, rows: Rows = slice(None)) -> float:
        """Return the difference of the states from those of the law, column by column [MPa].

        All increments between two columns are repeated with the law, from the state at the upstream
        column. The first column starts from the state before the pass.
        """
        found, law = self._found, self._material
        states = found.states.packed[:, rows]
        strain = self._path[:, rows]
        earlier = found.before.state.packed[:, rows, None]
        before = np.concatenate([earlier, states[..., :-1]], axis=2)
        first = _flat(np.concatenate([self._at_rest[:, rows], strain[..., :-1]], axis=2))
        state, last = self._after.unpacked(_flat(before)), _flat(strain)
        for part in range(1, found.parts + 1):
            state = law.respond(first + part / found.parts * (last - first), state).state
        return difference(law, self._after.unpacked(_flat(states)), state)

    def beyond(self) -> float:
        """Return the stress beyond yield [MPa]."""
        return largest(self._material.yield_value(self._stress, self._after))

    def dissipation(self) -> float:
        """Return the least plastic dissipation of an increment [N mm/mm3]."""
        n = len(self._strain)
        nothing = np.zeros((n, n, 0)), np.zeros(0, dtype=bool)
        response = Response(self._stress, nothing[0], self._after, nothing[1])
        return float(self._material.dissipation(self._before, response).min())

    def large_strain(self, body: str, volume: Array) -> Neglected:
        """Return the stress that small-strain theory neglects in a body, in the window.

        Parameters
        ----------
        volume : (n_rows, n_columns) volume of the points [mm3]
        """
        elasticity = self._material.elasticity
        return of_material(body, elasticity, self._stress, self._strain, volume.ravel())

    def strained(self) -> Array:
        """Return the largest equivalent plastic strain (n_rows,), in the window and behind."""
        within, behind = (
            equivalent(state) for state in (self._found.states, self._found.after.state)
        )
        return np.maximum(within.max(axis=1), behind)

    def inflow(self) -> float:
        """Return the plastic strain added in the first column, over that of the pass."""
        return self.over_most(self._found.accumulated[:, 0] - self._found.before.accumulated)

    def outflow(self) -> float:
        """Return the plastic strain added behind the window, over that of the pass."""
        return self.over_most(self._found.after.accumulated - self._found.accumulated[:, -1])

    def over_most(self, added: Array) -> float:
        """Return the largest added plastic strain over that of the pass.

        The pass counts with at least `_LEAST` of the yield strain.
        """
        material = self._material
        yield_strain = material.yield_stress / material.elasticity.youngs_modulus
        return largest(added) / max(_LEAST * yield_strain, self._found.most_added)


def judged(
    law: Law,
    figures: Mapping[str, float],
    limits: Mapping[str, float],
    neglected: Sequence[Neglected],
) -> Audit:
    """Return the audit of a pass from its figures, their limits, and what the theory neglects."""
    figures = {**figures, "audit_large_strain": max(each.share for each in neglected)}
    own = {name: at for name, at in limits.items() if name in figures}
    return Audit(
        figures,
        violations=broken(figures, own, law.yield_stress),
        warnings=warnings(figures),
        outside=sum((each.outside for each in neglected), ()),
    )


def difference(material: Law, one: PlasticState, other: PlasticState) -> float:
    """Return the largest difference of internal variables, as stress [MPa].

    Strain is multiplied by 2 G; any other variable counts relative to its largest value.
    """
    double_shear, worst = 2 * material.elasticity.shear_modulus, []
    for name in (f.name for f in fields(one)):
        values, others = getattr(one, name), getattr(other, name)
        off = float(np.abs(values - others).max(initial=0.0))
        if name in ("plastic_strain", "accumulated"):
            worst.append(off * double_shear)
        elif off:
            size = max(np.abs(values).max(), np.abs(others).max())
            worst.append(off / float(size) * material.yield_stress)
    return float(np.max(worst))


def largest(values: Array) -> float:
    """Return the largest value, not below zero, or NaN where one is NaN."""
    return float(values.max(initial=0.0))


def deviation(strain: Array) -> float:
    """Return the largest norm of the deviators of Mandel strains (..., n_components)."""
    mean = strain[..., :3].mean(axis=-1)
    square = (strain**2).sum(axis=-1) - 3 * mean**2
    return float(np.sqrt(np.maximum(square.max(), 0.0)))


def _flat(values: Array) -> Array:
    """Return values (n, n_points) of points in rows (n, n_rows, n_columns)."""
    return values.reshape(len(values), -1)
