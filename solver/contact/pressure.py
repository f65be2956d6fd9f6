"""Contact pressure and shear from contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import State
    from solver.contact.system import System


def contact_pressure(
    system: System, state: State, interface: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return pressure and shear on the slave's vertices (n,) [MPa]: means under each hat.

    The multiplier field is piecewise linear. Its means under the hats have the same resultant as
    its values at the vertices, without the oscillation of these next to a sharp corner.

    Forces are divided by the area before loading, as the small strains of the slave imply.
    """
    contact, chain = state.contacts[interface], system.interfaces[interface].slave_surface
    pairing = system.pairing(state, interface)
    safe = np.where(pairing.area > 0, pairing.area, 1.0)
    x = chain.X[:, chain.vertices]
    edge = chain.lengths
    measure = chain.depth(x)
    # consistent mass of the hats on each edge, the depth varying linearly along it
    left = edge / 12 * (3 * measure[:-1] + measure[1:])
    right = edge / 12 * (measure[:-1] + 3 * measure[1:])
    cross = edge / 12 * (measure[:-1] + measure[1:])
    mass = np.diag(np.append(left, 0) + np.append(0, right))
    mass += np.diag(cross, 1) + np.diag(cross, -1)
    total = mass.sum(axis=1)
    smooth = mass / np.where(total > 0, total, 1.0)[:, None]
    pressure, shear = contact.normal / safe, contact.tangential / safe
    return smooth @ pressure, smooth @ shear
