"""A coarse block over which loads roll, as a prism."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from solver.materials import Material
from solver.materials.law import Law
from solver.mesh import grid, within
from solver.rolling.load import RollingLoad
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.initial_stress import SectionStress
from solver.rolling.scenes.wheel_rail_track import settled
from tests.verification.stepped_prism import SteppedEllipse

Array = NDArray[np.float64]
RE = 502.0
PERFECT = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=RE)
HARDENS = Material(
    youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=RE, hardening="kinematic",
    hardening_ratio=0.02,
)  # fmt: skip
"""Steel of the thesis: 4 000 MPa of kinematic hardening."""
AHEAD = 20.0
"""Where the window of the block begins, ahead of the load [mm]."""
A, B = 8.33, 6.27
"""Semi-axes of the ellipse of the wheel on the rail of the thesis [mm]."""


def lines(fine: float, h: float, far: float, growth: float) -> Array:
    """Positions from 0: sides h up to ``fine``, then growing up to ``far``."""
    at, side = list(np.linspace(0.0, fine, round(fine / h) + 1)), h
    while at[-1] < far:
        side = min(side * growth, far / 5)
        at.append(at[-1] + side)
    return np.array(at)


def divided(positions: Array, split: int) -> Array:
    """Positions of lines with another one in the middle of each of the first ``split`` elements."""
    return np.union1d(positions, (positions[1 : split + 1] + positions[:split]) / 2)


def half_space_section(
    h: float, far: float, growth: float, split: int = 0
) -> tuple[Section, NDArray[np.bool_]]:
    """A section as deep as half its width ``far``, held at its bottom, and its small elements.

    Elements of h in 20 by 14 mm, growing beside and below; ``split`` uppermost rows are divided.
    """
    half, down = (lines(fine, h, far, growth) for fine in (10.0, 14.0))
    down = divided(down, split)
    z, y = np.concatenate([-half[:0:-1], half]), -down[::-1]
    mesh = within(grid(z, y), "running", ["top"], x=(-10.001, 10.001))
    section = Section(mesh, PERFECT.elasticity, supports={"bottom": "xyz"})
    at = section.points.mean(axis=2)
    return section, (np.abs(at[0]) < 10) & (at[1] > -14.0)


@cache
def block(
    h: float = 2.0, length: float = 64.0, spacing: float | None = None, far: float = 75.0,
    growth: float = 1.4, levels: int = 0, zone_depth: float = 14.0,
    loads: int = 1,
) -> PrismTrack:  # fmt: skip
    """A block of `half_space_section`; stations ``spacing`` apart, h if None.

    Its small elements down to ``zone_depth`` may yield.
    """
    section, small = half_space_section(h, far, growth)
    zone = small & (section.points[1].mean(axis=1) > -zone_depth)
    return PrismTrack(
        section, zone, "running", length=length, spacing=spacing or h, ahead=AHEAD, behind=24.0,
        reach=10.0, levels=levels, loads=loads,
    )  # fmt: skip


def stressed(track: PrismTrack, of: SectionStress) -> PrismTrack:
    """A prism with a stress before the first pass, in equilibrium."""
    initial = settled(track.section, of, 0.0)
    assert initial is not None
    return track.stressed(initial)


def residual(law: Law, state: PrismState) -> Array:
    """Residual stress (6, n) at the points, Mandel [MPa]."""
    return law.stiffness(6) @ (state.strain - state.plastic_strain).T


def ellipse(track: PrismTrack, peak: float, **shear: tuple[float, float]) -> SteppedEllipse:
    """The pressure of the wheel on the rail of the thesis, of another peak [MPa]."""
    return SteppedEllipse(
        grid=track.grid, load=RollingLoad(force=2 * np.pi * A * B * peak / 3), a=A, b=B, **shear
    )


def crowned(middle: float = 0.0) -> ProfiledWheel:
    """A wheel of 460 mm with a crown of 300 mm."""
    return ProfiledWheel(
        profile=lambda z: (z - middle) ** 2 / 600.0, radius=460.0, elasticity=PERFECT.elasticity
    )
