"""Contact pressure and shear from contact forces."""

from __future__ import annotations

import numpy as np

from solver.contact.state import State
from solver.contact.system import System
from solver.typing import Array


def contact_pressure(system: System, state: State, interface: int) -> tuple[Array, Array]:
    """Return pressure and shear on the slave's vertices (n,) [MPa]: means under each hat.

    The multiplier field is piecewise linear where the slave faces the master, and zero elsewhere.
    Its means under the hats have the same resultant as its values at the vertices, but do not
    oscillate next to a sharp corner, and do not grow where the master ends under a hat (force over
    a small covered area). The sum of mean times area of the whole hat is the contact force.

    The area is that before loading, as the small strains of the slave imply.
    """
    contact, hats = state.contacts[interface], system.interfaces[interface].slave_surface.hats
    pairing = system.pairing(state, interface)

    def mean(force: Array) -> Array:
        area = pairing.area
        each = np.divide(force, area, out=np.zeros_like(force), where=area > 0)
        # hats sum to one: in the integrals one of two neighbours gains as much as the other loses
        gained = pairing.shared * np.diff(each)
        integral = force + np.append(gained, 0.0) - np.append(0.0, gained)
        return np.divide(integral, hats, out=np.zeros_like(force), where=hats > 0)

    return mean(contact.normal), mean(contact.tangential)
