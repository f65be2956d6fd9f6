"""A prism, whose cross-section is the same everywhere along x, under loads that roll over it.

x points along the prism, the load moves along +x; y points up and z across, x, y, z right-handed.
Stations lie downstream of the first one, ``x_c = x_0 - c h``. Elastic fields are sums of waves
along x; each wavenumber is a problem of the cross-section alone, factorised once. A steady pass is
found by `solver.steady.passing.passing` on a `PrismTrack`.
"""

from solver.prism.far_field import FarField
from solver.prism.given_patch import EllipticPatch
from solver.prism.modes import Modes, ZoneResponse
from solver.prism.patch import RollingPatch
from solver.prism.patch_contact import PatchContact
from solver.prism.patch_passing import PatchPassing
from solver.prism.profiled_wheel import ProfiledWheel
from solver.prism.section import Section
from solver.prism.state import PrismState
from solver.prism.stepped import LoadAt, SteppedIncrement, SteppedPrism, SteppedState
from solver.prism.stepped_patch import SteppedPatch
from solver.prism.track import PrismTrack

__all__ = [
    "EllipticPatch",
    "FarField",
    "LoadAt",
    "Modes",
    "PatchContact",
    "PatchPassing",
    "PrismState",
    "PrismTrack",
    "ProfiledWheel",
    "RollingPatch",
    "Section",
    "SteppedIncrement",
    "SteppedPatch",
    "SteppedPrism",
    "SteppedState",
    "ZoneResponse",
]
