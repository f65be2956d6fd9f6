"""A ball or roller on a raceway: against Hertz, by scale and direction, and its shakedown."""

from __future__ import annotations

import re
from functools import cache
from math import sqrt
from typing import Any, Literal

import numpy as np
import pytest

from solver import ModelError, Record
from solver.linear.solvers import one_thread
from solver.results.record import Status
from solver.results.shakedown import QUIET, ShakedownState
from solver.rolling.load import RollingLoad
from solver.rolling.passing import passing
from solver.rolling.rail.patch_contact import EllipticPatch
from solver.rolling.scenes.raceway import MOST_LONG, HertzEllipse, RacewayParameters
from solver.rolling.scenes.raceway_setup import geometry, load_on, prism, track_of, view
from solver.rolling.scenes.rail_passes import RailPasses
from solver.shipped import SCENES
from tests.records import kept
from tests.verification import closed_forms

SCENE = SCENES["raceway"]
LONG = 28.4275
"""Crown radius with which 10 mm along make a contact twice as wide as long [mm]."""


P0 = 3000.0
"""Peak pressure of all runs, so that they share a mesh [MPa]."""


@cache
def rolled(passes: int = 1, load_ratio: float = 2.5, **given: Any) -> Record:
    """The record of a ball of 10 mm on a flat raceway, at draft accuracy."""
    parameters = SCENE.parameters(**ball(load_ratio) | given)
    (record,) = SCENE.path(parameters, [passes], lambda share: None)
    return kept(record)


def ball(load_ratio: float = 2.5) -> dict[str, Any]:
    """Its parameters."""
    yields = {"load_ratio": load_ratio, "yield_stress": P0 / load_ratio}
    return {"accuracy": "draft", "friction": 0.0, **yields}


# -- Hertz's ellipse -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "radii", [(10.0, 10.0), (10.0, 30.0), (30.0, 10.0), (4.0, 100.0), (4.0, 9000.0)]
)
def test_the_ellipse_of_radii_is_hertzs(radii: tuple[float, float]) -> None:
    """The closed form goes the other way: from semi-axes to radii."""
    found = HertzEllipse.of(radii, 1.1e5, peak_pressure=3e3)
    exact = closed_forms.HertzEllipse(a=found.a, b=found.b, peak_pressure=3e3, modulus=1.1e5)
    assert exact.radii == pytest.approx(radii, rel=1e-9)
    assert found.approach == pytest.approx(exact.approach, rel=1e-9)
    assert found.force == pytest.approx(exact.force, rel=1e-12)
    again = HertzEllipse.of(radii, 1.1e5, force=found.force)
    assert again.peak_pressure == pytest.approx(3e3, rel=1e-9)


# -- elastic contact -----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [{}, {"crown_radius": LONG}, {"groove_radius": 14.0}])
def test_an_elastic_contact_is_hertzs(shape: dict[str, float]) -> None:
    """Four elements per semi-axis: they tell area and edge to a vertex."""
    numbers = rolled(load_ratio=1.5, **shape).scalars
    assert numbers["max_plastic_strain"] == 0.0
    assert numbers["hertz_pressure"] == pytest.approx(P0)
    assert numbers["peak_patch_pressure"] == pytest.approx(numbers["hertz_pressure"], rel=0.01)
    a, b = numbers["hertz_a"], numbers["hertz_b"]
    assert numbers["patch_area"] == pytest.approx(np.pi * a * b, rel=0.08)
    assert numbers["patch_right"] == pytest.approx(b, abs=0.26 * b)
    assert -numbers["axle_height"] == pytest.approx(numbers["hertz_approach"], rel=0.015)


BEARING: Any = {"radius": 5.95, "ring_radius": 24.05, "groove_radius": "conformity"}
"""Ball and inner ring of a deep groove ball bearing of 40 mm bore."""


@pytest.mark.parametrize(
    ("ratio", "shape"),
    [
        # pressed lightly: where the contact is wide, the curved ball leaves Hertz's parabola
        (13.9, BEARING | {"conformity": 0.51, "load_ratio": 0.4, "yield_stress": 1500.0}),
        (23.4, {"crown_radius": 1545.0}),
        (23.4, {"radius": 1545.0, "crown_radius": 10.0}),
    ],
)
def test_a_contact_that_is_nearly_a_line_is_hertzs(ratio: float, shape: dict[str, Any]) -> None:
    """Far from round the half axes follow from the second moments of pressure, a^2 / 5 and b^2 / 5.

    The pressure lies on four vertices a semi-axis, as that of the circle above.
    """
    record = rolled(**{"load_ratio": 1.5} | shape)
    assert record.status is Status.OK, record.message
    parameters: Any = record.parameters
    exact, numbers = parameters.ellipse, record.scalars
    assert exact.ratio == pytest.approx(ratio, abs=0.1)
    assert numbers["peak_patch_pressure"] == pytest.approx(exact.peak_pressure, rel=6e-3)
    assert -numbers["axle_height"] == pytest.approx(exact.approach, rel=0.01)
    assert numbers["patch_area"] == pytest.approx(np.pi * exact.a * exact.b, rel=0.08)
    pressure = record.fields["patch_pressure"][1]
    pressure = pressure[-1] if pressure.ndim == 3 else pressure
    for axis, own, half in (("x", 0, exact.a), ("z", 1, exact.b)):
        at, along = record.coordinates[axis], pressure.sum(axis=1 - own)
        assert 5 * (along @ at**2) / along.sum() == pytest.approx(half**2, rel=0.05), axis
    depth = np.linspace(0.5, 0.9, 81) * min(exact.a, exact.b)
    none = np.full(depth.shape, 1e-9 * exact.a)
    hertz = closed_forms.HertzEllipse(a=exact.a, b=exact.b, peak_pressure=exact.peak_pressure)
    stress = hertz.stress(none, depth, none, 0.3)
    deviator = stress - np.array([1, 1, 1, 0, 0, 0])[:, None] * stress[:3].mean(axis=0)
    mises = np.sqrt(1.5 * (deviator**2).sum(axis=0))
    assert numbers["highest_mises"] == pytest.approx(mises.max(), rel=0.02)
    assert numbers["highest_mises_depth"] == pytest.approx(depth[mises.argmax()], rel=0.15)


def test_the_largest_stress_under_a_ball_is_where_it_should_be() -> None:
    """K.L. Johnson (1985), section 4.2: 0.62 p0 in a depth of 0.48 a, nu = 0.3."""
    numbers = rolled(load_ratio=1.5).scalars
    assert numbers["highest_mises"] == pytest.approx(0.62 * numbers["hertz_pressure"], rel=0.025)
    assert numbers["highest_mises_depth"] == pytest.approx(0.48 * numbers["hertz_a"], rel=0.15)


# -- passes --------------------------------------------------------------------------------------


def test_force_and_pressure_give_the_same_ellipse() -> None:
    one = RacewayParameters()
    other = RacewayParameters(load_by="force", force=one.ellipse.force, load_ratio=9.0)
    for name in ("peak_pressure", "a", "b", "approach"):
        exact = getattr(one.ellipse, name)
        assert getattr(other.ellipse, name) == pytest.approx(exact, rel=1e-9), name


def test_a_raceway_of_another_size_strains_alike() -> None:
    """A pass is solved to 1e-4 of the yield stress; rounding decides how far below that it is."""
    small, large = rolled(load="hertz"), rolled(load="hertz", radius=1000.0)
    assert large.scalars["hertz_a"] == pytest.approx(100 * small.scalars["hertz_a"], rel=1e-9)
    strain = small.scalars["max_plastic_strain"]
    assert strain > 0.005
    assert large.scalars["max_plastic_strain"] == pytest.approx(strain, rel=2e-3)


@pytest.mark.parametrize("radius", [2.523, 7.1, 33.0])
def test_zone_and_window_do_not_depend_on_the_unit_of_length(radius: float) -> None:
    each = (
        geometry(RacewayParameters(radius=radius * unit, accuracy="draft"))
        for unit in (1.0, 10.0, 100.0, 1e3)
    )
    sizes = {(own.zone.columns, own.elements, own.stations(2.2), own.waves) for own in each}
    assert len(sizes) == 1


@pytest.mark.parametrize(
    ("accuracy", "given", "split"),
    [
        ("standard", {}, 3),
        ("fine", {}, 4),
        ("draft", {}, 0),
        ("standard", {"hardening": "kinematic", "hardening_ratio": 0.005}, 3),
        ("standard", {"hardening": "kinematic", "hardening_ratio": 0.05}, 0),
    ],
)
def test_rows_are_divided_where_hardening_is_weak(
    accuracy: Literal["draft", "standard", "fine"], given: dict[str, Any], split: int
) -> None:
    own = geometry(SCENE.parameters(accuracy=accuracy, load_by="force", **given))
    assert own.zone.split == split
    assert own.zone.rows == round(own.depth / own.layer) + split  # the estimate's


def test_the_scene_is_a_pass_of_the_given_ellipse() -> None:
    given = {"friction": 0.2, "traction": 0.5}
    record = rolled(load="hertz", **given)
    p = SCENE.parameters(**ball() | given, load="hertz")
    track, law, hertz = track_of(geometry(p)), p.material(), p.ellipse
    load = EllipticPatch(
        grid=track.grid, load=RollingLoad(force=hertz.force), a=hertz.a, b=hertz.b, shear=(0.1, 0)
    )
    with one_thread():
        found = passing(track, law, load, track.virgin(law))
    strain = float(found.after.accumulated.max())
    depth = -float(track.points[1, found.after.accumulated.argmax()])
    assert record.scalars["max_plastic_strain"] == strain > 0.005
    assert record.scalars["depth_of_max_plastic_strain"] == pytest.approx(depth, rel=1e-9)
    assert record.scalars["longitudinal_force"] == pytest.approx(0.1 * hertz.force, rel=1e-9)


@pytest.mark.parametrize("load", ["hertz", "contact"])
def test_all_passes_have_one_load_so_that_each_begins_with_the_strain_of_the_last(
    load: Literal["hertz", "contact"],
) -> None:
    parameters = SCENE.parameters(accuracy="draft", load=load, passes=2)
    passes = RailPasses(prism, load_on, parameters, view(parameters), 1.0)
    assert passes.load(0) is passes.load(1)


def test_a_locked_ball_slips_everywhere_and_drags_the_raceway() -> None:
    """Where it does not yield, its shear is that of the prescribed ellipse."""
    given = {"load_ratio": 1.2, "friction": 0.2, "traction": 1.0}
    locked, hertz = (rolled(load=load, **given).scalars for load in ("contact", "hertz"))
    for each in (locked, hertz):
        assert each["longitudinal_force"] == pytest.approx(
            0.2 * rolled(load_ratio=1.2).parameters.ellipse.force, rel=1e-6
        )
    slip = rolled(load="contact", **given).fields["patch_slip_x"][1]
    assert np.nanmedian(slip) == pytest.approx(-1.0, abs=0.02)
    assert locked["highest_mises"] == pytest.approx(hertz["highest_mises"], rel=0.03)


@pytest.mark.parametrize(("load_ratio", "yields"), [(1.59, False), (1.64, True)])
def test_it_yields_where_hertz_says(load_ratio: float, yields: bool) -> None:
    """First yield at p0 = Re / 0.62 = 1.613 Re; with these elements it is 1.612."""
    state = rolled(load="hertz", load_ratio=load_ratio).scalars["shakedown_state"]
    assert (state != ShakedownState.ELASTIC) == yields


def test_a_ball_shakes_down_below_the_published_limit_only() -> None:
    """4.675 k: A.R.S. Ponter, A.D. Hearle, K.L. Johnson (1985). With these elements it is 4.97."""
    below, above = (
        rolled(n, load="hertz", load_ratio=r / sqrt(3)) for n, r in ((8, 4.4), (3, 5.6))
    )
    assert below.status is Status.OK, below.message
    assert below.scalars["shakedown_state"] == ShakedownState.ELASTIC_SHAKEDOWN
    added = [
        each.fields["pass_plastic_increment"][1][-1] / (each.parameters.yield_stress / 2e5)
        for each in (below, above)
    ]
    assert added[0] <= QUIET
    assert added[1] > 1.0


def test_a_prescribed_shear_above_the_shear_yield_stress_is_refused() -> None:
    record = rolled(load="hertz", friction=0.3, traction=1.0, load_ratio=3.4 / sqrt(3))
    assert record.status is Status.LIMIT_LOAD
    assert "is above the shear yield stress" in record.message


def test_a_shear_that_hardening_carries_only_far_beyond_small_strains_is_refused() -> None:
    shear = {"load": "hertz", "friction": 0.3, "traction": 1.0, "load_ratio": 3.4 / sqrt(3)}
    record = rolled(**shear, hardening="isotropic", hardening_ratio=1e-6)
    assert record.status is Status.NOT_CONVERGED
    assert "carries at a plastic strain of 100%" in record.message


def test_the_limit_without_friction_is_that_of_the_alternating_shear() -> None:
    """Residual stress cannot change the range of shear xy, which is symmetric about x = 0."""
    x, depth = (each.ravel() for each in np.meshgrid(np.linspace(0.7, 1.0, 13), [0.3, 0.35, 0.4]))
    circle = closed_forms.HertzEllipse(a=1.0, b=1.0, peak_pressure=1.0)
    shear = circle.stress(x, depth, np.full(x.shape, 1e-9), 0.3)[3] / sqrt(2)
    assert 1 / np.abs(shear).max() == pytest.approx(4.675, abs=0.003)


# -- parameters ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"groove_radius": 9.0}, r"groove_radius = 9\.0: must be greater than 10, the radius"),
        (
            {"groove_radius": 10.01},
            r"groove_radius = 10\.01: must be at least 10\.05\d+: .* ratio of 67",
        ),
        ({"crown_radius": 2e3}, r"crown_radius = 2000\.0: must be at most 1727\.\d: .* ratio of 2"),
        ({"crown_radius": 0.01}, r"crown_radius = 0\.01: must be at least 0\.05\d+: .* ratio of 6"),
        (
            BEARING | {"conformity": 0.501},
            r"conformity = 0\.501: must be at least 0\.5036\d+: .* 52",
        ),
        (
            {"radius": 1e4, "crown_radius": 10.0, "groove_radius": 20.0},
            r"groove_radius = 20\.0: must be at most 12\.08\d+: ",
        ),
        ({"ring_radius": -9.0}, r"ring_radius = -9\.0: must be positive, or below -10"),
        ({"ring_radius": 0.0}, r"ring_radius = 0\.0: must be positive, or below -10"),
        (
            {"load_ratio": 9.0, "yield_stress": 5e3},
            r"load_ratio = 9\.0: must be at most \d\.\d+: .* along",
        ),
        (
            {"load_by": "force", "force": 1e8},
            r"force = 100000000\.0: must be at most \d+: .* along",
        ),
        (
            {"groove_radius": 10.4, "load_ratio": 4.0},
            r"load_ratio = 4\.0: must be at most 3\.\d+: .* across",
        ),
        ({"load": "hertz", "control": "creepage"}, r"control = 'creepage': must be moment"),
        ({"load": "hertz", "lateral_creepage": 0.01}, r"lateral_creepage = 0\.01: must be 0"),
        ({"traction": 0.5, "friction": 0.0}, r"traction = 0\.5: must be 0 without friction"),
        ({"radius": 0.0}, r"radius = 0\.0: must be greater than 0"),
        ({"crown_radius": "round"}, r"crown_radius = 'round': must be a number or same"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        RacewayParameters(**given)


def any_raceway(rng: np.random.Generator) -> dict[str, Any]:
    """Return parameters of a ball or crowned roller, some without a groove, some in a ring."""

    def power(low: float, high: float) -> float:
        return float(10 ** rng.uniform(low, high))

    radius, crown = power(0, 2), power(-3, 3)
    given = {"radius": radius, "load_ratio": power(-1, 0.9), "yield_stress": power(2.7, 3.7)}
    if rng.random() < 0.7:
        given["crown_radius"] = crown = radius * crown
    else:
        crown = radius
    grooves: tuple[dict[str, Any], ...] = (
        {},
        {"groove_radius": "conformity", "conformity": 0.5 + power(-6, 1)},
        {"groove_radius": min(crown * (1 + power(-6, 1)), 1e6)},
    )
    rings = {}, {"ring_radius": radius * power(-1, 2)}, {"ring_radius": -radius - power(-5, 4)}
    loads: tuple[dict[str, Any], ...] = {}, {"load_by": "force", "force": power(1, 9)}
    for some in (grooves, rings, loads):
        given |= some[rng.integers(len(some))]
    return given


def test_the_bound_that_a_refusal_names_is_taken() -> None:
    """Grooves that a crowned roller fits, conformity above 100, both sides, ratio and load."""
    rng, refused = np.random.default_rng(1), set()
    for _ in range(300):
        given, last = any_raceway(rng), ""
        for _ in range(3):  # of the ratio, then of the load
            try:
                taken = RacewayParameters(**given)
                break
            except ModelError as error:
                found = re.search(r"must be (at least|at most) ([0-9.e+-]+): ", str(error))
                assert found is not None and error.field != last, f"{given}: {error}"
                refused.add((error.field, found[1]))
                given, last = given | {error.field: float(found[2])}, error.field
        else:
            pytest.fail(f"{given} has no bound that is taken")
        if last and not last.startswith(("load", "force")):
            assert 0.98 * MOST_LONG <= taken.ellipse.ratio <= MOST_LONG
    sides = {(name, f"at {side}") for name in ACROSS for side in ("least", "most")}
    assert refused == sides | {("load_ratio", "at most"), ("force", "at most")}


ACROSS = ("conformity", "groove_radius", "crown_radius")


@pytest.mark.parametrize("ring", [24.05, -35.95])
def test_a_ball_in_a_ring_has_the_relative_radius(ring: float) -> None:
    given = BEARING | {"ring_radius": ring, "conformity": 0.52, "load_ratio": 0.5}
    p = RacewayParameters(**given)
    relative = 1 / (1 / 5.95 + 1 / ring), 5.95 / (1 - 1 / 1.04)
    exact = HertzEllipse.of(relative, p.contact_modulus, peak_pressure=0.5 * p.yield_stress)
    assert (p.ellipse.a, p.ellipse.b) == pytest.approx((exact.a, exact.b), rel=1e-12)
    assert p.groove == pytest.approx(6.188, rel=1e-12)


# -- the surface of a groove ---------------------------------------------------------------------


def test_depth_counts_from_the_surface_of_a_groove_and_the_map_has_its_flanks() -> None:
    hardens = {"hardening": "kinematic", "hardening_ratio": 0.02}
    record = rolled(**BEARING, **hardens, conformity=0.515, load_by="force", force=6000.0)
    numbers, at = record.scalars, record.coordinates
    assert 0.0 < numbers["least_yielded_depth"] < numbers["most_yielded_depth"]
    assert numbers["least_yielded_depth"] < numbers["depth_of_max_plastic_strain"]
    # the highest point that has yielded is on a flank, above the lowest line of the groove
    strain, y = record.fields["plastic_strain"][1], at["y"]
    assert y[np.nonzero(strain > 1e-5)[0]].max() > 0.0
    assert np.nanmax(strain[-1]) < 1e-5  # none is above the map
    # a profile begins at the surface, where the stress is known from its nodes
    profile = record.fields["residual_profile"][1]
    surface = record.fields["running_surface_residual"][1]
    for k, station in enumerate(at["station"]):
        there = [np.interp(station, at["z"], each) for each in surface]
        np.testing.assert_allclose(profile[k, :, 0], there, atol=0.02 * np.abs(profile).max())


def test_an_undecided_state_says_to_raise_passes_where_several_were_asked_for() -> None:
    few = rolled(passes=3, load="hertz")
    assert few.scalars["shakedown_state"] == ShakedownState.UNDECIDED
    assert "undecided after 3 passes: raise passes" in few.message
    assert not rolled(load="hertz").message
