"""A steady pass over a prism is a fixed point of increments.

Increments are those of bricks, in which material stands still. They begin with the state of the
pass: at a point at x it is that of the station at x. The load moves on by the distance of stations;
then each point must have the state of the next station downstream. Outside the window plastic
strain is given, as the pass assumes it there.

What is left is the elements' share: elements of 1 mm, of the block that is twice as wide, leave 5 %
of the change after one increment without hardening and 4 % after two; elements of 2 mm with
stations of 2 mm 11 and 12 %. `test_prism_increments.py` has increments from nothing to the pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from solver.linear.solvers import one_thread
from solver.materials.law import Law
from solver.rolling.passing import Pass, passing
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.track import PrismTrack
from tests.verification.bricks import Bricks, BrickState
from tests.verification.prism_blocks import AHEAD, HARDENS, PERFECT, block, ellipse

pytestmark = pytest.mark.long

Array = NDArray[np.float64]
SPACING, INCREMENTS = 1.0, 2


@cache
def track() -> PrismTrack:
    """A coarse block with stations half an element apart: a brick of 2 mm has two of them."""
    return block(2.0, 48.0, spacing=SPACING, far=30.0, growth=2.0)


@cache
def bricks() -> Bricks:
    """Bricks on half of the section of the block; their points are at its points and stations."""
    z, y = (np.unique(each.round(9)) for each in track().section.plane.body.mesh.p)
    planes = AHEAD + SPACING * (0.5 - np.arange(0, track().modes.stations + 1, 2)[::-1])
    return Bricks(planes, y, z[z >= 0], PERFECT.elasticity)


def pressure(contact: PatchContact, x0: float) -> Callable[[Array, Array], Array]:
    """Return the pressure (x, z) of a load at x0: waves along x through samples, linear across."""
    grid, p = contact.grid, -contact.traction[..., 1]
    stations, n = x0 + grid.ahead - grid.spacing * np.arange(grid.stations), track().modes.stations

    def of(x: Array, z: Array) -> Array:
        apart = np.pi * (x[..., None] - stations) / grid.spacing
        with np.errstate(divide="ignore", invalid="ignore"):
            waves = np.sin(apart) / (n * np.tan(apart / n))
        waves[np.abs(np.sin(apart / n)) < 1e-12] = 1.0
        at = np.clip(np.searchsorted(grid.z, z) - 1, 0, len(grid.z) - 2)
        share = (z - grid.z[at]) / np.diff(grid.z)[at]
        first, second = ((waves * p.T[at + k]).sum(axis=-1) for k in (0, 1))
        return np.where(share <= 1, (1 - share) * first + share * second, 0.0)

    return of


@dataclass(frozen=True)
class Standing:
    """Material of a pass that stands still.

    ``row`` and ``station`` (n_points,) tell where the points of the bricks are in the pass, row -1
    outside the zone; ``flows`` are the numbers of the points that may flow.
    """

    found: Pass[PrismState]
    row: NDArray[np.int64]
    station: NDArray[np.int64]
    flows: NDArray[np.int64]

    def plastic_strain(self, moved: int) -> Array:
        """Return that of the pass (6, n_points) when the load is so many stations on."""
        window, modes = self.found.plastic_strain, track().modes
        beyond = modes.behind[:, None] * window[:, -1:]
        whole = np.concatenate([window, beyond], axis=1)
        at = (self.station + moved) % modes.stations
        return np.where(self.row >= 0, whole[self.row, at].T, 0.0)

    @property
    def start(self) -> BrickState:
        """The state of the points that may flow."""
        at = self.row[self.flows], self.station[self.flows]
        states = self.found.states
        return BrickState(states.unpacked(states.packed[:, *at]), self.found.strain[at].T)

    def force(self, moved: int) -> Array:
        """Return the nodal forces of the load when it is so many stations on."""
        contact = self.found.loading.contact  # type: ignore[attr-defined]
        return bricks().pressed(pressure(contact, moved * SPACING))

    def size(self, strain: Array) -> float:
        """Return 2 G strain at the points that may flow, root of the mean square [MPa]."""
        mean = np.average((strain**2).sum(axis=0), weights=bricks().weights[self.flows])
        return bricks().double_shear * float(np.sqrt(mean))


@cache
def standing(law: Law) -> Standing:
    """Return the first pass of the ellipse, by one increment from station to station."""
    with one_thread():
        load, before = ellipse(track(), 1240.0), track().virgin(law)
        found = passing(track(), law, load, before, parts=1, tolerance=1e-6)
    x, y, z = bricks().points
    apart, row = cKDTree(track().points.T).query(np.stack([z, y]).T)
    row[apart > 1e-6] = -1
    station = np.rint((AHEAD - x) / SPACING).astype(np.int64)
    assert np.abs(AHEAD - station * SPACING - x).max() < 1e-9
    assert 2 * (row >= 0).sum() == len(track().points.T) * track().modes.stations
    flows = np.flatnonzero((row >= 0) & (station < track().weights.shape[1] - INCREMENTS))
    return Standing(found, row, station, flows)


def test_bricks_with_the_plastic_strain_of_a_pass_have_its_strain() -> None:
    """The difference is 0.52 % on elements of 2 mm, 0.37 % on 1 mm."""
    own, body = standing(PERFECT), bricks()
    u = body.solve(own.force(0) + body.forces(body.double_shear * own.plastic_strain(0)))
    strain = own.start.strain
    assert own.size(body.strain(u)[:, own.flows] - strain) < 0.006 * own.size(strain)


@pytest.mark.parametrize(("law", "most"), [(PERFECT, 2.0), (HARDENS, 1.8)], ids=["perfect", "hard"])
def test_a_pass_is_a_fixed_point_of_increments(law: Law, most: float) -> None:
    """The first one changes 2 G ep by 25 and 22 MPa, two by 49 and 43."""
    own, body = standing(law), bricks()
    now, off = own.start, []
    with one_thread():
        for moved in range(1, INCREMENTS + 1):
            given = own.plastic_strain(moved) - own.plastic_strain(moved - 1)
            given[:, own.flows] = 0.0
            load = own.force(moved) - own.force(moved - 1)
            now = body.increment(law, now, own.flows, load, given)
            wanted = own.plastic_strain(moved)[:, own.flows]
            off.append(own.size(now.state.plastic_strain - wanted))
            change = own.size(wanted - own.start.state.plastic_strain)
            assert change > 19.0 * moved
    assert off[0] < most
    assert off[1] < 0.06 * change
