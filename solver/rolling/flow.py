"""Plastic strain of material that flows along the rows of a window, and its derivative."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.layers import Layers
from solver.rolling.plane.rows import FlowRows
from solver.rolling.stepped import SteppedFlow, SteppedSweep
from solver.rolling.sweep import CompiledFlow, CompiledSweep
from solver.typing import Array

INFLOW = 0.1
"""Largest ratio of the plastic strain added in the first column of the window to that of the pass.
Points that an earlier pass left at yield flow as soon as the load approaches, however large the
window is; a ratio of 5 % changes stress by 1 % of the yield stress."""
LEAST = 0.05
"""Ratio of the plastic strain of a pass to the yield strain; below it `INFLOW` refers to this
level. The deepest row may have `INFLOW` times this level."""
PARTS = 16
"""Number of increments between two points of a row, for every law: the error is of first order in
their length. Under a braked wheel at draft accuracy residual stress is wrong by 2 MPa in 500, and
by 8 to 9 MPa with four."""


class Sweep(Protocol):
    """The internal variables of material that flows along rows, with n strain components, 4 or 6.

    Attributes
    ----------
    states : internal variables (..., n_rows, n_columns) at the columns
    ago : internal variables at the beginning of the last increment before each column
    """

    states: PlasticState

    @property
    def ago(self) -> PlasticState:
        """See above."""

    def changes(self, added: Array) -> Array:
        """Return the changes of plastic strain (n_rows, n_columns, n).

        ``added`` is the change of strain (n_rows, n_columns, n) at the columns.
        """


class Flow(Sweep, Protocol):
    """A sweep in two dimensions, and the residual state of the half-plane that follows it.

    Attributes
    ----------
    after : internal variables (..., n_rows) behind the load
    """

    after: PlasticState

    def along(self, added: Array) -> tuple[Array, Array]:
        """Return the changes of plastic strain (n_rows, n_columns, 4), and behind (n_rows, 4)."""


def allowed_inflow(law: Law, most_added: float) -> float:
    """Return the plastic strain that points at the edge of a window may add; see `INFLOW`."""
    return INFLOW * max(LEAST * law.yield_stress / law.elasticity.youngs_modulus, most_added)


def sweep_of(law: Law, strain: Array, start: PlasticState, parts: int) -> Sweep:
    """Return the sweep of material along rows; linear hardening uses compiled code.

    Parameters
    ----------
    strain : (n_rows, n_columns + 1, n) Mandel, downstream, n is 4 or 6; the first column is before
        the pass
    start : internal variables (..., n_rows) before the pass
    parts : number of equal increments of strain from one column to the next
    """
    if law.linear_hardening:
        return CompiledSweep(law.elasticity, law.linear_hardening, strain, start, parts)
    return SteppedSweep(law, strain, start, parts)


def flow_of(law: Law, strain: Array, start: PlasticState, parts: int) -> Flow:
    """Return the sweep and the residual state behind it; for arguments see `sweep_of`, n is 4."""
    if law.linear_hardening:
        return CompiledFlow(law.elasticity, law.linear_hardening, strain, start, parts)
    return SteppedFlow(law, strain, start, parts)


class RowFlow:
    """Plastic strain along all rows of a window for given strains, and its derivative."""

    def __init__(self, rows: FlowRows, law: Law, before: Layers, added: Array, parts: int) -> None:
        self._rows, self._law, self._before, self._added = rows, law, before, added
        self._parts = parts
        self._flow = self._of(before, added)
        self.states, self.after = self._flow.states, replace(before, state=self._flow.after)
        plastic = np.moveaxis(self.states.plastic_strain, 0, 2)
        self.force = rows.force(
            plastic - before.plastic_strain[:, None],
            self.after.plastic_strain - before.plastic_strain,
        )

    def left(self) -> tuple[PlasticState, Layers]:
        """Return the internal variables (..., n, n_columns) at the surface, and the layers behind.

        The strain at the surface is extrapolated from the uppermost rows. Plastic strain changes
        too abruptly in depth for that; it follows from the strain, as on any row.
        """
        top = self._before.top
        flow = self._of(top, self._rows.onto_surface(self._added))
        return flow.states, replace(self.after, surface=replace(top, state=flow.after))

    def _of(self, before: Layers, added: Array) -> Flow:
        """Return the flow along rows with these states before and these added strains."""
        at_rest = before.strain(self._law.elasticity)[:, None]
        strain = np.concatenate([at_rest, at_rest + added], axis=1)
        return flow_of(self._law, strain, before.state, self._parts)

    @property
    def most_added(self) -> float:
        """Largest accumulated plastic strain that the pass adds at a point."""
        return float((self.states.accumulated - self._before.accumulated[:, None]).max())

    @property
    def beyond(self) -> str:
        """Where the window is too small, because points yield at its edge; empty if nowhere.

        Points that an earlier pass left on the yield surface may flow a little there.
        """
        before = self._before.accumulated
        ahead = (self.states.accumulated[:, 0] - before).max()
        below = self.after.accumulated[-1] - before[-1]
        if ahead > allowed_inflow(self._law, self.most_added):
            return "ahead"
        return "below" if below > allowed_inflow(self._law, 0.0) else ""

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""
        return self._flow.ago

    def along(self, added: Array) -> Array:
        """Return the nodal forces (m,) for a change of the strains."""
        return self._rows.force(*self._flow.along(added))
