"""The bodies, the passes and the results of the raceway.

Zone and window of the block are multiples of the Hertz ellipse; runs of one geometry share its
set-up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from solver.errors import ModelError
from solver.loading.checks import uncarried
from solver.memory import kept
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.results.view import ACROSS_TRACK, View
from solver.rolling.load import RollingLoad
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_contact import EllipticPatch, PatchLoad
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.profiles.wheel_profile import crowned
from solver.rolling.rail.profiles.zone import Zone, raceway_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.raceway import BESIDE, RacewayParameters
from solver.rolling.scenes.rail_outputs import remedies, sketched
from solver.rolling.scenes.rail_passes import by_rail_passes, effort_of
from solver.rolling.scenes.rail_window import PrismGeometry, split_rows, whole
from solver.rolling.scenes.rolling_setup import AXLE_HEIGHT
from solver.scenes.scene import Advice, Effort, Method
from solver.scenes.sketch import Sketch

_BLOCK = 32.0
"""Depth and half the width of the block, over the longer semi-axis. The mean error of stress in the
zone against a half-space is 0.05 % of p0; with 16 it is 0.15 %, with 64 it is 0.02 %."""
_DEPTH, _REACH = 1.8, 1.2
"""Depth of the zone, over `RacewayParameters.below`; half the length where the load may act, over
a."""
_LEVELS = 2
"""Levels of the far field: the last one is 64 times 8 a long, and the block is held at its foot."""
_GROOVE, _STEEPEST = 1.6, math.radians(75.0)
"""Half the width of the groove along its arc, over that of the zone; largest slope of its sides
[rad]. The shoulders beyond are flat."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RacewayGeometry(PrismGeometry):
    """The geometry of a raceway.

    Attributes
    ----------
    block : its depth, and half its width [mm]
    groove : radius of the groove, and half its width [mm]; None for a flat block
    layer : of the zone, see `Zone` [mm]
    """

    block: float
    groove: tuple[float, float] | None
    layer: float

    @property
    def zone(self) -> Zone:
        """Where elements are small."""
        return Zone(
            at=0.0, half_width=self.half_width, depth=self.depth, size=self.size,
            layer=self.layer, split=self.split,
        )  # fmt: skip

    @property
    def elements(self) -> int:
        """See `PrismGeometry`."""
        return self.zone.elements


def geometry(parameters: RacewayParameters, reach: float = 1.0) -> RacewayGeometry:
    """Return the geometry; ``reach`` is the ratio of zone and window to their usual size.

    Raises
    ------
    ModelError
        for the parameter of the load, if the zone would reach the steep sides of groove, ball or
        roller
    """
    p, (a, b) = parameters, parameters.size
    count = p.elements
    size, layer, spacing = b / count, min(a, b) / count, a / count
    half_width = whole(reach * BESIDE * b, size)
    if half_width > p.room:
        allowed = (
            f"must make a zone of at most {p.room:.4g} mm on either side, here {half_width:.4g}"
        )
        raise ModelError(p.load_by, getattr(p, p.load_by), allowed)
    groove = None
    if p.groove < math.inf:
        groove = p.groove, p.groove * math.sin(min(_GROOVE * half_width / p.groove, _STEEPEST))
    return RacewayGeometry(
        elasticity=p.elasticity,
        block=_BLOCK * max(a, b),
        groove=groove,
        half_width=half_width,
        depth=whole(reach * _DEPTH * p.below, layer),
        size=size,
        layer=layer,
        split=split_rows(p, p.below, layer),
        spacing=spacing,
        reach=whole(reach * _REACH * a, spacing),
    )


@kept
def section_of(own: RacewayGeometry) -> Section:
    """Return the meshed section of a raceway, held at its foot."""
    return Section(
        raceway_mesh(2 * own.block, own.block, own.zone, own.groove),
        own.elasticity,
        supports={"foot": "xyz"},
    )


@kept
def track_of(own: RacewayGeometry) -> PrismTrack:
    """Return the raceway, set up once in a process for each geometry."""
    return own.track(section_of(own), _LEVELS)


def prism(parameters: RacewayParameters, reach: float) -> PrismTrack:
    """Return the raceway; errors as of `geometry`."""
    return track_of(geometry(parameters, reach))


def load_on(track: PrismTrack, own: RacewayParameters, last: Any = None) -> PatchLoad:
    """Return the load of a pass; ``last`` has no effect.

    Raises `LimitLoad` or `Runaway` if the surface does not carry a prescribed shear.
    """
    p, ellipse = own, own.ellipse
    if p.load == "hertz":
        shear = p.traction * p.friction
        if error := uncarried(p.material(), abs(shear) * ellipse.peak_pressure):
            raise error
        return EllipticPatch(
            grid=track.grid, load=RollingLoad(force=ellipse.force), a=ellipse.a, b=ellipse.b,
            shear=(shear, 0.0),
        )  # fmt: skip
    wheel = ProfiledWheel(
        profile=crowned(p.across, p.across).height,
        radius=p.radius,
        elasticity=p.wheel_elasticity,
        track_radius=p.ring,
    )
    return RollingPatch(
        grid=track.grid, compliance=track.compliance, wheel=wheel, load=p.under(ellipse.force),
        **p.rubbing,
    )  # fmt: skip


HERTZ_PRESSURE = declare("hertz_pressure", "peak pressure p0 of the elastic Hertz contact", "MPa")
HERTZ_A = declare("hertz_a", "semi-axis along x of the elastic Hertz contact", "mm")
HERTZ_B = declare("hertz_b", "semi-axis along z of the elastic Hertz contact", "mm")
HERTZ_APPROACH = declare(
    "hertz_approach", "approach of the bodies in the elastic Hertz contact of half-spaces", "mm"
)
_ALONG, _ACROSS, _DOWN = 1.6, 2.0, 2.4
"""Half the length of maps over a, half their width over b, and their depth over
`RacewayParameters.below`."""
_PIXELS = 24
"""Number of positions of maps per semi-axis; in depth, per `RacewayParameters.below`."""


def method(parameters: RacewayParameters) -> Method:
    """Return the method of the passes."""
    return partial(by_rail_passes, prism=prism, load_on=load_on)


def view(parameters: RacewayParameters) -> View:
    """Return the positions of results, which depend on the ellipse and not on the mesh."""
    a, b = parameters.size
    below, wide = parameters.below, _ACROSS * b
    along, across = round(_ALONG * _PIXELS), round(_ACROSS * _PIXELS)
    down, step = round(_DOWN * _PIXELS), below / _PIXELS
    own, top, rise = geometry(parameters), np.zeros((2, 0)), 0
    if own.groove:
        radius, edge = own.groove
        s = np.linspace(-edge, edge, 2001)
        top = np.stack([s, s**2 / (radius + np.sqrt(radius**2 - s**2))])
        rise = math.ceil(radius * (1 - math.cos(own.half_width / radius)) / step)  # of the zone
    return View(
        x=np.linspace(-_ALONG * a, _ALONG * a, 2 * along + 1),
        y=np.linspace(-down * step, rise * step, down + rise + 1),
        z=np.linspace(-wide, wide, 2 * across + 1),
        depth=np.linspace(0.0, _DOWN * below, down + 1),
        station=b / 2 * np.array([-1.0, 0.0, 1.0]),
        s=np.zeros(0),
        profile_body="raceway",
        surfaces={"raceway": "running"},
        axis=ACROSS_TRACK,
        top=top,
    )


def sketch(parameters: RacewayParameters) -> Sketch:
    """Return the section of the raceway, and the ball or roller at first touch."""
    own, radius = geometry(parameters), parameters.across
    wide = own.block if own.groove is None else min(own.block, own.groove[1])
    z = min(0.95 * radius, wide) * np.linspace(-1.0, 1.0, 201)
    height = radius - np.sqrt(radius**2 - z**2)
    rolls = {"ball or roller": np.stack([z, height])}
    return sketched("raceway", section_of(own), parameters.material(), rolls)


def elastic(run: FinishedRun) -> Values:
    """Return the elastic Hertz contact, and the height of the ball or roller over first touch."""
    p: Any = run.parameters
    contact: Any = run.outcome.points[run.view.loaded].touching
    ellipse = p.ellipse
    return {
        HERTZ_PRESSURE: ellipse.peak_pressure,
        HERTZ_A: ellipse.a,
        HERTZ_B: ellipse.b,
        HERTZ_APPROACH: ellipse.approach,
        AXLE_HEIGHT: contact.height if p.load == "contact" else np.nan,
    }


def effort(parameters: RacewayParameters, passes: Sequence[float]) -> Effort:
    """Return the work of so many passes; the section is meshed for it."""

    def work(p: RacewayParameters) -> Effort:
        own = geometry(p)
        return own.effort(section_of(own), passes)

    return effort_of(work, parameters)


def advice(parameters: RacewayParameters) -> Advice:
    """Return what the user can do."""
    return remedies(parameters, parameters.ellipse.peak_pressure)
