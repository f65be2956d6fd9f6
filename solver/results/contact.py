"""Pressure, shear, gap and slip of contact, along a scene's view and for contact pairs by name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.results.acting import ContactResult
from solver.results.outputs import output
from solver.results.places import FRACTION
from solver.results.quantities import declare, placed
from solver.results.run import FinishedRun, Values
from solver.typing import Array

_LINE = ("stage", "s")
_PAIR, _PAIRS = ("contact", "fraction"), ("contact", "stage", "fraction")
CONTACT_PRESSURE = declare("contact_pressure", "contact pressure", "MPa", dims=_LINE)
CONTACT_SHEAR = declare(
    "contact_shear", "contact shear on the lower body, or the master, along s", "MPa", dims=_LINE
)
CONTACT_GAP = declare("contact_gap", "gap between the contact surfaces", "mm", dims=_LINE)
CONTACT_SLIP = declare(
    "contact_slip", "slip of the slave along s", "mm", dims=_PAIRS,
    beside=placed("contact", "x", "y", "s"),
)  # fmt: skip
CONTACT_PRESSURE_DEFORMED = declare(
    "contact_pressure_deformed", "contact pressure over the deformed area", "MPa", dims=_PAIRS
)
CONTACT = declare("contact", "contact pair", "", dims=("contact",))
CONTACT_X = declare("contact_x", "position along x of a point of the slave", "mm", dims=_PAIR)
CONTACT_Y = declare("contact_y", "position along y of a point of the slave", "mm", dims=_PAIR)
CONTACT_S = declare("contact_s", "distance s along the slave from its start", "mm", dims=_PAIR)
CONTACT_HALF_WIDTH = declare(
    "contact_half_width", "half-width, or radius, of the contact under load", "mm"
)
PEAK_CONTACT_PRESSURE = declare(
    "peak_contact_pressure", "largest contact pressure under load", "MPa"
)
PEAK_CONTACT_PRESSURE_S = declare(
    "peak_contact_pressure_s",
    "distance along the surface from the middle of the contact to the largest pressure, one of the "
    "positions s", "mm",
)  # fmt: skip


@output("contact", "s", "contact")
def contact(run: FinishedRun) -> Values:
    """Return pressure, shear and gap along s, half-width, and peak pressure with its position."""
    along = [run.acting(c).along(run.view.s + centre) for c, centre in run.stages]
    acting = run.acting(run.loaded)
    loaded = along[run.view.stages.index(run.view.loaded)][0]
    lines = (CONTACT_PRESSURE, CONTACT_SHEAR, CONTACT_GAP)
    return {
        **{line: np.stack([values[k] for values in along]) for k, line in enumerate(lines)},
        CONTACT_HALF_WIDTH: acting.half_width,
        PEAK_CONTACT_PRESSURE: acting.peak,
        PEAK_CONTACT_PRESSURE_S: float(run.view.s[np.nan_to_num(loaded).argmax()]),
    }


def contacts(
    results: Sequence[Sequence[ContactResult]], names: Sequence[str], samples: int
) -> Values:
    """Return pressure, shear, gap and slip of pairs at equal fractions of the slave's length.

    Parameters
    ----------
    results : for each pair, its result at each stage
    names : names of the pairs
    samples : number of positions along each slave
    """
    fraction = np.linspace(0.0, 1.0, samples)
    at = [fraction * pair[0].s[-1] for pair in results]

    def spread(name: str) -> Array:
        return np.stack([
            np.stack([np.interp(s, each.s, getattr(each, name)) for each in pair])
            for s, pair in zip(at, results, strict=True)
        ])  # fmt: skip

    places = zip(at, results, strict=True)
    X = [[np.interp(s, pair[0].s, x) for x in pair[0].X] for s, pair in places]
    return {
        CONTACT: np.array(list(names)),
        FRACTION: fraction,
        CONTACT_X: np.stack([x for x, _ in X]),
        CONTACT_Y: np.stack([y for _, y in X]),
        CONTACT_S: np.stack(at),
        CONTACT_PRESSURE.at(*_PAIRS): spread("pressure"),
        CONTACT_SHEAR.at(*_PAIRS): spread("shear"),
        CONTACT_GAP.at(*_PAIRS): spread("gap"),
        CONTACT_SLIP: spread("slip"),
        CONTACT_PRESSURE_DEFORMED: spread("pressure_deformed"),
    }


STICK_HALF_WIDTH = declare(
    "stick_half_width", "half-width of the stick zone of the contact under load", "mm"
)
STICK_FRACTION = declare(
    "stick_fraction", "ratio of the half-width of the stick zone to that of the contact, under load"
)


@output("stick", "contact")
def stick(run: FinishedRun) -> Values:
    """Return the size of the stick zone: zero without friction, NaN without contact."""
    acting = run.acting(run.loaded)
    if acting.points is None:
        return {STICK_HALF_WIDTH: np.nan, STICK_FRACTION: np.nan}
    stuck = stick_half_width(acting.points, symmetric=run.view.symmetric)
    return {
        STICK_HALF_WIDTH: stuck,
        STICK_FRACTION: stuck / whole if (whole := acting.half_width) else np.nan,
    }


def stick_half_width(points: ContactResult, *, symmetric: bool) -> float:
    """Return the half-width of the stick zone [mm].

    Each end is half-way between the last point that sticks and the first that slips, accurate to
    half an element. If no point sticks, the zone is narrower than an element, and the result is 0.
    """
    stuck = np.flatnonzero(points.sticking)
    if not len(stuck):
        return 0.0

    def end(at: int, beyond: int) -> float:
        slips = 0 <= beyond < len(points.s) and points.closed[beyond]
        return float((points.s[at] + points.s[beyond]) / 2 if slips else points.s[at])

    right = end(stuck[-1], stuck[-1] + 1)
    return right if symmetric else (right - end(stuck[0], stuck[0] - 1)) / 2
