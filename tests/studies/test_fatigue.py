"""The table ``[fatigue]``: a criterion on the cycle of every run of a study or a scene file."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver.errors import ModelError
from solver.fatigue import DangVan, Findley, Paths, stress_intensity
from solver.results.fatigue import Applies
from studies import Study, StudyError, to_dataframe
from studies.scenes.entries import assessed
from tests.architecture.sources import ROOT
from tests.studies.scenes.conftest import blocks, built

DANG_VAN = {"criterion": "dang_van", "limits": {"torsion": 200.0, "sensitivity": 0.3}}
HERTZ: dict[str, Any] = {
    "load": "hertz", "track": "endless", "accuracy": "draft", "friction": 0.0,
    "yield_stress": 400.0, "hardening": "kinematic",
}  # fmt: skip


def rolled(fatigue: Any, **parameters: Any) -> Study:
    """Return a study of one run of the rolling scene."""
    content = {"name": "rolled", "scene": "rolling", "parameters": HERTZ | parameters}
    return Study.from_dict(content | ({"fatigue": fatigue} if fatigue else {}))


def record_of(study: Study) -> Any:
    """Return the record of the only run of a study."""
    scene, (case,) = study.problem, study.cases()
    (path,) = study.paths()
    (found,) = scene.path(path.parameters, [case.values[scene.branch]], lambda done: None)
    return found


@pytest.mark.solves
def test_an_elastic_rolling_contact_is_as_in_theory() -> None:
    """.1706 p0 at .60 a (`tests/solver/test_fatigue.py`); the draft mesh is coarse: 2 %."""
    record = record_of(rolled(DANG_VAN, load_ratio=0.8))
    p0, a = 320.0, record.parameters.half_width
    assert record.scalars["fatigue_applies"] == Applies.APPLICABLE
    assert record.scalars["fatigue_safety_factor"] == pytest.approx(200 / (0.1706 * p0), rel=0.02)
    assert -record.scalars["fatigue_y"] == pytest.approx(0.60 * a, rel=0.15)
    profile = record.fields["fatigue_utilisation_profile"][1]
    assert profile.max() == pytest.approx(record.scalars["fatigue_utilisation"], rel=0.02)
    p, shear, limit = (
        record.fields[f"fatigue_path_{name}"][1] for name in ("hydrostatic", "shear", "limit")
    )
    factor = record.scalars["fatigue_safety_factor"]
    assert (shear < limit).all()
    used = (shear + DANG_VAN["limits"]["sensitivity"] * p).max() / DANG_VAN["limits"]["torsion"]
    assert 1 / used == pytest.approx(factor)


@pytest.mark.solves
def test_residual_stress_counts_unless_it_is_left_out() -> None:
    """After shakedown it is compression along x below the surface, and helps."""
    with_it = record_of(rolled(DANG_VAN, load_ratio=2.0, passes=4))
    without = record_of(rolled(DANG_VAN | {"residual": False}, load_ratio=2.0, passes=4))
    both = [each.scalars["fatigue_safety_factor"] for each in (with_it, without)]
    assert both[0] > 1.03 * both[1]


@pytest.mark.solves
@pytest.mark.parametrize(("hardening", "factors"), [("kinematic", (1.866, 1.714)), ("none", ())])
def test_ten_passes_have_the_factors_of_the_study_of_the_package(
    hardening: str, factors: tuple[float, ...]
) -> None:
    """At 2 yield stresses and friction .1; without hardening the tenth pass still strains."""
    given = {"load_ratio": 2.0, "friction": 0.1, "hardening": hardening}
    found = []
    for name in ("rolling-fatigue", "rolling-fatigue-alone"):
        content = Study.from_toml(ROOT / "data" / "studies" / f"{name}.toml").to_dict()
        content["parameters"] |= given
        del content["sweep"]
        record = record_of(Study.from_dict(content))
        if record.scalars["fatigue_applies"] == Applies.APPLICABLE:
            found.append(round(record.scalars["fatigue_safety_factor"], 3))
    assert tuple(found) == factors


@pytest.mark.solves
def test_a_pass_is_assessed_once_for_each_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """The points of a row of an endless track have one cycle."""
    sizes: list[int] = []

    def counted(self: Any, paths: Paths) -> Any:
        sizes.append(len(paths))
        return found(self, paths)

    found = DangVan.found
    monkeypatch.setattr(DangVan, "found", counted)
    record = record_of(rolled(DANG_VAN | {"residual": False}, load_ratio=0.8))
    assert record.scalars["fatigue_safety_factor"] > 1.0
    assert 10 < sum(sizes) < 200


@pytest.mark.solves
def test_a_cycle_that_strains_plastically_has_no_safety_factor() -> None:
    record = record_of(rolled(DANG_VAN, load_ratio=2.0, passes=1))
    assert record.scalars["fatigue_applies"] == Applies.NOT_APPLICABLE
    assert np.isnan(record.scalars["fatigue_safety_factor"])
    assert record.scalars["fatigue_plastic_strain"] > 1e-5
    profile = record.fields["fatigue_utilisation_profile"][1]
    assert np.isnan(profile).any() and np.isfinite(profile).any()


@pytest.mark.solves
def test_a_block_that_is_pressed_and_released_is_a_closed_form() -> None:
    """Plane strain under 150 MPa: yy = -150, zz = nu yy; also along a line, and of named stages."""
    content = blocks()
    content["stages"] += [{"name": "eased", "increments": 1}, {"name": "free", "release": True}]
    content["loads"][0]["amplitude"] = {"pressed": 1.0, "eased": 0.5}
    content["results"] |= {
        "lines": {"down": {"body": "lower", "start": [2.0, -0.2], "end": [2.0, -1.8]}}
    }
    content["parameters"]["mu"]["default"] = 0.0
    content["bodies"]["lower"]["supports"] = {"bottom": "y", "left": "x"}
    content["parameters"]["t"] = {"default": 200.0, "unit": "MPa", "range": [1, 999]}
    content["fatigue"] = {
        "criterion": "findley", "limits": {"torsion": "$t", "sensitivity": 0.2},
        "cycle": ["pressed", "eased"], "bodies": ["lower"],
    }  # fmt: skip
    scene = built(content)
    (record,) = scene.path(scene.parameters(), [], lambda done: None)
    path = [[0.0, -150.0, -45.0, 0.0], [0.0, -75.0, -22.5, 0.0]]
    value = Findley(torsion=200.0, sensitivity=0.2).assess(Paths(np.array([path])))
    assert record.status.name == "OK", record.message
    (line,) = record.fields["line_fatigue_utilisation"][1]
    np.testing.assert_allclose(line, value.utilisation[0], rtol=1e-6)
    assert record.scalars["fatigue_safety_factor"] == pytest.approx(value.safety_factor[0])


def boussinesq(X: np.ndarray, a: float, p0: float, nu: float = 0.3) -> np.ndarray:
    """Return stress (n, 6) below a circular Hertz contact, of point forces on a fine grid.

    K.L. Johnson, Contact Mechanics (1985), eqs. 3.19; x along the surface, y up, z across.
    """
    r = (np.arange(60) + 0.5) / 60 * a
    angle = (np.arange(96) + 0.5) / 96 * 2 * np.pi
    force = p0 * np.sqrt(1 - (r / a) ** 2) * r * (a / 60) * (2 * np.pi / 96)
    at = np.stack([np.outer(r, f(angle)).ravel() for f in (np.cos, np.sin)])
    P = np.repeat(force, 96)
    x, z = (X[:, k, None] - at[j] for k, j in ((0, 0), (2, 1)))
    d = -X[:, 1, None]
    s2, R = x**2 + z**2, np.sqrt(x**2 + z**2 + d**2)
    k = (1 - 2 * nu) / s2
    near, far = k * (1 - d / R), 3 * d / R**5

    def across(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return near * (u**2 - v**2) / s2 + k * d * v**2 / R**3 - far * u**2

    zx = near * 2 * x * z / s2 - k * d * x * z / R**3 - far * x * z
    each = (across(x, z), -far * d**2, across(z, x), far * d * x, far * d * z, zx)
    return np.stack([(own * P).sum(axis=1) / (2 * np.pi) for own in each], axis=1)


@pytest.mark.solves
def test_a_ball_that_rolls_is_as_an_independent_integral() -> None:
    """The row below the middle of a circular contact; the error is that of the mesh: 2 %."""
    parameters = {
        "accuracy": "standard",
        "load_ratio": 0.5,
        "friction": 0.0,
        "hardening": "kinematic",
    }
    fatigue = DANG_VAN | {"crack": CRACK | {"at": 0.0}}
    content = {"name": "ball", "scene": "raceway", "parameters": parameters, "fatigue": fatigue}
    record = record_of(Study.from_dict(content))
    s = record.scalars
    a, b, p0 = s["hertz_a"], s["hertz_b"], s["hertz_pressure"]
    assert a == pytest.approx(b, rel=1e-6), "the contact is a circle"
    depth = np.array([0.5, 0.7, 1.0]) * a
    x = np.linspace(-6, 6, 121) * a
    X = np.stack([*(each.ravel() for each in np.meshgrid(x, -depth)), np.zeros(363)], axis=1)
    paths = Paths(boussinesq(X, a, p0).reshape(3, 121, 6))
    value = DangVan(torsion=200.0, sensitivity=0.3).assess(paths)
    profiles = record.fields["fatigue_utilisation_profile"][1]
    profile = profiles[len(profiles) // 2]
    found = np.interp(depth, record.coordinates["depth"], profile)
    np.testing.assert_allclose(found, value.utilisation, rtol=0.02)
    down = np.linspace(1e-9, 1.0, 201)  # over a; Johnson, eq. 3.45
    along = -p0 * (1.3 * (1 - down * np.arctan(1 / down)) - 0.5 / (1 + down**2))
    (expected,) = stress_intensity(down * a, along, np.array([0.6 * a]))
    found = np.interp(0.6 * a, record.coordinates["depth"], record.fields["crack_K_smallest"][1])
    assert found == pytest.approx(expected, rel=0.02)


CRACK = {"threshold": 50.0, "initial": 0.2}
UP = {
    "left": ({"x": [0.0, 8.0], "y": [-4.0, 4.0]}, {"right": "x", "bottom": "y"}, "top", "y"),
    "top": ({"x": [-4.0, 4.0], "y": [-8.0, 0.0]}, {"left": "x", "bottom": "y"}, "right", "x"),
}
"""Blocks with a free side, along which they are pulled: they keep a stress along it."""


def held(side: str, **changed: Any) -> dict[str, Any]:
    """Return a scene file of a block with -60 - 20 depth along its free side, pulled by 100 MPa."""
    opened, depth = ("xx", "-y") if side == "top" else ("yy", "x")
    box, supports, boundary, axis = UP[side]
    return {
        "name": "held",
        "materials": {"steel": {"youngs_modulus": 2e5, "poisson_ratio": 0.3}},
        "bodies": {"block": {
            "material": "steel", "supports": supports,
            "shape": {"kind": "rectangle", **box, "size": 0.5},
        }},
        "loads": [
            {"body": "block", "kind": "initial_stress", opened: f"-60 - 20*({depth})", "zz": -100},
            {"body": "block", "kind": "displacement", "boundary": boundary,
             axis: 100 * 8.0 * (1 - 0.3**2) / 2e5, "amplitude": {"left": 0.0, "pulled": 1.0}},
        ],
        "stages": [{"name": "left"}, {"name": "pulled"}],
        "results": {
            "profile": {"body": "block", "depth": {"start": 0.0, "stop": 6.0, "num": 241}},
            "axis": {"along": [1.0, 0.0] if side == "top" else [0.0, 1.0]},
        },
        "fatigue": {"crack": CRACK | changed},
    }  # fmt: skip


def held_block(side: str, **changed: Any) -> Any:
    """Return the record of `held`."""
    scene = built(held(side, **changed))
    (record,) = scene.path(scene.parameters(), [], lambda done: None)
    assert record.status.name == "OK", record.message
    return record


@pytest.mark.solves
@pytest.mark.parametrize("side", UP)
def test_a_crack_in_constant_and_linear_stress_is_a_closed_form(side: str) -> None:
    """1.1215 and .4390 of it where the stress falls to zero at the tip (Tada, Paris, Irwin)."""
    record = held_block(side)
    depth = record.coordinates["depth"]
    largest, smallest, opened = (
        record.fields[f"crack_K_{name}"] for name in ("largest", "smallest", "range")
    )
    assert largest[0] == ("depth",)
    unit, falling = np.sqrt(np.pi * depth), (1.1215 - 0.4390) * 20 * depth
    np.testing.assert_allclose(smallest[1], (-60 * 1.1215 - falling) * unit, rtol=5e-3)
    np.testing.assert_allclose(largest[1], (40 * 1.1215 - falling) * unit, rtol=5e-3, atol=0.2)
    np.testing.assert_array_equal(opened[1], np.maximum(largest[1], 0.0))
    stop = record.scalars["crack_arrest_depth"]
    a = np.linspace(0.2, 6.0, 10_001)
    exact = (40 * 1.1215 - (1.1215 - 0.4390) * 20 * a) * np.sqrt(np.pi * a)
    assert exact.max() > CRACK["threshold"]
    assert exact[0] < CRACK["threshold"] and stop == CRACK["initial"], "it does not grow"
    grows = held_block(side, initial=1.0).scalars
    last = a[(exact >= CRACK["threshold"]).nonzero()[0][-1]]
    assert 1.0 < last and grows["crack_arrest_depth"] == pytest.approx(last, rel=5e-3)
    assert grows["crack_least_range"] == 0.0
    across = held_block(side, across=True).fields["crack_K_smallest"][1]
    np.testing.assert_allclose(across, -100 * 1.1215 * unit, rtol=2e-4)


@pytest.mark.solves
def test_a_crack_beyond_the_body_or_its_profiles_is_refused_when_the_scene_is_read() -> None:
    assert held_block("top", initial=5.9).coordinates["depth"][-1] == 6.0
    with pytest.raises(StudyError, match=r"fatigue\.crack\.initial = 6\.0: .* profiles, 6 mm"):
        held_block("top", initial=6.0)
    with pytest.raises(StudyError, match=r"fatigue\.crack\.at = 4\.5: .* the surface of block"):
        held_block("top", at=4.5)
    deeper = held("top", initial=8.5)
    deeper["results"]["profile"]["depth"]["stop"] = 9.0
    with pytest.raises(StudyError, match=r"fatigue\.crack\.initial = 8\.5: .* depth of block"):
        built(deeper)


@pytest.mark.solves
def test_a_crack_of_a_study_may_be_deeper_than_the_default_profile_of_its_scene() -> None:
    content = held("top") | {
        "parameters": {"deep": {"default": 3.0, "description": "depth", "unit": "mm"}}
    }
    content["results"]["profile"]["depth"]["stop"] = "$deep"
    del content["fatigue"]
    scene = assessed(built(content), {"crack": CRACK | {"initial": 5.0}})
    (record,) = scene.path(scene.parameters(deep=6.0), [], lambda done: None)
    assert record.scalars["crack_applies"] == Applies.APPLICABLE
    with pytest.raises(ModelError, match=r"fatigue\.crack\.initial = 5\.0: .* profiles, 3 mm"):
        list(scene.path(scene.parameters(), [], lambda done: None))


def test_a_crack_beyond_the_profiles_of_any_run_is_refused_when_the_study_is_read() -> None:
    """The depth of profiles grows with the contact."""
    content = rolled({"crack": CRACK | {"initial": 10.0}}, load_ratio=1.0).to_dict()
    del content["parameters"]["load_ratio"]
    swept = content | {"sweep": {"load_ratio": [0.01, 1.0]}}
    with pytest.raises(StudyError) as error:
        Study.from_dict(swept)
    assert error.value.field == "fatigue.crack.initial" and "load_ratio = 0.01" in str(error.value)


@pytest.mark.solves
def test_a_crack_outside_a_body_is_refused_before_the_first_increment() -> None:
    """Where a body of a scene of the package is, is known once it has a mesh."""
    content = {"name": "far", "scene": "punch", "parameters": {"accuracy": "draft"}}
    far = Study.from_dict(content | {"fatigue": {"crack": CRACK | {"at": 1e4}}})
    scene, (path,) = far.problem, far.paths()
    begun: list[float] = []
    with pytest.raises(ModelError, match=r"fatigue\.crack\.at = 10000\.0"):
        list(scene.path(path.parameters, [1.0], begun.append))
    assert not begun


@pytest.mark.solves
@pytest.mark.parametrize("scene", ["rolling", "raceway", "wheel_rail"])
def test_a_crack_outside_a_body_is_refused_before_the_first_pass(scene: str) -> None:
    content = {"name": "far", "scene": scene, "parameters": {"accuracy": "draft"}}
    deep = Study.from_dict(content | {"fatigue": {"crack": CRACK | {"at": 1e6}}})
    begun: list[float] = []
    problem, (case,), (path,) = deep.problem, deep.cases(), deep.paths()
    with pytest.raises(ModelError, match=r"fatigue\.crack\.at = 1000000\.0: must be on"):
        list(problem.path(path.parameters, [case.values[problem.branch]], begun.append))
    assert not begun


@pytest.mark.solves
def test_a_crack_that_nothing_holds_has_an_infinite_depth() -> None:
    """Pulled without residual stress it grows through the profile; NaN is of K not known."""
    content = held("top", initial=1.0)
    content["loads"] = content["loads"][1:]
    scene = built(content)
    (record,) = scene.path(scene.parameters(), [], lambda done: None)
    assert record.scalars["crack_arrest_depth"] == np.inf
    assert record.scalars["crack_applies"] == Applies.APPLICABLE


@pytest.mark.solves
def test_k_of_a_cycle_that_strains_plastically_is_not_applicable() -> None:
    """At the default parameters of the scene, 2.7 of the yield stress without hardening."""
    content = {"name": "default", "scene": "rolling", "fatigue": {"crack": CRACK}}
    record = record_of(Study.from_dict(content | {"parameters": {"accuracy": "draft"}}))
    assert record.scalars["crack_applies"] == Applies.NOT_APPLICABLE
    assert record.scalars["fatigue_plastic_strain"] > 1e-4
    assert np.isnan(record.fields["crack_K_range"][1]).all()
    assert np.isnan(record.scalars["crack_arrest_depth"])
    elastic = record_of(rolled({"crack": CRACK}, load_ratio=0.8))
    assert elastic.scalars["crack_applies"] == Applies.APPLICABLE


@pytest.mark.solves
def test_a_crack_in_a_deeper_profile_than_that_of_the_default_parameters() -> None:
    crack = {"crack": {"threshold": 100.0, "initial": 55.0}}
    assert record_of(rolled(None)).coordinates["depth"][-1] < 55.0
    deep = record_of(rolled(crack, radius=2000.0, load_ratio=1.0))
    assert deep.coordinates["depth"][-1] > 55.0 and "crack_K_range" in deep.fields


@pytest.mark.solves
def test_a_crack_may_lie_in_the_half_that_is_not_computed() -> None:
    content = {"name": "half", "scene": "punch", "parameters": {"accuracy": "draft"}}
    left, right = (
        record_of(Study.from_dict(content | {"fatigue": {"crack": CRACK | {"at": at}}}))
        for at in (-30.0, 30.0)
    )
    K = left.fields["crack_K_smallest"][1]
    assert np.isfinite(K).all() and K.min() < 0
    np.testing.assert_array_equal(K, right.fields["crack_K_smallest"][1])


def below_hertz(x: np.ndarray, z: np.ndarray, a: float, f: float) -> np.ndarray:
    """Return xx over p0 at depths z under a Hertz pressure with sliding friction f.

    K.L. Johnson, Contact Mechanics (1985), section 4.2 and eqs. 7.5.
    """
    apart = a**2 - x**2 + z**2
    whole = np.sqrt(apart**2 + 4 * x**2 * z**2)
    m, n = np.sqrt((whole + apart) / 2), np.sign(x) * np.sqrt((whole - apart) / 2)
    by_pressure = m * (1 + (z**2 + n**2) / (m**2 + n**2)) - 2 * z
    by_shear = n * (2 - (z**2 - m**2) / (m**2 + n**2)) - 2 * x
    return np.asarray((f * by_shear - by_pressure) / a)


@pytest.mark.solves
def test_a_crack_that_a_contact_passes_is_as_by_another_weight_function() -> None:
    """H.F. Bueckner, Z. angew. Math. Mech. 50 (1970) 529-546, .8 % above for constant stress."""
    crack = {"crack": {"threshold": 100.0, "initial": 0.1}}
    f, ratio = 0.3, 0.5
    record = record_of(rolled(crack, load_ratio=ratio, friction=f, traction=1.0))
    a, depth = record.parameters.half_width, record.coordinates["depth"]
    u, weight = (each / 2 for each in np.polynomial.legendre.leggauss(200))
    u = u + 0.5
    for length in np.array([0.25, 0.5, 1.0, 2.0]) * a:
        x, z = np.meshgrid(np.linspace(-40, 40, 20_001) * a, length * (1 - u**2), indexing="ij")
        stress = 400 * ratio * below_hertz(x, z, a, f)
        by_place = np.sqrt(8 * length / np.pi) * (1 + 0.6147 * u**2 + 0.2502 * u**4)
        K = (stress * by_place) @ weight
        found = {
            name: np.interp(length, depth, record.fields[f"crack_K_{name}"][1])
            for name in ("largest", "smallest", "range")
        }
        assert K.max() > 10.0 > K.min(), "it opens and closes"
        assert found["largest"] == found["range"] == pytest.approx(K.max(), rel=0.02)
        assert found["smallest"] == pytest.approx(K.min(), rel=0.02)


def test_studies_without_the_table_are_as_before() -> None:
    """Their scene is the same object; with it, run and study have ids of their own."""
    plain, asked = rolled(None), rolled(DANG_VAN)
    without = rolled(DANG_VAN | {"residual": False})
    assert "fatigue" not in plain.to_dict() and not plain.problem.source
    assert len({*plain.run_ids(), *asked.run_ids(), *without.run_ids()}) == 3
    again = Study.from_dict(asked.to_dict())
    assert (again.id, list(again.run_ids())) == (asked.id, list(asked.run_ids()))
    assert assessed(asked.problem, DANG_VAN) == asked.problem


@pytest.mark.parametrize(
    ("field", "table"),
    [
        ("fatigue", 3),
        ("fatigue.criterion", {"criterion": "dang"}),
        ("fatigue.limits.sens", {"criterion": "dang_van", "limits": {"torsion": 3.0, "sens": 1.0}}),
        ("fatigue.limits.torsion", {"criterion": "dang_van"}),
        ("fatigue.limits.torsion", {"criterion": "dang_van", "limits": {"torsion": -3.0}}),
        ("fatigue.cycle", DANG_VAN | {"cycle": ["nowhere"]}),
        ("fatigue.cyclic", DANG_VAN | {"cyclic": True}),
        ("fatigue.criterion", {"bodies": []}),
        ("fatigue.criterion", {"crack": CRACK, "limits": {"torsion": 300.0}}),
        ("fatigue.bodies", {"crack": CRACK, "bodies": ["half_space"]}),
        ("fatigue.crack.threshold", {"crack": {"initial": 0.1}}),
        ("fatigue.crack.threshold", {"crack": {"initial": 0.1, "threshold": "3 MPa"}}),
        ("fatigue.crack.initial", {"crack": {"initial": 0.0, "threshold": 3.0}}),
        ("fatigue.crack.depth", {"crack": CRACK | {"depth": 1.0}}),
    ],
)
def test_mistakes_name_their_entry(field: str, table: Any) -> None:
    with pytest.raises(StudyError) as error:
        rolled(table)
    assert error.value.field == field
    if isinstance(table, dict):
        with pytest.raises(StudyError, match=field):
            built(blocks() | {"fatigue": table})


def test_paths_are_tables_with_the_names_of_pylife() -> None:
    stress = np.arange(36.0).reshape(2, 3, 6)
    paths = Paths(stress, 1e-5 * stress)
    table = to_dataframe(paths)
    assert table.index.names == ["load_step", "node_id"] and table.shape == (6, 12)
    assert list(table.columns[:6]) == ["S11", "S22", "S33", "S12", "S13", "S23"]
    assert table.loc[(2, 1)].tolist()[:6] == paths.stress[1, 2, [0, 1, 2, 3, 5, 4]].tolist()
