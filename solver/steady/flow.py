"""What material gathers on its way along the rows of a window, and its derivative."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.steady import sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.material import Material
    from solver.steady.layers import Layers
    from solver.steady.rows import FlowRows

    Array = NDArray[np.float64]

INFLOW = 0.1
"""Ratio of the plastic strain gathered where the window begins to that of the pass, up to which it
is large enough. Rows that an earlier pass left at yield flow as soon as the load comes near,
however large the window is; 5 % then change stress by 1 % of the yield stress."""
LEAST = 0.05
"""Ratio of the plastic strain to the yield strain, up to which a pass gathers nothing to speak of.
Its tenth is too much for the deepest row."""


class RowFlow:
    """What material gathers on its way along the rows for given strains, and its derivative."""

    def __init__(
        self, rows: FlowRows, material: Material, before: Layers, added: Array, parts: int
    ) -> None:
        rule, self._elasticity = material.hardening_rule, material.elasticity
        double_shear = 2 * self._elasticity.shear_modulus
        self._law = np.array(
            [
                double_shear,
                double_shear + rule.prager_modulus,
                rule.isotropic_modulus,
                double_shear + 2 / 3 * rule.modulus,
                rule.yield_stress,
            ]
        )
        self._rows, self._before, self._added, self._parts = rows, before, added, parts
        self._yield_strain = material.yield_stress / material.youngs_modulus
        self.plastic, self.total, self._path, self.after, self._closing = self._of(before, added)
        self.force = rows.force(
            self.plastic - before.plastic_strain[:, None],
            self.after.plastic_strain - before.plastic_strain,
        )

    def surface(self) -> tuple[Array, Array, Layers]:
        """Return plastic strain (n, n_columns, 4) and accumulated strain at the surface, and after.

        Its strain is that of the uppermost rows, extrapolated. Plastic strain changes too abruptly
        in depth for that; it follows from the strain, as on any row.
        """
        plastic, total, _, after, _ = self._of(
            self._before.top, self._rows.onto_surface(self._added)
        )
        return plastic, total, after

    def _of(self, before: Layers, added: Array) -> tuple[Array, Array, Array, Layers, Any]:
        """Return what rows gather at the columns, how, what is left, and how it closed."""
        at_rest = before.strain(self._elasticity)[:, None]
        strain = np.concatenate([at_rest, at_rest + added], axis=1)
        start = before.plastic_strain, before.accumulated
        plastic, total, path = sweep.flow(strain, *start, self._law, self._parts)
        ends = np.ascontiguousarray(plastic[:, -1]), total[:, -1].copy()
        closed = sweep.close(*ends, self._law, self._elasticity.bulk_modulus)
        after = replace(before, plastic_strain=closed[0], accumulated=closed[1])
        return plastic, total, path, after, closed[2:]

    @property
    def gathered(self) -> float:
        """The most accumulated plastic strain that any point gathers."""
        return float((self.total - self._before.accumulated[:, None]).max())

    @property
    def beyond(self) -> str:
        """Where the window is too small: rows yield at its end already; empty if nowhere.

        Rows that an earlier pass left on the yield surface flow a little there.
        """
        before = self._before.accumulated
        ahead = (self.total[:, 0] - before).max()
        below = self.after.accumulated[-1] - before[-1]
        nothing = LEAST * self._yield_strain
        if ahead > INFLOW * max(nothing, self.gathered):
            return "ahead"
        return "below" if below > INFLOW * nothing else ""

    @property
    def last_steps(self) -> tuple[Array, Array]:
        """Multiplier and direction of flow in the last increment before each column."""
        last = self._path[:, :, -1]
        return last[..., 4], last[..., :4]

    def along(self, added: Array) -> Array:
        """Return the nodal forces (m,) for a change of the strains."""
        plastic, total = sweep.flow_along(added, self._law, self._path)
        ends = np.ascontiguousarray(plastic[:, -1]), total[:, -1].copy()
        closed = sweep.close_along(*ends, self._law, *self._closing)
        return self._rows.force(plastic, closed)
