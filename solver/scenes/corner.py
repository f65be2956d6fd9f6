"""The sharp corner at the end of a contact: the power of its singularity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from solver.results.singularity import (
    APPARENT_POWER,
    NOWHERE,
    SINGULAR_INTENSITY,
    SINGULAR_POWER,
    SINGULAR_POWER_ERROR,
    apparent_power,
    fit_singularity,
)

if TYPE_CHECKING:
    from solver.results.contact_result import ContactResult
    from solver.results.run import FinishedRun, Values
    from solver.scenes.flat_punch import FlatPunch

_NEAREST, _FARTHEST = 10.0, 0.03
"""Range of the fit: elements at the corner, and half-widths from it."""
_GRADED = 0.9
"""Largest range of the fit / distance within which elements grow."""
_SHARE = 0.25
"""Largest range of the fit / distance of a groove, or of the end of slip."""
_NOTCH, _NOTCH_SHEAR = 0.364, 0.543
"""A corner that sticks is a notch of 270 degrees (Williams): difference of its first two powers,
and outward shear / pressure of the first. In the second the two may have any sign."""
_SEEN = (0.01, 0.1)
"""Range in which the apparent power is taken / a."""


class Cornered(Protocol):
    """Parameters of a scene whose contact ends at a corner, at the distance a from its middle."""

    mean_pressure: float
    half_width: float
    smallest_element: float

    @property
    def geometry(self) -> FlatPunch:
        """Dimensions and elements [mm]."""


def corner(run: FinishedRun) -> Values:
    """Return the power of the singularity with its error, its intensity, and the apparent power.

    Contact pressure is fitted from ten elements from the corner on, as far as 0.03 half-widths, or
    nine tenths of where elements grow, or a quarter of the way to a groove or to the end of slip,
    where that is less. Where elements grow in proportion to the distance, their error is the same
    share of the pressure everywhere, and has no part in its power. NaN where the corner has lifted
    off, and where it sticks and the first term of the notch is not the largest in that range.
    Stress in the half-plane would be a worse measure: a uniform stress along its
    surface, which has no part in the pressure, is a term only 1 - p above the first.
    """
    parameters, points = run.parameters, _points(run)
    r = 1 - points.s / parameters.half_width
    pressure = points.pressure / parameters.mean_pressure
    found, apparent = NOWHERE, np.nan
    if points.closed[-1]:
        low = _NEAREST * parameters.smallest_element
        graded = _GRADED * parameters.geometry.graded / parameters.half_width
        high = min(_FARTHEST, graded, _SHARE * _next_feature(parameters, points, r))
        notch = bool(points.sticking[-1]) and not _flush(parameters)
        if not notch or _first_term_leads(points, r, low):
            found = fit_singularity(r, pressure, low, high, _NOTCH if notch else 1.0)
        apparent = apparent_power(r, pressure, *_SEEN)
    return {
        SINGULAR_POWER: found.power,
        SINGULAR_POWER_ERROR: found.error,
        SINGULAR_INTENSITY: found.intensity,
        APPARENT_POWER: apparent,
    }


def _points(run: FinishedRun) -> ContactResult:
    """Return the contact points under load."""
    points = run.tractions.points(run.loaded)
    assert points is not None, "the model has a contact pair"
    return points


def _flush(parameters: Cornered) -> bool:
    """Whether a groove begins at the corner: what sticks there is no notch, but a straight side."""
    groove = parameters.geometry.half_plane_groove
    return groove is not None and groove.distance == 0


def _first_term_leads(points: ContactResult, r: np.ndarray, low: float) -> bool:
    """Whether shear where the fit begins is more than half that of the first term of a notch."""
    near = int(np.argmin(np.abs(r - low)))
    return bool(points.shear[near] > _NOTCH_SHEAR / 2 * points.pressure[near])


def _next_feature(parameters: Cornered, points: ContactResult, r: np.ndarray) -> float:
    """Return the distance / a from the corner of what else shapes the field."""
    geometry, near = parameters.geometry, [1.0]
    for groove in (geometry.punch_groove, geometry.half_plane_groove):
        if groove:
            near.append((groove.distance or groove.side) / parameters.half_width)
    other = points.sticking != points.sticking[-1]
    return float(min([*near, *r[other]]))


def lifted(run: FinishedRun) -> tuple[str, ...]:
    """Return a warning where the corner has lifted off."""
    width, _ = run.tractions.extent(run.loaded)
    if width >= run.parameters.half_width * (1 - 1e-9):
        return ()
    return (f"the corner has lifted off: contact ends at {width:.4g} mm, without a singularity",)
