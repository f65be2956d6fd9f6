"""A wheel on a rail: against figures of a finer mesh and of a published test, and by symmetry."""

from __future__ import annotations

from functools import cache
from typing import Any, NoReturn, cast

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial import cKDTree

from solver import ModelError, NotConverged, Record
from solver.errors import LimitLoad, TooLong, WindowTooSmall
from solver.results.mesh_fields import to_meshio
from solver.results.record import Status
from solver.results.shakedown import ShakedownState
from solver.rolling.passing import TOLERANCE
from solver.rolling.rail.track import PrismField
from solver.rolling.scenes.initial_stress import RollerStraightened
from solver.rolling.scenes.wheel_rail import ELEMENT_SIZE, WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import expected_contact
from solver.rolling.scenes.wheel_rail_setup import load_on
from solver.rolling.scenes.wheel_rail_track import geometry, section_of, track_of
from solver.shipped import SCENES
from tests.records import kept
from tests.verification.hertz_ellipse import HertzEllipse

SCENE = SCENES["wheel_rail"]
PUBLISHED = {"accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196}
CROWNED = PUBLISHED | {
    "wheel_profile": "crowned", "cant": 0.0, "lateral_position": 0.0, "load": 100e3
}  # fmt: skip
XX, YY, ZZ = range(3)


@cache
def rolled(*changes: tuple[str, Any], passes: tuple[int, ...] = (1,)) -> tuple[Record, ...]:
    """The records of a wheel at draft accuracy, by numbers of passes."""
    parameters = SCENE.parameters(**PUBLISHED | dict(changes))
    found = SCENE.path(parameters, passes, lambda share: None)
    # a test looks at the fields at the nodes of `free`
    return tuple(found if passes == (1, 3) else map(kept, found))


def free() -> Record:
    """The published test of free rolling, one pass."""
    return rolled(passes=(1, 3))[0]


def field(record: Record, name: str) -> np.ndarray:
    """A field of a record without the dimension of bodies."""
    dims, values = record.fields[name]
    return values[0] if dims[0] == "body" else values


def test_stress_under_the_wheel_is_that_of_the_published_test() -> None:
    """The thesis reads -920, -1 000 and -740 from contours of 100 MPa."""
    lowest = field(free(), "lowest_loaded")
    np.testing.assert_allclose(lowest[[XX, YY]], [-920, -1000], atol=75)
    # across it depends on the side of elements: -704 at 1 mm, where this is 7 % less
    assert lowest[ZZ] == pytest.approx(-740, abs=100)


def test_the_rail_clamped_as_the_published_one_sinks_and_turns_as_it() -> None:
    """Published for 2.4 m 1.62 mm and "about 0.05 degrees", here 1.73 and 0.047.

    Endless it sinks 3.6 mm, the beam without shear 3.44, and turns twice as far.
    """
    sunk, turned = [], []
    for span in (2400.0, "endless"):
        parameters = SCENE.parameters(**PUBLISHED, span=span)
        track = track_of(geometry(parameters))
        load = load_on(track, parameters)
        contact = load.solve(np.zeros((track.grid.stations, len(track.grid.z), 3)))
        moved = track.beneath(PrismField(track, traction=contact.traction))
        node, axis = np.divmod(track.modes.unknowns, 3)
        z, y = track.section.plane.X[:, node]
        low = (axis == YY) & (y < y.min() + 1.5)  # the contact flattens what is above
        turn, sink = np.polyfit(z[low], moved[low], 1)
        sunk.append(-sink)
        turned.append(np.degrees(turn))
    assert sunk == pytest.approx([1.62, 3.44], rel=0.08)
    assert turned[0] == pytest.approx(0.05, rel=0.1)
    assert turned[1] > 1.9 * turned[0]


def test_pressure_has_two_maxima_the_larger_one_to_the_outside() -> None:
    pressure = field(free(), "patch_pressure").max(axis=0)
    z = free().coordinates["z"]
    inner, outer = pressure[z < -8].max(), pressure[z > 0].max()
    between = pressure[(z > -9.6) & (z < -8)].min()
    assert between < 0.95 * inner < inner < 0.7 * outer
    assert outer == pytest.approx(1000, rel=0.05)


def test_residual_stress_of_free_rolling_is_near_the_published_range() -> None:
    """Elements of 2 mm overestimate the lowest by 17 % (-57, -64); those of 1 mm give -49, -55.

    The published ranges are -22 to -47 and -27 to -54, over stations that are not all steady.
    """
    lowest, depth = field(free(), "residual_min"), -field(free(), "residual_min_y")
    np.testing.assert_allclose(lowest[[XX, ZZ]], [-49, -55], rtol=0.2)
    assert (np.abs(depth[[XX, ZZ]] - 3.5) <= 1.0).all()
    assert field(free(), "surface_residual_max")[ZZ] == pytest.approx(56, rel=0.3)


def test_free_rolling_yields_below_the_surface_only() -> None:
    """Plastic strain is 0.00095 with elements of 1 mm; the published 0.0015 is not reached."""
    numbers = free().scalars
    assert numbers["max_plastic_strain"] == pytest.approx(9.5e-4, rel=0.05)
    assert 1.0 < numbers["least_yielded_depth"] < numbers["most_yielded_depth"] < 7.0


def test_accelerating_yields_more_and_nearer_to_the_surface() -> None:
    (record,) = rolled(("friction", 0.3), ("traction", -0.75))
    numbers = record.scalars
    assert numbers["longitudinal_force"] == pytest.approx(-0.75 * 0.3 * 150e3, rel=2e-3)
    assert numbers["creepage"] < 0
    assert numbers["max_plastic_strain"] > 1.8 * free().scalars["max_plastic_strain"]
    assert numbers["depth_of_max_plastic_strain"] < 3.0
    assert numbers["least_yielded_depth"] < 0.5


def test_the_wheel_carries_its_load_and_sinks_with_the_foundation() -> None:
    """A beam on springs sinks by P (4 k^3 E I)^(-1/4) / 2; contact and head add to it."""
    deflection = 150e3 / 2 / (4 * 21.0**3 * 2e5 * 3038.3e4) ** 0.25
    assert -free().scalars["axle_height"] == pytest.approx(deflection, rel=0.15)
    dims, pressure = free().fields["patch_pressure"]
    step = [np.diff(free().coordinates[name])[0] for name in dims]
    # interpolation between stations and vertices keeps the integral, up to the edge of contact
    assert pressure.sum() * np.prod(step) == pytest.approx(150e3, rel=0.02)


def test_passes_share_a_path_and_strain_grows_ever_less() -> None:
    first, third = rolled(passes=(1, 3))
    strain = field(third, "pass_max_plastic_strain")
    assert strain[0] == field(first, "pass_max_plastic_strain")[0]
    assert np.diff(strain, prepend=0.0)[1:].max() < 0.1 * strain[0]
    assert third.scalars["shakedown_state"] in (
        ShakedownState.ELASTIC_SHAKEDOWN, ShakedownState.UNDECIDED,
    )  # fmt: skip


def test_a_symmetric_wheel_leaves_symmetric_stress() -> None:
    (record,) = rolled(*CROWNED.items(), ("traction", 0.5))
    assert record.status is Status.OK, record.message
    residual = field(record, "residual_stress")
    scale = np.nanmax(np.abs(residual))
    assert scale > 50.0
    mirrored = residual[..., ::-1] * np.array([1, 1, 1, 1, -1, -1])[:, None, None]
    np.testing.assert_allclose(residual, mirrored, atol=0.02 * scale)
    assert abs(record.scalars["lateral_force"]) < 1e-3 * 100e3


def test_braking_and_accelerating_shear_the_rail_in_opposite_directions() -> None:
    (braked,) = rolled(*CROWNED.items(), ("traction", 0.5))
    (driven,) = rolled(*CROWNED.items(), ("traction", -0.5))
    ways = [field(each, "pass_surface_advance")[0] for each in (braked, driven)]
    assert ways[0] > 1.5 * ways[1]  # pressure alone moves it forwards
    forces = [each.scalars["longitudinal_force"] for each in (braked, driven)]
    assert forces[0] == pytest.approx(-forces[1], rel=1e-3)


def test_the_creepage_of_a_moment_makes_that_moment() -> None:
    moment, *_ = rolled(("friction", 0.3), ("traction", -0.75))
    own = moment.scalars["creepage"]
    (given,) = rolled(("friction", 0.3), ("control", "creepage"), ("given_creepage", own))
    for name in ("longitudinal_force", "max_plastic_strain", "creepage"):
        assert given.scalars[name] == pytest.approx(moment.scalars[name], rel=1e-3), name


def test_lateral_creepage_drags_the_rail_along_up_to_friction() -> None:
    forces = [
        rolled(*CROWNED.items(), ("lateral_creepage", creepage))[0].scalars["lateral_force"]
        for creepage in (-0.03, 0.03)
    ]
    full = 0.17 * 100e3
    np.testing.assert_allclose(forces, [-full, full], atol=0.03 * full)


def test_a_crowned_wheel_on_an_elastic_rail_presses_as_hertz() -> None:
    """Relative radii of 460 mm along and 150 across; the contact is four elements wide."""
    (record,) = rolled(*CROWNED.items(), ("yield_stress", 3000.0), ("friction", 0.0))
    assert record.scalars["max_plastic_strain"] == 0.0
    modulus = 2e5 / (2 * (1 - 0.3**2))

    def hertz(axes: np.ndarray) -> HertzEllipse:
        peak = 1.5 * 100e3 / (np.pi * axes[0] * axes[1])
        return HertzEllipse(a=axes[0], b=axes[1], peak_pressure=peak, modulus=modulus)

    found = hertz(fsolve(lambda axes: np.log(hertz(axes).radii) - np.log([460, 150]), [8.0, 4.0]))
    np.testing.assert_allclose(found.radii, (460, 150), rtol=1e-6)
    assert record.scalars["peak_patch_pressure"] == pytest.approx(found.peak_pressure, rel=0.05)
    area = np.pi * found.a * found.b
    assert record.scalars["patch_area"] == pytest.approx(area, rel=0.1)


def test_the_zone_is_at_the_contact() -> None:
    numbers, contact = free().scalars, expected_contact(free().parameters)  # type: ignore[arg-type]
    touched = numbers["patch_left"], numbers["patch_right"]
    assert contact.middle == pytest.approx(sum(touched) / 2, abs=2.0)
    assert contact.across == pytest.approx(np.ptp(touched) / 2, abs=2.0)


def test_a_zone_that_is_too_small_is_begun_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.rolling.scenes.rail_passes.REACHES", (0.6, 1.0))
    again = SCENE.path(SCENE.parameters(**PUBLISHED), [1], lambda share: None)
    (record,) = again
    assert record.status is Status.OK
    assert record.scalars["max_plastic_strain"] == free().scalars["max_plastic_strain"]


def searched(
    monkeypatch: pytest.MonkeyPatch, own: NotConverged, eased: NotConverged, reaches: Any
) -> tuple[Record, list[float]]:
    """Return the record of passes that fail so, and their tolerances; without hardening."""
    tolerances: list[float] = []

    def lost(*_: Any, tolerance: float, **__: Any) -> NoReturn:
        tolerances.append(tolerance)
        raise own if tolerance == TOLERANCE else eased

    monkeypatch.setattr("solver.rolling.scenes.rail_passes.REACHES", reaches)
    monkeypatch.setattr("solver.rolling.search.passing", lost)
    monkeypatch.setattr("solver.rolling.scenes.rail_passes._TRIED", {})
    (record,) = SCENE.path(SCENE.parameters(**PUBLISHED), [1], lambda share: None)
    return record, tolerances


LOST, SMALL = NotConverged("no steady pass was found"), WindowTooSmall("the window is too small")


def test_an_easier_pass_too_large_for_a_zone_is_tried_in_the_next_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the largest zone the run ends: finer elements would not help."""
    record, tolerances = searched(monkeypatch, LOST, SMALL, (0.6, 0.7))
    assert record.status is Status.NOT_CONVERGED
    assert "the window is too small, in the largest zone, " in record.message
    assert record.message.endswith("; lower the load")
    assert len(tolerances) == 4
    assert tolerances[0] == tolerances[2] == TOLERANCE != tolerances[1] == tolerances[3]


def test_a_limit_load_in_the_largest_zone_is_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The easier pass has its error, and is tried in both zones."""
    limit = LimitLoad("plastic strain grows without bound")
    record, tolerances = searched(monkeypatch, limit, SMALL, (0.6, 0.7))
    assert record.status is Status.LIMIT_LOAD
    assert len(tolerances) == 4


@pytest.mark.parametrize("eased", [TooLong("too many solves"), LOST])
def test_easier_passes_that_are_lost_prove_nothing(
    monkeypatch: pytest.MonkeyPatch, eased: NotConverged
) -> None:
    record, _ = searched(monkeypatch, LOST, eased, (0.6, 0.7))
    assert "no steady pass was found" in record.message


@pytest.mark.long
def test_a_heavy_load_without_hardening_has_an_equilibrium() -> None:
    """An easier pass needs the second zone; in the first one the pass itself seems lost."""
    given = {"accuracy": "draft", "hardening": "none", "load": 372.6e3, "lateral_position": -7.0}
    parameters = WheelRailParameters(friction=0.0, **given)
    (record,) = SCENE.path(parameters, [1], lambda share: None)
    assert record.status is Status.OK
    assert record.scalars["max_plastic_strain"] == pytest.approx(0.017, rel=0.05)


@pytest.mark.parametrize("distance", [29.0, 30.0, 120.0])
def test_wheels_stand_on_whole_numbers_of_stations_and_share_the_rail(distance: float) -> None:
    own = geometry(WheelRailParameters(wheel_distance=distance, foundation=1e3, accuracy="draft"))
    between = distance / own.spacing
    assert between == pytest.approx(round(between)) and 0.9 * 2.0 <= own.spacing <= 2.0
    assert 2 * own.waves % round(between) == 0
    assert sum(own.window) <= round(between), "each material point passes one wheel"
    alone = geometry(WheelRailParameters(accuracy="draft"))
    assert own.waves >= alone.waves and alone.spacing == 2.0


def test_a_contact_longer_than_the_distance_of_wheels_asks_for_a_larger_one() -> None:
    long = WheelRailParameters(
        accuracy="draft", foundation=1e4, lateral_position=-6.0, wheel_radius=5000.0,
        wheel_distance=20.0,
    )  # fmt: skip
    (record,) = SCENE.path(long, [1], lambda share: None)
    assert record.status is Status.NOT_CONVERGED
    assert record.message.endswith("; lower the load, or enlarge wheel_distance")


def test_the_effort_is_that_of_the_run() -> None:
    _, third = rolled(passes=(1, 3))
    assert SCENE.effort is not None
    effort = SCENE.effort(third.parameters, [1, 3])
    # a draft of which a run is lost needs the unknowns of standard elements
    assert effort.unknowns > third.scalars["degrees_of_freedom"]
    (run,) = rolled(("accuracy", "standard"), ("load", 1e3))
    assert SCENE.effort(run.parameters, [1]).unknowns == run.scalars["degrees_of_freedom"]
    assert effort.increments == effort.most_increments == third.scalars["increments"] == 3


def test_a_load_above_the_limit_is_a_record_with_a_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The contact is two thirds longer and wider than that of 150 kN, and so are the elements."""
    monkeypatch.setitem(cast("dict[str, float]", ELEMENT_SIZE), "draft", 3.4)
    soft = {"hardening": "none", "hardening_ratio": 0.0, "friction": 0.0}
    parameters = SCENE.parameters(**PUBLISHED | soft, load=700e3)
    (record,) = SCENE.path(parameters, [1], lambda share: None)
    assert record.status is Status.LIMIT_LOAD
    assert "grows without bound" in record.message
    assert record.scalars["degrees_of_freedom"] > 0


def test_fields_around_the_load_are_those_of_the_section_where_it_is() -> None:
    """Hexahedra of 20 nodes, which VTK orders: corners, then mid-sides of edges."""
    fields = free().mesh()
    _, (element, cells) = fields.bodies.values()
    assert (element, cells.shape[1]) == ("hexahedron20", 20)
    section, around = fields.X[:, : cells.min()].T, fields.X[:, cells.min() :].T
    apart, same = cKDTree(section).query(around)
    same = np.where(apart < 1e-9, same, -1)
    loaded, left = fields.stages["loaded"], fields.stages["unloaded"]
    for stage in (loaded, left):
        for name in ("stress", "mises", "plastic_strain"):
            whole, own = stage[name][..., : len(section)], stage[name][..., len(section) :]
            assert np.isfinite(own).all(), name
            known = (same >= 0) & np.isfinite(loaded["mises"])[same]
            assert known.sum() > 50
            scale = np.abs(own).max()
            # both are recovered from the points of the same elements
            np.testing.assert_allclose(own[..., known], whole[..., same[known]], atol=1e-9 * scale)
    corners = fields.X.T[cells[:, :8]]
    one, two, three = (corners[:, k] - corners[:, 0] for k in (1, 3, 4))
    assert (np.einsum("ij,ij->i", np.cross(one, two), three) > 0).all()
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
    ends += [(0, 4), (1, 5), (2, 6), (3, 7)]
    middle = corners[:, np.array(ends)].mean(axis=2)
    assert np.abs(fields.X.T[cells[:, 8:]] - middle).max() < 0.05  # the surface is curved
    assert [each.type for each in to_meshio(fields, "loaded").cells] == ["quad8", element]


def test_stress_of_straightening_and_cold_stays_where_nothing_yields() -> None:
    """In cold a welded rail has E alpha dT along x; 16 mm deep the rail is elastic."""
    given = ("initial_stress", "roller_straightened"), ("temperature_change", -30.0)
    (record,) = rolled(*given)
    assert record.status is Status.OK, record.message
    assert record.scalars["audit_initial_stress"] < 1e-9
    assert record.scalars["max_plastic_strain"] > 1.5 * free().scalars["max_plastic_strain"]
    added = [field(each, "residual_profile")[1, XX, -1] for each in (record, free())]
    section = section_of(geometry(record.parameters))  # type: ignore[arg-type]
    points, area = section.points.reshape(2, -1), section.weights.ravel()
    straightened = RollerStraightened().stress(points, area)[XX]
    station = record.coordinates["station"][1], -16.0
    near = np.hypot(*(points.T - station).T).argmin()
    wanted = straightened[near] + 2e5 * 1.15e-5 * 30.0
    assert added[0] - added[1] == pytest.approx(wanted, abs=12.0)  # the nearest point is 2 mm away


def test_a_wheel_beside_the_rail_is_refused_by_name() -> None:
    parameters = WheelRailParameters(lateral_position=8.0, accuracy="draft")
    with pytest.raises(ModelError, match=r"lateral_position = 8\.0: must leave the flange beside"):
        next(SCENE.method(parameters)(SCENE, [parameters], lambda share: None))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"friction": 0.0, "traction": 0.5}, r"traction = 0\.5: must be 0 without friction"),
        ({"control": "creepage", "traction": 0.5}, r"traction = 0\.5: must be 0 with control"),
        ({"given_creepage": 0.01}, r"given_creepage = 0\.01: needs control = creepage"),
        ({"initial_stress": "over_height"}, r"stress_over_height = \(\): must be given"),
        ({"load": 0.0}, r"load = 0\.0: must be greater than 0"),
        ({"span": 2400.0, "wheel_distance": 60.0}, r"wheel_distance = 60\.0: needs span = endless"),
        (
            {"wheel_distance": 120.0},
            r"foundation = 21\.0: must be at least 125 MPa under a wheel of 150000 N every 120 mm: "
            r"the rail would sink by 59\.5 mm",
        ),
    ],
)
def test_parameters_that_do_not_fit_are_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        WheelRailParameters(**given)
