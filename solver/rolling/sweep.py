"""Flow of a material along rows of points: the radial return from point to point, compiled.

The compiled loops are in `solver.rolling.kernels`.
"""

from __future__ import annotations

import numpy as np

from solver.late import late
from solver.materials.law import Law
from solver.materials.radial_return import SQRT23
from solver.materials.state import PlasticState
from solver.typing import Array

flow, flow_along, close, close_along = late(
    "rolling.kernels", "flow", "flow_along", "close", "close_along"
)


class CompiledSweep:
    """The internal variables of a material with linear hardening that flows along rows.

    Strains have n components, 4 or 6.

    Attributes
    ----------
    states : internal variables (..., n_rows, n_columns) at the columns
    ago : internal variables at the beginning of the last increment before each column
    """

    def __init__(self, law: Law, strain: Array, start: PlasticState, parts: int) -> None:
        rule, double_shear = law.linear_hardening, 2 * law.elasticity.shear_modulus
        assert rule is not None
        self._law = np.array(
            [
                double_shear,
                double_shear + rule.prager_modulus,
                rule.isotropic_modulus,
                double_shear + 2 / 3 * rule.modulus,
                rule.yield_stress,
            ]
        )
        self._each = (0,) * strain.shape[2]
        plastic = np.ascontiguousarray(start.plastic_strain.T)
        before = plastic, np.ascontiguousarray(start.accumulated)
        # numpy asks for zeros, and gets memory that costs nothing where nothing is written
        self._path = np.zeros((strain.shape[0], strain.shape[1] - 1, parts, strain.shape[2] + 2))
        plastic, total = flow(strain, *before, self._law, self._path, self._each)
        self.states = PlasticState(np.moveaxis(plastic, 2, 0), total)

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""
        last, n = self._path[:, :, -1], len(self._each)
        flowed = np.moveaxis(last[..., n, None] * last[..., :n], 2, 0)
        return PlasticState(
            self.states.plastic_strain - flowed, self.states.accumulated - SQRT23 * last[..., n]
        )

    def changes(self, added: Array) -> Array:
        """Return the changes of plastic strain (n_rows, n_columns, n).

        ``added`` is the change of strain (n_rows, n_columns, n) at the columns.
        """
        return self._changes(added)[0]

    def _changes(self, added: Array) -> tuple[Array, Array]:
        return flow_along(added, self._law, self._path, self._each)


class CompiledFlow(CompiledSweep):
    """A sweep in two dimensions, and the residual state of the half-plane that follows it.

    ``after`` are the internal variables (..., n_rows) behind the load.
    """

    def __init__(self, law: Law, strain: Array, start: PlasticState, parts: int) -> None:
        super().__init__(law, strain, start, parts)
        left, gathered, *self._closing = close(
            np.ascontiguousarray(self.states.plastic_strain[..., -1].T),
            self.states.accumulated[:, -1].copy(),
            self._law,
            law.elasticity.bulk_modulus,
        )
        self.after = PlasticState(left.T, gathered)

    def along(self, added: Array) -> tuple[Array, Array]:
        """Return the changes of plastic strain (n_rows, n_columns, 4), and behind (n_rows, 4)."""
        plastic, total = self._changes(added)
        ends = np.ascontiguousarray(plastic[:, -1]), total[:, -1].copy()
        return plastic, close_along(*ends, self._law, *self._closing)
