"""The fields of a prism for eigenstress and forces on chosen nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solver.rolling.rail.modes import Modes
from solver.rolling.rail.section import Section

Array = NDArray[np.float64]


class ZoneResponse(NamedTuple):
    """Mandel strain (n_points, window, 6) and displacement (n_rows, window) of the rows [mm]."""

    strain: Array
    displacement: Array


def response(
    modes: Modes, eigenstress: Array | None = None, forces: Array | None = None
) -> ZoneResponse:
    """Return the fields of an eigenstress (n_points, window, 6) and forces (n_rows, window)."""
    nodal = np.zeros((len(modes.wavenumbers), 2, len(modes.unknowns)))
    if eigenstress is not None:
        nodal += modes.nodal(eigenstress)
    if forces is not None:
        nodal += modes.pushed(forces)
    u = modes.solved(nodal)
    rows = modes.rows @ u.reshape(-1, len(modes.unknowns)).T
    return ZoneResponse(modes.strain(u), modes._rows_at_stations(rows))


def rows_of(section: Section, nodes: NDArray[np.int64]) -> sparse.csr_array:
    """Return the rows (3 n_nodes, n) of the displacements of nodes: along x, then y, then z."""
    unknowns = (3 * nodes + np.arange(3)[:, None]).ravel()
    indptr = np.arange(len(unknowns) + 1)
    shape = len(unknowns), section.n
    return sparse.csr_array((np.ones(len(unknowns)), unknowns, indptr), shape=shape)
