"""The table ``[derivatives]`` of studies and scene files."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import SCENES
from studies import Store, Study, StudyError, fit, open_study
from studies.execution.estimate import Estimate, estimate
from studies.scenes.description import Description
from studies.scenes.entries import derived
from studies.scenes.scene import file_scene, read_scene
from studies.views.elasticities import elasticities
from studies.views.tables import elasticity_table, runs_table
from tests.marks import HERE
from tests.studies.conftest import compute_here

BENDING = HERE.parent / "data/scenes/bending.toml"
ASKED = {"by": ["ratio"], "of": ["residual"]}


def bent(**more: Any) -> Study:
    """Return a study of a beam that is bent beyond yield."""
    content = {"name": "bent", "sweep": {"ratio": [1.1, 1.3]}, **more}
    return Study.from_dict(content, read_scene(BENDING))


def punched(**more: Any) -> Study:
    """Return a study of one run of the punch."""
    return Study.from_dict({"name": "punched", "scene": "punch", "parameters": {}, **more})


@pytest.mark.solves
def test_the_data_set_has_them_with_their_units(store: Store) -> None:
    """The residual stress of a perfectly plastic beam is 300 MPa (ratio - 1) at its face."""
    study = bent(derivatives=ASKED)
    compute_here(study, store, study.problem)
    data = open_study(store.dataset_path(study.id))
    assert data["d_residual_d_ratio"].values == pytest.approx([300.0, 300.0], rel=1e-5)
    assert data["d_residual_d_ratio"].attrs["units"] == "MPa"
    assert "derivative of" in data["d_residual_d_ratio"].attrs["long_name"]
    assert ((0 < data["derivative_range_ratio"]) & (data["derivative_range_ratio"] < 0.1)).all()
    *_, row = elasticity_table(data).splitlines()
    assert row.split() == ["residual", "+7.67", "(+4.33", "to", "+11.00)"], "ratio / (ratio - 1)"
    assert "residual" in runs_table(data)
    for name in ("d residual", "derivative"):
        assert name not in runs_table(data), "they are in the data set"


@pytest.mark.solves
def test_lines_have_the_derivatives_of_differences(store: Store) -> None:
    of, width = ["line_stress", "line_plastic_strain"], 1e-5
    study = bent(derivatives={"by": ["ratio"], "of": of}, sweep={"ratio": [1.2]})
    beside = bent(sweep={"ratio": [1.2 * (1 - width), 1.2 * (1 + width)]})
    runs = []
    for each in (study, beside):
        compute_here(each, store, each.problem)
        runs.append(open_study(store.dataset_path(each.id)))
    for name in of:
        found = runs[0][f"d_{name}_d_ratio"].isel(ratio=0)
        expected = runs[1][name].diff("ratio").isel(ratio=0) / (2 * width * 1.2)
        assert found.dims == runs[0][name].isel(ratio=0).dims
        assert float(abs(expected).max()) > 1e-4
        assert float(abs(found - expected).max()) < 2e-5 * float(abs(expected).max())


@pytest.mark.solves
def test_lines_of_every_pass_are_stored_with_their_dimensions(store: Store) -> None:
    """Residual stress over depth is of degree one in yield stress and modulus together."""
    how = {"accuracy": "draft", "passes": 2, "friction": 0.2, "hardening": "kinematic"}
    by = {"yield_stress": 500.0, "youngs_modulus": 2.1e5}
    study = Study.from_dict(
        {
            "name": "passed", "scene": "rolling", "parameters": {**how, **by, "load_ratio": 2.2},
            "derivatives": {"by": [*by], "of": ["residual_profile"]},
        }
    )  # fmt: skip
    compute_here(study, store, study.problem)
    data = open_study(store.dataset_path(study.id))
    profile, *slopes = (data[each] for each in ("residual_profile", *map(PROFILE.format, by)))
    assert {each.dims for each in slopes} == {profile.dims} and "pass" in profile.dims
    assert {each.attrs["units"] for each in slopes} == {"1"}
    assert not [name for name in data if str(name).startswith("derivative_range")]
    both = sum(slope * value for slope, value in zip(slopes, by.values(), strict=True))
    size = float(abs(profile).max() + abs(slopes[1] * by["youngs_modulus"]).max())
    assert float(abs(both - profile).max()) < 1e-4 * size


PROFILE = "d_residual_profile_d_{}"


def test_elasticities_are_of_numbers_and_parameters_that_a_run_has() -> None:
    scalars = {"force": 50.0, "d_force_d_size": 20.0, "d_force_d_friction": None, "d_x_d_size": 1.0}
    found = elasticities(
        scalars | {"zero": 0.0, "d_zero_d_size": 1.0}, {"size": 5.0, "friction": 0.0}
    )
    assert found == {"force": {"size": [2.0]}}


def test_they_change_the_ids_of_runs_and_are_extended_with_them() -> None:
    with_them, without = bent(derivatives=ASKED), bent()
    assert not {*with_them.run_ids()} & {*without.run_ids()}
    own = {"name": "bent", "scene": "bending", "sweep": {"ratio": [1.1, 1.3]}, "derivatives": ASKED}
    more = Study.from_dict(
        {"name": "more", "extends": own, "sweep": {"ratio": [1.4]}},
        scenes=lambda name: read_scene(BENDING),
    )
    assert {*with_them.run_ids()} <= {*more.run_ids()}


@pytest.mark.parametrize(
    ("derivatives", "field", "allowed"),
    [
        (3, "derivatives", "must be a table"),
        ({"by": ["friction"]}, "derivatives.of", "must be given"),
        ({"by": ["elemnt"], "of": ["plastic_work"]}, "derivatives.by[0]", "with decimals"),
        ({"by": ["element"], "of": ["plastic_work"]}, "derivatives.by[0]", "with decimals"),
        ({"by": ["friction"], "of": ["increments"]}, "derivatives.of[0]", "a result with decimals"),
        ({"by": ["friction"], "of": []}, "derivatives.of", "1 or more"),
    ],
)
def test_mistakes_name_their_entry(derivatives: Any, field: str, allowed: str) -> None:
    with pytest.raises(StudyError) as caught:
        punched(derivatives=derivatives)
    assert caught.value.field == field
    assert allowed in caught.value.allowed


def test_a_scene_whose_own_method_has_none_refuses_them() -> None:
    scene = replace(SCENES["wheel_rail"], derives=0.0)
    with pytest.raises(StudyError, match="must be left out: runs of wheel_rail"):
        derived(scene, {"by": ["friction"], "of": ["residual_max"]})


def test_an_estimate_counts_them(store: Store) -> None:
    both = [
        estimate(punched(**more), store).cpu_seconds
        for more in ({"derivatives": {"by": ["friction"], "of": ["plastic_work"]}}, {})
    ]
    assert both[0] and both[1] and both[0][1] > 1.2 * both[1][1]


def test_an_estimate_counts_the_set_ups_of_neighbours(store: Store) -> None:
    """A rail by friction has one; by foundation and Young's modulus it has three."""

    def estimated(*by: str) -> Estimate:
        asked = {"by": list(by), "of": ["axle_height"]}
        given = {"name": "rail", "scene": "wheel_rail", "derivatives": asked}
        return estimate(Study.from_dict({**given, "parameters": {"friction": 0.3}}), store)

    one, three = estimated("friction"), estimated("friction", "foundation", "youngs_modulus")
    assert one.memory and three.memory and one.most_cpu_seconds and three.most_cpu_seconds
    assert 1.0e9 < three.memory - one.memory < 1.4e9, "measured: 1.14e9"
    assert three.most_cpu_seconds > 1.5 * one.most_cpu_seconds


BAR = """
name = "cyclic_bar"
summary = "a bar that is strained back and forth"
kinematics = "plane_strain"
increment_error = 0.1
[parameters]
strength = { default = 200.0, range = [50.0, 500.0], description = "yield stress" }
growth = { default = 60.0, range = [0.0, 500.0], description = "isotropic saturation" }
modulus = { default = 4e4, range = [1e3, 2e5], description = "modulus of the back stress" }
recall = { default = 250.0, range = [1.0, 2000.0], description = "its recall" }
[materials.m]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = "$strength"
hardening = "chaboche"
saturation = "$growth"
saturation_rate = 50.0
back_stresses = [["$modulus", "$recall"]]
[bodies.b]
material = "m"
shape = { kind = "rectangle", x = [0, 4], y = [0, 4], size = 4 }
supports = { left = "x", bottom = "y" }
[rigid.grip]
y = { moved = 0.04, amplitude = { AMPLITUDE } }
[[links]]
slave = "b.top"
rigid = "grip"
components = "y"
"""
STRAINED = (0.2, 0.5, 1.0, -0.2, -1.0, 0.4, 1.0)


@pytest.mark.long
@pytest.mark.solves
def test_four_parameters_are_fitted_by_a_fifth_of_the_runs_of_differences(store: Store) -> None:
    """By differences the same fit takes 47 runs."""
    of = [f"f{k}" for k in range(len(STRAINED))]
    amplitude = ", ".join(f"s{k} = {each}" for k, each in enumerate(STRAINED))
    content = tomllib.loads(BAR.replace("AMPLITUDE", amplitude))
    content["stages"] = [{"name": f"s{k}", "increments": 1} for k in range(len(of))]
    content["outputs"] = {
        f"f{k}": {"of": "stress.yy", "body": "b", "stage": f"s{k}", "take": "maximum"}
        for k in range(len(of))
    }
    scene = file_scene(Description("bar.toml", content, {}))
    truth = {"strength": 200.0, "growth": 60.0, "modulus": 4e4, "recall": 250.0}
    (record,) = scene.path(scene.parameters(**truth), [], lambda share: None)
    noise = np.random.default_rng(3).normal(size=len(of))
    measured = [
        {"of": name, "values": [record.scalars[name] * (1 + 0.005 * each)], "sigma": 2.0}
        for name, each in zip(of, noise, strict=True)
    ]
    ranges = {
        "strength": [120, 320],
        "growth": [10, 150],
        "modulus": [1e4, 1e5],
        "recall": [80, 700],
    }
    study = Study.from_dict(
        {
            "name": "four", "scene": "cyclic_bar", "fit": {"measured": measured, "ranges": ranges},
            "derivatives": {"by": list(ranges), "of": of},
        },
        scene,
    )  # fmt: skip
    found = fit(study, store, workers=0)
    assert found.status == "ok" and found.runs <= 47 / 5
    for name, value in truth.items():
        assert abs(found[name] - value) < 2 * found[f"{name}_sigma"], name
        assert found[f"{name}_sigma"] < 0.1 * value
