"""Strain and plastic strain by component: at places, on maps, as numbers, at nodes."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from solver import Body, Material, Model, Record, Status, solve
from solver.mesh import grid
from solver.model.loads import Temperature
from solver.results.requested import of_body
from tests.studies.scenes.conftest import blocks, built

pytestmark = pytest.mark.solves

E, NU, YIELD, SLOPE = 2e5, 0.3, 300.0, 1e4
STRESS = -330.0
HARDENED = -(-STRESS - YIELD) * (1 / SLOPE - 1 / E)
"""Plastic strain yy of a block under uniaxial stress."""


def strip(kinematics: str = "plane_stress") -> dict[str, Any]:
    """Return one block under uniaxial stress beyond yield, with all kinds of places."""
    tables = blocks()
    tables["kinematics"] = kinematics
    tables["materials"]["steel"] |= {"hardening": "isotropic", "hardening_ratio": SLOPE / E}
    del tables["contacts"], tables["bodies"]["upper"], tables["parameters"]["mu"]
    del tables["parameters"]["rule"]
    tables["bodies"]["lower"]["supports"] = {"bottom": "y", "left": "x"}
    tables["loads"][0] |= {"body": "lower", "value": -STRESS}
    tables["results"] |= {
        "outputs": ["maps", "strains"],
        "map": {"x": {"start": 0.5, "stop": 3.5, "num": 3}, "y": [-1.5, -0.5]},
        "points": {"p": {"body": "lower", "at": [1.0, -1.0]}},
    }
    for name, of in {
        "thick": "strain.zz", "flat": "plastic_strain.yy", "shear": "strain.tresca",
        "least": "stress.principal_3", "on_line": "strain.yy",
    }.items():  # fmt: skip
        place = {"line": "middle"} if name == "on_line" else {"body": "lower"}
        tables["outputs"][name] = {"of": of, "take": "maximum", "stage": "pressed"} | place
    return tables


def solved(tables: dict[str, Any]) -> Record:
    scene = built(tables)
    (record,) = scene.path(scene.parameters(), [None], lambda share: None)
    assert record.status is Status.OK, record.message
    return record


def test_a_strip_has_the_strains_of_its_closed_form_at_all_places() -> None:
    record = solved(strip())
    plastic = HARDENED * np.array([-0.5, 1.0, -0.5, 0.0])
    elastic = STRESS / E * np.array([-NU, 1.0, -NU, 0.0])
    for name, own in (("plastic_tensor", plastic), ("strain", elastic + plastic)):
        for kind, axis in (("line", 2), ("point", 2), ("map", 1)):
            dims, values = record.fields[f"{kind}_{name}"]
            assert dims[axis] == "component"
            found = np.moveaxis(values, axis, -1).reshape(-1, 4)
            np.testing.assert_allclose(found, np.tile(own, (len(found), 1)), atol=1e-9)
    numbers = record.scalars
    assert numbers["thick"] == pytest.approx(elastic[2] + plastic[2], rel=1e-6)
    assert numbers["flat"] == pytest.approx(HARDENED, rel=1e-6)
    assert numbers["on_line"] == pytest.approx(elastic[1] + plastic[1], rel=1e-6)
    assert numbers["shear"] == pytest.approx(abs((elastic + plastic)[[0, 1]] @ [1, -1]), rel=1e-6)
    assert numbers["least"] == pytest.approx(STRESS, rel=1e-6)


def test_strain_is_that_of_the_displacements_with_heat_in_it() -> None:
    x = np.linspace(1.0, 3.0, 5)
    steel = Material(youngs_modulus=E, poisson_ratio=NU, yield_stress=YIELD)
    hot = Temperature(rise=lambda x: 100.0 * x[0], expansion=1.2e-5, modulus_drop=1e-3)
    for kinematics in ("axisymmetric", "plane_strain"):
        ring = Body(name="ring", mesh=grid(x, x), material=steel, kinematics=kinematics,
                    supports={"bottom": "y", "left": "x"}, loads=(hot,))  # fmt: skip
        solution = solve(Model(bodies=(ring,)))
        system, at = solution.system, solution.loaded
        own = system.state("ring", at).strain
        whole = system.full("ring")
        np.testing.assert_allclose(own, whole.strain(at.state.u[0]), atol=1e-12)
        assert np.abs(own).max() > 1e-3 and at.responses[0].yielding.any()
        nodal = solution.strain("ring", "loaded")
        places = solution.at("ring", solution.nodes("ring"), "loaded")["strain"]
        np.testing.assert_allclose(places, nodal, atol=1e-12)
        tensor = solution.plastic_tensor("ring", "loaded")
        assert tensor[:3].sum(axis=0) == pytest.approx(0.0, abs=1e-12)


def test_every_field_of_a_body_may_be_requested() -> None:
    asked = of_body(2)
    assert {"strain.xy", "plastic_strain.zz", "plastic_strain", "mises", "displacement.y"} < {
        *asked
    }
    assert "strain" not in asked and "displacement.z" not in asked
    tables = copy.deepcopy(strip())
    tables["outputs"]["thick"]["of"] = "strain.zy"
    with pytest.raises(ValueError, match=r"outputs\.thick\.of = 'strain\.zy'"):
        built(tables)
