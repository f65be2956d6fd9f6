"""Contact pressure and shear from contact forces."""

from __future__ import annotations

import numpy as np

from solver.contact.state import State
from solver.contact.system import System
from solver.typing import Array


def contact_pressure(system: System, state: State, interface: int) -> tuple[Array, Array]:
    """Return pressure and shear on the slave's vertices (n,) [MPa]: means under each hat.

    The multiplier field is piecewise linear where the master faces the slave, and zero elsewhere.
    Its means under the hats have the same resultant as its values at the vertices, without the
    oscillation of these next to a sharp corner, and without their growth where the master ends
    under a hat: force over a small covered area. The sum of means times areas of the whole hats is
    the contact force.

    Forces are divided by the area before loading, as the small strains of the slave imply.
    """
    contact, chain = state.contacts[interface], system.interfaces[interface].slave_surface
    pairing, full = system.pairing(state, interface), chain.hats

    def mean(force: Array) -> Array:
        area = pairing.area
        each = np.divide(force, area, out=np.zeros_like(force), where=area > 0)
        # hats sum to one: what one of two neighbours gains in the integrals the other loses
        gained = pairing.shared * np.diff(each)
        integral = force + np.append(gained, 0.0) - np.append(0.0, gained)
        return np.divide(integral, full, out=np.zeros_like(force), where=full > 0)

    return mean(contact.normal), mean(contact.tangential)
