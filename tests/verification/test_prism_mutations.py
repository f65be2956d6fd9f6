"""Each of the faults is noticed that are put on purpose into passes over a prism."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.audit.report import Audit
from solver.linear.solvers import one_thread
from solver.materials import Material
from solver.mesh import grid, within
from solver.model.friction import BoundLines
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.audit.rail import audit_prism
from solver.rolling.passing import passing
from solver.rolling.rail import far_field as far_fields
from solver.rolling.rail import flow as flows
from solver.rolling.rail import patch as patches
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.modes import Modes
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from tests.verification.test_prism_passes import HARDENS, PERFECT, block, ellipse, lines, wheel

Array = NDArray[np.float64]
Patch = pytest.MonkeyPatch
Fault = Callable[[Patch], None]


def built(length: float = 64.0, levels: int = 3) -> PrismTrack:
    """A block 150 mm wide and 75 deep on springs, endless; elements of 2 mm in 20 by 14 mm."""
    half = lines(10.0, 2.0, 75.0, 2.0)
    z, y = np.concatenate([-half[:0:-1], half]), -lines(14.0, 2.0, 75.0, 2.0)[::-1]
    section = Section(
        within(grid(z, y), "running", ["top"], x=(-10.001, 10.001)), PERFECT.elasticity,
        springs={"bottom": (20.0, 20.0, 20.0)},
    )  # fmt: skip
    at = section.points.mean(axis=2)
    return PrismTrack(
        section, (np.abs(at[0]) < 10) & (at[1] > -14), "running",
        length=length, spacing=2.0, ahead=20.0, behind=24.0, reach=10.0, levels=levels,
    )  # fmt: skip


sprung = cache(built)


def audits(track: PrismTrack, law: Material = HARDENS, count: int = 1) -> list[Audit]:
    """Audits of passes of a braked wheel."""
    state, guess, plain = track.virgin(law), None, PlainPrism(track)
    load: Any = wheel(track, 0.3, 0.75)
    left: PrismState | None = None
    found = []
    with one_thread():
        for _ in range(count):
            given = passing(track, law, load, state, guess)
            found.append(audit_prism(track, law, given, left, plain))
            left, state, guess = given.left, given.after, given.strain
    return found


def test_without_a_fault_passes_of_a_wheel_pass() -> None:
    for each in audits(sprung(), count=2):
        assert each.passed, each.violations
        assert each.figures["audit_residual"] < 1e-9
        assert each.figures["audit_overlap"] < 1e-9
        assert not each.outside


def test_a_given_pressure_passes_where_it_begins_with_the_state_of_the_pass_before() -> None:
    track = block()
    with one_thread():
        found = passing(track, PERFECT, ellipse(track, 1360.0), track.virgin(PERFECT))
    each = audit_prism(track, PERFECT, found, None)
    assert each.passed, each.violations
    assert "audit_slip" not in each.figures
    (told,) = audit_prism(track, PERFECT, found, found.left).violations
    assert told.startswith("audit_history")
    assert not each.outside
    state = found.after.state

    def left(**changed: Any) -> tuple[str, ...]:
        after = replace(found.after, state=replace(state, **changed))
        return audit_prism(track, PERFECT, replace(found, after=after), None).outside

    assert not left(accumulated=state.accumulated + 0.2), "of many passes, to and fro"
    (outside,) = left(plastic_strain=100 * state.plastic_strain)
    assert outside.startswith("equivalent plastic strain reaches ")


# -- faults ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """A fault, the figures it breaks (one of them), and whether the track is built with it."""

    fault: Fault
    breaks: tuple[str, ...]
    of_track: bool = False
    count: int = 1


def after_init(kind: type, change: Callable[[Any], None]) -> Fault:
    """The fault that an object is changed as soon as it is made."""
    begin = kind.__init__  # type: ignore[misc]

    def changed(self: Any, *args: Any, **options: Any) -> None:
        begin(self, *args, **options)
        change(self)

    return lambda patch: patch.setattr(kind, "__init__", changed)


def other_sign(section: Section) -> None:
    section.B1[:, :, 5] *= -1.0


def heavier_point(section: Section) -> None:
    section.weights = section.weights * [1.01, 1.0, 1.0, 1.0]


def no_far_field(patch: Patch) -> None:
    own = PrismTrack.strain

    def without(self: PrismTrack, field: Any) -> Any:
        far, self.far = self.far, None
        try:
            return own(self, field)
        finally:
            self.far = far

    patch.setattr(PrismTrack, "strain", without)


def no_release(patch: Patch) -> None:
    def left(self: Any) -> Any:
        return self.states, self._last(self._begin.displacement)

    patch.setattr(flows.PrismFlow, "left", left)


def no_tail(modes: Modes) -> None:
    modes._into_behind = modes._into


def slip_of_the_next_station(patch: Patch) -> None:
    own = patches.RollingPatch._kernel

    def shifted(apart: Any) -> Any:
        kernel = own(apart)
        kernel[:, :, [0, 2]] = np.roll(kernel[:, :, [0, 2]], -1, axis=0)
        return kernel

    patch.setattr(patches.RollingPatch, "_kernel", staticmethod(shifted))


def profile_not_moved(patch: Patch) -> None:
    own = RollingPatch.on

    def on(self: RollingPatch, u: Any, before: Any, start: Any = None) -> Any:
        return own(self, u, replace(before, displacement=0.0 * before.displacement), start)

    patch.setattr(RollingPatch, "on", on)


def more_friction(patch: Patch) -> None:
    own = RollingPatch._problem

    def problem(self: RollingPatch, u: Any) -> Any:
        found = own(self, u)
        return replace(found, lines=BoundLines(*(1.02 * of for of in found.lines)))

    patch.setattr(RollingPatch, "_problem", problem)


def more_force(patch: Patch) -> None:
    own = RollingPatch._problem

    def problem(self: RollingPatch, u: Any) -> Any:
        found = own(self, u)
        return replace(found, resultants=1.001 * found.resultants)

    patch.setattr(RollingPatch, "_problem", problem)


def plastic_strain_of_the_station_before(patch: Patch) -> None:
    own = flows.PrismFlow.along

    def shifted(force: Array) -> Array:
        return np.concatenate([force[:, :1], force[:, :-1]], axis=1)

    def change(flow: Any) -> None:
        flow.force = shifted(flow.force)

    after_init(flows.PrismFlow, change)(patch)
    patch.setattr(flows.PrismFlow, "along", lambda self, added: shifted(own(self, added)))


def lost_wave(patch: Patch) -> None:
    own = Modes.solved

    def solved(self: Modes, nodal: Any) -> Any:
        u = own(self, nodal)
        u[3] = 0.0
        return u

    patch.setattr(Modes, "solved", solved)


def softer_springs(patch: Patch) -> None:
    own = Section._add_springs

    def add(self: Section, K0: Any, boundary: str, along: Any) -> None:
        own(self, K0, boundary, 0.99 * along)

    patch.setattr(Section, "_add_springs", add)


def harder_material(patch: Patch) -> None:
    own = PrismTrack.flow

    def flow(self: PrismTrack, law: Any, *args: Any) -> Any:
        return own(self, replace(law, hardening_ratio=1.1 * law.hardening_ratio), *args)

    patch.setattr(PrismTrack, "flow", flow)


MUTATIONS = {
    "the sign of zx in B1": Mutation(
        fault=after_init(Section, other_sign), breaks=("residual",), of_track=True
    ),
    "the far field left out": Mutation(fault=no_far_field, breaks=("steadiness",)),
    "the release left out": Mutation(fault=no_release, breaks=("steadiness",)),
    "the tail left out": Mutation(
        fault=after_init(Modes, no_tail), breaks=("steadiness",), of_track=True
    ),
    "slip of the next station": Mutation(fault=slip_of_the_next_station, breaks=("slip",)),
    "the profile not moved": Mutation(fault=profile_not_moved, breaks=("overlap",), count=2),
    "friction": Mutation(fault=more_friction, breaks=("friction_excess",)),
    "force": Mutation(fault=more_force, breaks=("reactions",)),
    "plastic strain of the station before": Mutation(
        fault=plastic_strain_of_the_station_before, breaks=("steadiness",)
    ),
    "the weight of a point": Mutation(
        fault=after_init(Section, heavier_point), breaks=("residual",), of_track=True
    ),
    "a wave lost": Mutation(fault=lost_wave, breaks=("residual",)),
    "softer springs": Mutation(fault=softer_springs, breaks=("residual",), of_track=True),
    "a harder material": Mutation(fault=harder_material, breaks=("law",)),
}  # fmt: skip


@pytest.mark.parametrize("mutation", MUTATIONS.values(), ids=MUTATIONS)
def test_a_fault_is_noticed(mutation: Mutation, monkeypatch: Patch) -> None:
    track = sprung()
    mutation.fault(monkeypatch)
    found = audits(built() if mutation.of_track else track, count=mutation.count)[-1]
    names = {each.split(" = ")[0].removeprefix("audit_") for each in found.violations}
    assert names & set(mutation.breaks), found.violations


# -- faults that the audit of a pass cannot see ---------------------------------------------------


def elastic_stress(track: PrismTrack) -> Array:
    """Stress (n_points, window, 6) by the pressure alone [MPa]."""
    with one_thread():
        strain = track.strain(ellipse(track, 1360.0).on(track.at_rest, track.virgin(HARDENS)).u)
    return np.asarray(strain @ HARDENS.stiffness(6))


def test_a_wrong_far_field_changes_with_the_length(monkeypatch: Patch) -> None:
    """The audit takes the far field from the track: to solve it anew costs as much as the track."""
    endless = elastic_stress(built(96.0))
    level = 0.002 * np.abs(endless).max()
    assert np.abs(elastic_stress(sprung()) - endless).max() < level
    own = far_fields._shares

    def less(*args: Any) -> Any:
        return {wave: 0.8 * share for wave, share in own(*args).items()}

    monkeypatch.setattr(far_fields, "_shares", less)
    assert np.abs(elastic_stress(built()) - endless).max() > 2 * level


def test_a_far_field_that_ends_too_early_is_told() -> None:
    (found,) = audits(built(levels=1))
    assert [each.split(" = ")[0] for each in found.violations] == ["audit_length"]
