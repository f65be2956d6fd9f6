"""Sound runs whose records are hard to compute twice; each record is compared as it is made."""

from __future__ import annotations

import json
from math import pi
from typing import Any

import numpy as np
import pytest

from solver import Record
from solver.audit.plain import PlainBody
from solver.fem.discretisation import Discretisation
from solver.model.loads import Pressure
from solver.shipped import SCENES
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from tests.verification.bodies import sector, steel

TAKES = ("maximum", "minimum", "integral", "extent")

LOWER: dict[str, Any] = {
    "material": "steel",
    "shape": {
        "kind": "rectangle", "x": [-8, 8], "y": [-6, 0], "size": 1.5,
        "near": [{"at": [0, 0], "size": 0.3}],
    },
    "supports": {"bottom": "xy"},
}  # fmt: skip

SCENE: dict[str, Any] = {
    "name": "ends",
    "summary": "a body that ends within the surface on which it is pressed",
    "kinematics": "plane_strain",
    "materials": {"steel": {"youngs_modulus": 2e5, "poisson_ratio": 0.3}},
    "bodies": {"lower": LOWER},
    "contacts": [{"name": "pair", "slave": "lower.top", "master": "tool.face", "friction": 0.1}],
    "stages": [{"name": "pressed", "increments": 2}],
    "results": {
        "samples": 21,
        "lines": {"slant": {"body": "lower", "start": [0.0, -1.0], "end": [3.0, -2.5]}},
    },
}

ARC = {"kind": "arc", "centre": [0.1, 25], "radius": 25, "angles": [-99.5, -79.7]}
FLAT = {"kind": "line", "points": [[-4.5, 0], [4.7, 0]]}


def pressed(master: str, sliding: str) -> Record:
    """The record of a tool or a pad on a wider body, with every number of contact and line."""
    tables = json.loads(json.dumps(SCENE))
    tables["contacts"][0]["sliding"] = sliding
    if master == "pad":
        tables["bodies"]["pad"] = {
            "material": "steel", "shape": {"kind": "rectangle", "x": [-4.4, 4.6], "y": [0, 3],
                                           "size": 0.7},
        }  # fmt: skip
        tables["loads"] = [
            {"body": "pad", "kind": "displacement", "boundary": "top", "x": 0.01, "y": -0.01}
        ]
        tables["contacts"][0]["master"] = "pad.bottom"
    else:
        face = {"arc": ARC, "flat": FLAT}[master]
        tables["rigid"] = {
            "tool": {"surfaces": {"face": face}, "x": {"moved": 0.01}, "y": {"moved": -0.03}}
        }
    numbers: list[dict[str, str]] = [
        {"of": of, "contact": "pair"} for of in ("pressure", "shear", "gap", "slip")
    ]
    # strain across a plane is zero up to rounding, which decides where it is above
    numbers += [{"of": of, "line": "slant"} for of in ("strain.zz", "plastic_strain", "stress.xy")]
    tables["outputs"] = {
        f"n{k}": number | {"take": take, "stage": "pressed"}
        for k, (number, take) in enumerate((n, t) for n in numbers for t in TAKES)
    }
    scene = file_scene(Description("ends.toml", tables, {}))
    (record,) = scene.path(scene.parameters(), [0.0], lambda share: None)
    return record


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("master", ["arc", "flat", "pad"])
def test_numbers_of_a_contact_whose_master_ends_are_compared(master: str, sliding: str) -> None:
    record = pressed(master, sliding)
    assert record.scalars["n12"] > 0.0  # the largest slip


@pytest.mark.parametrize("element", ["quad8", "tri6"])
def test_the_resultant_of_a_pressure_around_an_axis_is_exact(element: str) -> None:
    """It depends on the ends of the boundary alone: pi R^2 p, on curved edges too."""
    radius, load = 5.0, Pressure(boundary="right", value=10.0)
    ring = sector(
        np.linspace(1.0, radius, 4), 6, element, material=steel(), kinematics="axisymmetric",
        loads=(load,),
    )  # fmt: skip
    total = PlainBody(Discretisation(ring)).applied(1.0)[0]
    assert total[1] == pytest.approx(-10.0 * pi * radius**2, rel=1e-12)


def test_an_elastic_pass_is_as_exact_however_high_the_yield_stress() -> None:
    """The roller's creepage is sought: the passes of this search begin from the strains of others.

    A residual of 1e-4 of the yield stress would be a tenth of the stress, for the higher of both.
    """
    scene, maps = SCENES["rolling"], []
    for yield_stress in (1e6, 1e4):
        parameters: Any = scene.parameters(
            youngs_modulus=2e5, wheel_stiffness=3.2, poisson_ratio=0.3, radius=25.0,
            yield_stress=yield_stress, load_ratio=300.0 / yield_stress, friction=0.05,
            element_size=0.02, growth=1.3,
        )  # fmt: skip
        (record,) = scene.path(parameters, [parameters.passes], lambda share: None)
        maps.append(record.fields["map_mises"][1])
    assert maps[0] == pytest.approx(maps[1], rel=1e-6, abs=1e-4, nan_ok=True)
