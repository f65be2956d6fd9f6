"""A steady pass over a prism: a given ellipse on a block, and a wheel on a rail, free rolling.

The ellipse is that of the wheel on the rail of the thesis, p0 1 360 MPa, without hardening; the
wheel is S1002 on 60E1 with 150 kN, kinematic hardening. Each series changes one
thing of the base, elements and stations of 1 mm and a length of 64 mm with far field, and has
its own reference, finer in that thing.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator

from solver.linear.solvers import one_thread
from solver.materials import Material
from solver.model.friction import Coulomb
from solver.rolling.load import RollingLoad
from solver.rolling.passing import Pass, passing
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.wheel_profile import s1002
from solver.rolling.rail.profiles.zone import Zone, rail_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from tests.benchmarks.measure import Point, Timed, timed
from tests.verification.prism_blocks import (
    HARDENS,
    PERFECT,
    RE,
    ellipse,
    half_space_section,
    residual,
)

Array = NDArray[np.float64]
Found = tuple[PrismTrack, Pass[PrismState]]
LAWS: Mapping[str, Material] = {"ellipse": PERFECT, "wheel": HARDENS}
SERIES = ("section", "divided rows", "stations", "length", "length alone", "window")
MEASURES = {
    "largest": "largest error of residual stress from 1 mm down / Re",
    "mean": "root of the mean square error of residual stress / Re",
}
VALUES = ("lowest_x", "lowest_z", "strain", "setup")
"""Lowest residual sigma_x and sigma_z [MPa], largest plastic strain, CPU time of the set-up [s]."""
_Z, _Y = np.meshgrid(np.linspace(-5.0, 5.0, 21), -np.linspace(1.0, 8.0, 29))
"""Places of the section that are compared, across from the middle of the zone [mm]."""
_MIDDLE = {"ellipse": 0.0, "wheel": -2.0}


@dataclass(frozen=True, slots=True)
class Case:
    """A setting of a series: elements, stations, length, levels of far field, window [mm].

    ``split`` is the number of the uppermost rows of elements that are divided into two.
    """

    series: str
    setting: str
    h: float = 1.0
    spacing: float = 1.0
    length: float = 64.0
    levels: int = 4
    ahead: float = 20.0
    behind: float = 24.0
    split: int = 0
    size: float = float("nan")


def plan(quick: bool) -> Iterator[tuple[Case, tuple[Case, ...]]]:
    """Yield the reference of each series, and its cases."""
    if quick:
        cases = [
            Case("section", f"{h:.3g} mm", h=h, spacing=2.0, levels=0, size=h)
            for h in (10 / 3, 2.0)
        ]
        yield replace(cases[-1], h=10 / 7), tuple(cases)
        return
    yield Case("section", "", h=0.5), tuple(
        Case("section", f"{h:g} mm", h=h, size=h) for h in (2.0, 1.0)
    )  # fmt: skip
    yield Case("divided rows", "", h=0.5, split=6), tuple(
        Case("divided rows", f"{h:g} mm, {split}", h=h, split=split, size=h)
        for h, split in ((1.0, 0), (1.0, 3), (0.5, 0))
    )  # fmt: skip
    yield Case("stations", "", spacing=0.25), tuple(
        Case("stations", f"{d:g} mm", spacing=d, size=d) for d in (2.0, 1.0, 0.5)
    )  # fmt: skip
    longest = Case("length", "", length=256.0)
    for series, levels, lengths in (
        ("length", 4, (64.0, 128.0)), ("length alone", 0, (64.0, 128.0, 256.0)),
    ):  # fmt: skip
        yield longest, tuple(
            Case(series, f"{L:g} mm", length=L, levels=levels) for L in lengths
        )  # fmt: skip
    windows = ((20.0, 20.0), (20.0, 24.0), (28.0, 36.0))
    yield Case("window", "", length=128.0, ahead=40.0, behind=60.0), tuple(
        Case("window", f"{a:g} + {b:g} mm", length=128.0, ahead=a, behind=b)
        for a, b in windows
    )  # fmt: skip


def loads(quick: bool) -> tuple[str, ...]:
    """Return the loads that are measured."""
    return tuple(LAWS)[:1] if quick else tuple(LAWS)


def measure(quick: bool, repeats: int) -> list[Point]:
    """Return a point for every case and load; its CPU time is that of the pass alone."""
    points = []
    for load in loads(quick):
        exact: dict[Case, Array] = {}
        for reference, cases in plan(quick):
            if reference not in exact:
                exact[reference] = _stress(_Rolled(reference, load).pass_(), load)
            for case in cases:
                rolled = _Rolled(case, load)
                run = timed(lambda repeat, rolled=rolled: rolled.pass_(), repeats)
                points.append(_point(case, load, rolled, run, exact[reference]))
    return points


class _Rolled:
    """A prism set up for a case, with its CPU time, and its load."""

    def __init__(self, case: Case, load: str) -> None:
        started = time.process_time()
        self.law = LAWS[load]
        self.track = _block(case) if load == "ellipse" else _rail(case)
        self._load = ellipse(self.track, 1360.0) if load == "ellipse" else _wheel(self.track)
        self.setup = time.process_time() - started

    def pass_(self) -> Found:
        """Return the prism and its first pass."""
        with one_thread():
            virgin = self.track.virgin(self.law)
            return self.track, passing(self.track, self.law, self._load, virgin)


def _block(case: Case) -> PrismTrack:
    """Return a block with a zone of 20 by 14 mm."""
    section, zone = half_space_section(case.h, far=300.0, growth=1.4, split=case.split)
    return _track(case, section, zone, 10.0)


def _rail(case: Case) -> PrismTrack:
    """Return the rail with a zone of 28 by 12 mm under the contact."""
    half, depth, spring = 14.0, 12.0, 21.0 / 150.0
    zone = Zone(at=_MIDDLE["wheel"], half_width=half, depth=depth, size=case.h, split=case.split)
    section = Section(
        rail_mesh(rail_60e1().canted(1 / 40), zone), HARDENS.elasticity,
        springs={"foot": (spring, spring, spring)},
    )  # fmt: skip
    elements = zone.columns * zone.rows  # those of the zone come first
    return _track(case, section, np.arange(len(section.weights)) < elements, 9.0)


def _track(case: Case, section: Section, zone: NDArray[np.bool_], reach: float) -> PrismTrack:
    """Return the prism of a case."""
    return PrismTrack(
        section, zone, "running", length=case.length, spacing=case.spacing,
        ahead=case.ahead, behind=case.behind, reach=reach, levels=case.levels,
    )  # fmt: skip


def _wheel(track: PrismTrack) -> RollingPatch:
    """Return the wheel of the published test, rolling freely."""
    profile = s1002()
    wheel = ProfiledWheel(
        profile=lambda z: profile.height(z + 4.0), radius=460.0, elasticity=HARDENS.elasticity
    )
    return RollingPatch(
        grid=track.grid, compliance=track.compliance, wheel=wheel, friction=Coulomb(friction=0.17),
        load=RollingLoad(force=150e3, drive=0.0),
    )  # fmt: skip


def _stress(rolled: Found, load: str) -> Array:
    """Return the residual stress (n_places, 6) at the places that are compared, Mandel [MPa]."""
    track, found = rolled
    stress = residual(LAWS[load], found.after)
    at = LinearNDInterpolator(track.points.T, stress.T)
    return np.asarray(at(_Z.ravel() + _MIDDLE[load], _Y.ravel()))


def _point(case: Case, load: str, rolled: _Rolled, run: Timed[Found], exact: Array) -> Point:
    track, found = run.result
    off = (_stress(run.result, load) - exact) / RE
    stress = residual(rolled.law, found.after)
    return Point(
        problem="prism",
        series=case.series,
        setting=f"{case.setting}, {load}",
        size=case.size,
        unknowns=len(track.modes.unknowns) * track.modes.stations,
        cpu=run.cpu,
        spread=run.spread,
        repeats=run.repeats,
        values={
            "lowest_x": float(stress[0].min()),
            "lowest_z": float(stress[2].min()),
            "strain": float(found.after.accumulated.max()),
            "setup": rolled.setup,
        },
        errors={
            "largest": float(np.abs(off).max()),
            "mean": float(np.sqrt(np.mean(off**2))),
        },
    )
