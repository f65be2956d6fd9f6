"""Contact pressure, shear and gap along the surface, half-width and peak of the contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.results.quantities import declare

if TYPE_CHECKING:
    from solver.results.look import Look, Values

_LINE = ("stage", "s")
CONTACT_PRESSURE = declare("contact_pressure", "contact pressure", "MPa", dims=_LINE)
CONTACT_SHEAR = declare(
    "contact_shear", "contact shear traction on the lower body along x", "MPa", dims=_LINE
)
CONTACT_GAP = declare(
    "contact_gap", "gap between the contact surfaces under load", "mm", dims=_LINE
)
CONTACT_HALF_WIDTH = declare("contact_half_width", "half-width of the contact under load", "mm")
PEAK_CONTACT_PRESSURE = declare(
    "peak_contact_pressure", "largest contact pressure under load", "MPa"
)
PEAK_CONTACT_PRESSURE_S = declare(
    "peak_contact_pressure_s",
    "distance along the surface from the middle of the contact of the largest pressure, among the "
    "positions s", "mm",
)  # fmt: skip


def contact(look: Look) -> Values:
    """Return pressure, shear and gap along the surface, half-width, and peak with its place."""
    along = [look.touch.along(c, look.view.s + centre) for c, centre in look.stages]
    width, peak = look.touch.extent(look.loaded)
    loaded = along[look.view.stages.index(look.view.loaded)][0]
    lines = (CONTACT_PRESSURE, CONTACT_SHEAR, CONTACT_GAP)
    return {
        **{line: np.stack([values[k] for values in along]) for k, line in enumerate(lines)},
        CONTACT_HALF_WIDTH: width,
        PEAK_CONTACT_PRESSURE: peak,
        PEAK_CONTACT_PRESSURE_S: float(look.view.s[np.nan_to_num(loaded).argmax()]),
    }
