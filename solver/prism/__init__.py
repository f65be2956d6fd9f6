"""An elastic prism, whose cross-section is the same everywhere along x, under loads along it.

Fields are sums of waves along x; each wavenumber is a problem of the cross-section alone,
factorised once.
"""

from solver.prism.far_field import FarField
from solver.prism.modes import Modes, ZoneResponse
from solver.prism.section import Section

__all__ = ["FarField", "Modes", "Section", "ZoneResponse"]
