"""The raceway of the raceway scene: a block, its zone and its window in shares of the ellipse.

Runs of the same geometry share what is set up for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from solver.errors import ModelError
from solver.loading.bearing import too_much_shear
from solver.materials import Elasticity
from solver.memory import kept
from solver.rolling.rail.given_patch import EllipticPatch
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_contact import PatchLoad
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.profiles.wheel_profile import crowned
from solver.rolling.rail.profiles.zone import Zone, raceway_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.raceway_parameters import BESIDE, RacewayParameters
from solver.rolling.scenes.rail_window import PrismWindow, split_rows, whole

_BLOCK = 32.0
"""Depth and half the width of the block over the longer semi-axis: stress in the zone is within
0.05 % of p0 of that in a half-space, as the mean; 16 makes 0.15 %, 64 makes 0.02 %."""
_DEPTH, _REACH = 1.8, 1.2
"""Depth of the zone over `RacewayParameters.below`, and half the length where the load may act over
a."""
_LEVELS = 2
"""Levels of the far field: the last one is 64 times 8 a long, and the block is held at its foot."""
_GROOVE, _STEEPEST = 1.6, math.radians(75.0)
"""Half the width of the groove along its arc over that of the zone, and the largest slope of its
sides [rad]: the shoulders beyond are flat."""


@dataclass(frozen=True, slots=True)
class RacewayGeometry:
    """All that the set-up of a raceway depends on; runs with equal geometry share it.

    Attributes
    ----------
    elasticity : Young's modulus and Poisson ratio
    block : its depth, and half its width [mm]
    groove : radius of the groove, and half its width [mm]; None for a flat block
    half_width, depth, size, layer, split : of the zone, see `Zone`
    spacing, reach : distance of stations; half the length where the load may act [mm]
    """

    elasticity: tuple[float, float]
    block: float
    groove: tuple[float, float] | None
    half_width: float
    depth: float
    size: float
    layer: float
    split: int
    spacing: float
    reach: float

    @property
    def zone(self) -> Zone:
        """Where elements are small."""
        return Zone(
            at=0.0, half_width=self.half_width, depth=self.depth, size=self.size,
            layer=self.layer, split=self.split,
        )  # fmt: skip

    @property
    def window(self) -> PrismWindow:
        """Where the raceway may yield."""
        zone = self.zone
        return PrismWindow(
            columns=zone.columns, elements=zone.elements, half_width=zone.half_width,
            spacing=self.spacing, reach=self.reach,
        )  # fmt: skip


def geometry(parameters: RacewayParameters, reach: float = 1.0) -> RacewayGeometry:
    """Return the geometry; ``reach`` is the ratio of zone and window to their usual size.

    Raises
    ------
    ModelError
        for the load, if the zone would reach the steep sides of the groove or of the ball or roller
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
        elasticity=(p.youngs_modulus, p.poisson_ratio),
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
    E, nu = own.elasticity
    return Section(
        raceway_mesh(2 * own.block, own.block, own.zone, own.groove),
        Elasticity(youngs_modulus=E, poisson_ratio=nu),
        supports={"foot": "xyz"},
    )


@kept
def track_of(own: RacewayGeometry) -> PrismTrack:
    """Return the raceway, set up once in a process for each geometry."""
    return own.window.track(section_of(own), _LEVELS)


class RolledRaceway:
    """A ball or roller on a raceway, as `solver.rolling.scenes.rail_passes.RolledPrism`."""

    def __init__(self, parameters: RacewayParameters) -> None:
        self.parameters = parameters
        self._made: tuple[PrismTrack, PatchLoad] | None = None

    def track(self, reach: float) -> PrismTrack:
        """See `RolledPrism`."""
        return track_of(geometry(self.parameters, reach))

    def load(self, track: PrismTrack, number: int) -> PatchLoad:
        """See `RolledPrism`; all passes have the same load.

        Raises
        ------
        LimitLoad
            if a prescribed shear is above the shear strength of the material
        """
        del number
        if self._made is None or self._made[0] is not track:
            self._made = track, self._load(track)
        return self._made[1]

    def _load(self, track: PrismTrack) -> PatchLoad:
        p, ellipse = self.parameters, self.parameters.ellipse
        if p.load == "hertz":
            shear = p.traction * p.friction
            limit = too_much_shear(p.material(), abs(shear) * ellipse.peak_pressure)
            if limit is not None:
                raise limit
            return EllipticPatch(
                grid=track.grid, force=ellipse.force, a=ellipse.a, b=ellipse.b, shear=(shear, 0.0)
            )
        wheel = ProfiledWheel(
            profile=crowned(p.across, p.across).height,
            radius=p.radius,
            elasticity=p.wheel_elasticity,
            track_radius=p.ring,
        )
        return RollingPatch(
            track.grid, track.compliance, wheel, force=ellipse.force, **p.motion
        )  # fmt: skip
