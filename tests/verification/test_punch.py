"""The elastic-plastic punch: what is published about it, and what a sequence of meshes says.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 5.1: half-width 50, both
bodies with yield stress Re = 350, mean pressure 200 (ratio 0.5714) in plane stress and 300
(0.8571) in plane strain. Our figures are those of elements of 1e-3 half-widths at the
corner and of a half-plane of 16 half-widths unless others are named.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from solver import SCENES, PathControl, Status, solve
from solver.fem.fields import Sampler
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model

PLATEAU = 1 / 0.5714
FRICTIONS = (0.0, 0.1, 0.2, 0.3, 0.4)
USUAL = {"smallest_element": 1e-3, "half_plane_size": 16.0, "unload_steps": 1}
"""Unloading in two increments leaves the same residual stress to 0.01 MPa."""


def solved(parameters):
    return solve(
        model(parameters),
        load=parameters.load_ratio,
        control=PathControl(
            load_step=parameters.load_step,
            unload_steps=parameters.unload_steps,
        ),
    )


def yielded(solution):
    """The largest plastic strain of each body."""
    return {
        body: float(solution.system.state(body, solution.unloaded).plastic.accumulated.max())
        for body in ("punch", "half_plane")
    }


def told(**fields):
    """Return parameters; half the increments would put ripple in what does not harden."""
    step = {} if fields.get("hardening", "none") == "none" else {"load_step": 0.1}
    return PunchParameters(**(USUAL | step | fields))


def press(**fields):
    """What is asked of a punch, solved once however it is told."""
    return pressed(told(**fields))


@cache
def pressed(parameters):
    """Solve a punch; distances from the corner are over the half-width, pressures over p0.

    What is asked of it is kept, not the solution: some thirty would take a gigabyte.
    """
    a, p0 = parameters.half_width, parameters.load_ratio * parameters.yield_stress
    solution = solved(parameters)
    acting = solution.contact()
    x, pressure = acting.X, acting.pressure
    order = np.argsort(-x[0])

    def residual_x(body, distance):
        """Residual sigma_x on the contact surface of a body at a distance from the corner."""
        at = np.array([[a * (1 - distance)], [0.0]])
        return float(Sampler(solution.system.full(body), at)(solution.stress(body))[0, 0])

    return SimpleNamespace(
        r=1 - x[0, order] / a,
        pressure=pressure[order] / p0,
        half_plane=residual_x("half_plane", 0.005),
        punch=residual_x("punch", 0.028),
        yielded=yielded(solution),
        below=solution.unloaded.responses[1].state,
        work=solution.tally.plastic_work,
    )


def strain_run(**fields):
    return press(state="plane_strain", load_ratio=0.8571, smallest_element=2e-3, **fields)


# -- plane stress, no hardening ----------------------------------------------------------------


def test_frictionless_pressure_in_the_plastic_zone_is_the_yield_stress():
    """1.75 p0 within 1 % at every vertex of the plastic zone; measured 1.7486 - 1.7518."""
    run = press(friction=0.0)
    zone = run.pressure[run.r < 0.03]
    assert len(zone) >= 8
    assert zone == pytest.approx(np.full_like(zone, PLATEAU), rel=0.01)


@pytest.mark.parametrize("state", ["plane_stress", "plane_strain"])
def test_half_plane_under_a_frictionless_punch_yields_nowhere(state):
    """Exactly: the punch's corner yields first and caps the pressure at the yield stress."""
    run = press(friction=0.0) if state == "plane_stress" else strain_run(friction=0.0)
    assert run.yielded["half_plane"] == 0.0
    assert run.yielded["punch"] > 1e-3
    assert not run.below.plastic_strain.any()
    # what is left of its stress is the residual of the last increment, 1e-8 of the force
    assert abs(run.half_plane) < 1e-3


def test_friction_raises_the_pressure_some_way_from_the_corner():
    """Maximum 1.78 - 1.90 p0 between 0.01 a and 0.1 a (published 1.85, ours 1.810 at 0.032 a)."""
    run = press(friction=0.4)
    belt = (run.r > 0.01) & (run.r < 0.1)
    assert 1.78 < run.pressure[belt].max() < 1.90
    peak = run.r[belt][run.pressure[belt].argmax()]
    assert 0.02 < peak < 0.06


@pytest.mark.parametrize("smallest", [4e-3, 2e-3, 1e-3])
def test_frictional_pressure_falls_back_towards_the_yield_stress_at_the_corner(smallest):
    """1.75 p0 within 3 %, the corner vertex itself excluded; measured 1.753 - 1.792."""
    run = press(friction=0.4, smallest_element=smallest)
    near = run.pressure[(run.r > 0) & (run.r < 0.01)]
    assert len(near) >= 2
    assert near == pytest.approx(np.full_like(near, PLATEAU), rel=0.03)


@pytest.mark.parametrize("friction", FRICTIONS)
def test_pressure_does_not_oscillate_from_point_to_point(friction):
    """Below 3 %; measured 1.7 % at friction 0.4, 0.05 % without.

    An oscillation is a pair of neighbours on opposite sides of the lines (over log r) through
    their own neighbours, as large as the smaller of the two; a kink, as where the plastic zone
    ends, bends one way. The corner vertex is left out.
    """
    run = press(friction=friction, smallest_element=2e-3)
    zone = (run.r > 0) & (run.r < 0.2)
    r, p = np.log(run.r[zone]), run.pressure[zone]
    line = p[:-2] + (p[2:] - p[:-2]) * (r[1:-1] - r[:-2]) / (r[2:] - r[:-2])
    off = p[1:-1] / line - 1
    pairs = np.where(off[1:] * off[:-1] < 0, np.minimum(abs(off[1:]), abs(off[:-1])), 0.0)
    assert len(pairs) >= 8
    assert pairs.max() < 0.03


def test_both_bodies_yield_under_friction():
    for friction in FRICTIONS[1:]:
        run = press(friction=friction, smallest_element=2e-3)
        assert min(run.yielded.values()) > 1e-3


# -- residual stress ---------------------------------------------------------------------------


def test_default_half_plane_under_no_friction_yields_in_a_few_points_of_ripple():
    """3e-5 in 3 points: where the pressure is Re the half-plane is at its limit, and 0.1 % of
    ripple in the pressure crosses it. None with growth 1.12, and none in smaller half-planes.
    """
    run = press(friction=0.0, smallest_element=5e-4, half_plane_size=40.0)
    strain = run.below.accumulated
    assert strain.max() < 1e-4
    assert (strain > 0).sum() < 10


@pytest.mark.parametrize("hardening", ["none", "isotropic"])
def test_residual_tension_in_the_half_plane_grows_with_friction(hardening):
    """sigma_x at 0.005 a, friction 0, 0.1 ... 0.4, without hardening and with isotropic:
    0, 187, 272, 351, 359 and 7, 144, 212, 263, 300 MPa. With hardening the pressure at a
    frictionless corner exceeds Re, and a spot of the half-plane yields.
    """
    values = [
        press(friction=f, hardening=hardening, smallest_element=2e-3).half_plane for f in FRICTIONS
    ]
    assert abs(values[0]) < (1e-3 if hardening == "none" else 15.0)
    assert (np.diff(values) > 5.0).all()


def test_residual_stress_of_the_punch_turns_to_compression_as_friction_grows():
    """sigma_x at 0.028 a, isotropic hardening, friction 0, 0.1 ... 0.4: 22, 24, -12, -56, -52 MPa.

    The figures stand: quad9 and tri6, half and double elements, a punch four times as high and
    increments five times as small move them by 3 MPa at most. Published is compression that
    grows with friction; ours is tension below friction 0.15 and levels off beyond 0.3. The
    place is the published one: compression along the contact is largest 0.03 a from the corner.
    """
    values = {
        f: press(friction=f, hardening="isotropic", smallest_element=2e-3).punch for f in FRICTIONS
    }
    assert 15 < values[0.0] < 30
    assert 15 < values[0.1] < 30
    assert -20 < values[0.2] < -5
    assert values[0.3] == pytest.approx(-53, abs=5)
    assert values[0.4] == pytest.approx(-51, abs=5)


def test_hardening_lowers_the_residual_tension_of_the_half_plane():
    """At friction 0.4: 359 MPa without, 300 with isotropic, 263 with kinematic hardening."""
    by_law = [
        press(friction=0.4, hardening=h, smallest_element=2e-3).half_plane
        for h in ("none", "isotropic", "kinematic")
    ]
    assert by_law[1] < 0.9 * by_law[0]
    assert by_law[2] < by_law[1]


def test_residual_compression_of_the_punch_is_larger_in_plane_strain():
    stress = press(friction=0.4, smallest_element=2e-3)
    strain = strain_run(friction=0.4)
    assert strain.punch < 5 * stress.punch < 0
    hardening = press(friction=0.4, hardening="isotropic", smallest_element=2e-3)
    assert strain_run(friction=0.4, hardening="isotropic").punch < hardening.punch < 0


# -- hardening and plane strain ----------------------------------------------------------------


def test_hardening_with_friction_makes_the_pressure_climb_to_the_corner():
    """Without friction it stays finite: 1.88 against 2.73 p0 a thousandth of a from the corner."""
    free, rough = (press(friction=f, hardening="isotropic") for f in (0.0, 0.4))
    near = (rough.r > 0) & (rough.r < 0.03)
    assert (np.diff(rough.pressure[near]) < 0).all()
    assert rough.pressure[near][0] > 1.4 * rough.pressure[near][-1]
    assert free.pressure[near][0] < 1.1 * free.pressure[near][-1]
    assert rough.pressure[0] > 2 * free.pressure[0]


@pytest.mark.parametrize("hardening", ["none", "isotropic"])
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_plane_strain_pressure_is_finite(friction, hardening):
    """It stops growing when elements are halved: by 5 % at most at the same place."""
    coarse = press(
        state="plane_strain",
        load_ratio=0.8571,
        smallest_element=4e-3,
        friction=friction,
        hardening=hardening,
    )
    fine = strain_run(friction=friction, hardening=hardening)
    at = np.geomspace(0.008, 0.5, 20)
    values = [np.interp(np.log(at), np.log(c.r[1:]), c.pressure[1:]) for c in (coarse, fine)]
    assert values[1] == pytest.approx(values[0], rel=0.05)
    assert fine.pressure[1:].max() < 2.5


# -- a sequence of meshes, and the record ------------------------------------------------------


def test_accuracy_measures_settle_under_refinement():
    """Smallest element 4e-3, 2e-3, 1e-3 a; isotropic hardening, friction 0.4.

    ============  ======  ======  ======
    half-plane     305.4   300.3   304.4  MPa at 0.005 a (304.2 with 5e-4)
    punch          -52.7   -52.2   -51.2  MPa at 0.028 a (-50.9 with 5e-4)
    plastic work   10.68   10.69   10.69  N mm / mm
    ============  ======  ======  ======
    """
    runs = [
        press(friction=0.4, hardening="isotropic", smallest_element=h) for h in (4e-3, 2e-3, 1e-3)
    ]
    for name, spread in (("half_plane", 0.04), ("punch", 0.04), ("work", 0.003)):
        values = np.array([getattr(run, name) for run in runs])
        assert np.ptp(values) < spread * np.abs(values).max()


def test_without_hardening_friction_the_corner_strain_grows_but_the_work_settles():
    """Friction 0.4, no hardening: strain 0.18, 0.38, 0.76; work 12.57, 12.69, 12.72 N mm / mm.

    The strain of a perfectly plastic corner has no limit under refinement; residual sigma_x at
    0.005 a is at the yield stress (365, 359, 357, and 350 with 5e-4, recovered at the surface).
    """
    runs = [press(friction=0.4, smallest_element=h) for h in (4e-3, 2e-3, 1e-3)]
    strains = [run.yielded["half_plane"] for run in runs]
    assert strains[2] > 1.5 * strains[1] > 2 * strains[0]
    works = [run.work for run in runs]
    assert abs(works[2] - works[1]) < abs(works[1] - works[0])
    assert works[2] == pytest.approx(works[1], rel=5e-3)
    tension = [run.half_plane for run in runs]
    assert np.ptp(tension) < 0.1 * max(tension)


def test_the_finite_half_plane_costs_an_error_that_falls_with_its_size():
    """Plastic work 7.72, 9.68, 10.68 in half-planes of 4, 8, 16 a (11.30 at 40, 11.50 at 80).

    What is missing halves when the size doubles, however the far sides are held: the force is
    carried by a finite width, whose mean strain adds to the friction. The default 40 a lacks
    2 % of the work, and less than 1 % of the residual tension.
    """
    works = [
        press(friction=0.4, hardening="isotropic", smallest_element=4e-3, half_plane_size=size).work
        for size in (4.0, 8.0, 16.0)
    ]
    first, second = np.diff(works)
    assert 0.35 < second / first < 0.7


def test_strain_settles_away_from_the_corner_and_not_at_it():
    """From elements of 0.002 a to half of these; the corner reaches over 0.005 a.

    It goes from 0.0407 to 0.0382: strain falls as 1/r there, and the first points beyond the radius
    lie by a part of an element farther or nearer.
    """
    load = {"load_ratio": 0.8571, "friction": 0.4, "hardening": "isotropic"}
    runs = [solved(told(**load, smallest_element=element)) for element in (2e-3, 1e-3)]
    away = [run.audit().figures["audit_plastic_strain"] for run in runs]
    assert away[1] == pytest.approx(away[0], rel=0.1)
    coarse, fine = (max(yielded(run).values()) for run in runs)
    assert fine > 1.2 * coarse
    assert away[1] < 0.1 < fine


def test_the_scene_records_what_the_solution_holds():
    parameters = told(friction=0.4, hardening="isotropic", smallest_element=4e-3)
    (record,) = SCENES["punch"].path(parameters, [0.5714], lambda share: None)
    run = pressed(parameters)
    assert record.status is Status.OK
    assert record.scalars["residual_x_half_plane"] == pytest.approx(run.half_plane, rel=1e-6)
    assert record.scalars["residual_x_punch"] == pytest.approx(run.punch, rel=1e-6)
    assert record.scalars["plastic_work"] == pytest.approx(run.work, rel=1e-9)
    s = 1 - record.coordinates["s"] / 50.0
    dims, pressure = record.fields["contact_pressure"]
    assert dims == ("stage", "s")
    centre = np.interp(0.5, run.r, run.pressure) * 0.5714 * 350
    assert np.interp(0.5, s[::-1], pressure[0, ::-1]) == pytest.approx(centre, rel=0.01)
    assert not np.nan_to_num(pressure[1]).any()
