"""Bodies whose strain is large in a region: closed forms, windows, audit, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import solver.loading.stepper as stepper
from solver import (
    Body,
    ContactPair,
    Displacement,
    InitialStress,
    Material,
    Model,
    ModelError,
    PathControl,
    Pressure,
    RigidBody,
    Temperature,
    Traction,
    solve,
)
from solver.mesh import grid, marked
from solver.model.loads import BodyForce
from solver.model.rigid import line
from solver.results.record import Record, Status
from studies.scenes.registry import scene_named

pytestmark = pytest.mark.solves

E = 2e5
STEEL = Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=300.0,
                 hardening="isotropic", hardening_ratio=0.01)  # fmt: skip


def bar(**fields: Any) -> Body:
    """A bar along y of two halves, of which the upper one has large strain."""
    mesh = marked(grid(np.linspace(0, 1, 3), np.linspace(0, 2, 5)), "upper", y=(1.0, 2.0))
    law = Material(youngs_modulus=E, poisson_ratio=0.3)
    given = {"name": "bar", "mesh": mesh, "material": law, "kinematics": "plane_stress",
             "element": "quad4", "strain": "large", "large_region": "upper",
             "supports": {"bottom": "y", "left": "x"}}  # fmt: skip
    return Body(**{**given, **fields})


def pressed(strain: str, **fields: Any) -> Record:
    scene = scene_named("punch")
    given = {"accuracy": "draft", "element": "quad4", "friction": 0.3, "load_ratio": 0.8571}
    parameters = scene.parameters(strain=strain, **{**given, **fields})
    (found,) = scene.path(parameters, [parameters.load_ratio], lambda _: None)
    return found


def test_a_pulled_bar_is_stretched_by_the_law_of_each_half() -> None:
    """Small strain: P / E. Large strain: P = E ln(l) / l, the force on the area before loading."""
    P, law = 0.2 * E, Material(youngs_modulus=E, poisson_ratio=0.0)
    pulled = bar(material=law, loads=(Traction(boundary="top", y=P),))
    found = solve(Model(bodies=(pulled,)), load=1.0, control=PathControl(load_step=0.2))
    stretch = brentq(lambda x: E * np.log(x) / x - P, 1.0, 2.0, xtol=1e-14)
    y, v = found.nodes("bar")[1], found.displacement("bar", "loaded")[1]
    assert v[y == 2.0] - v[y == 1.0] == pytest.approx(np.full(3, stretch - 1), rel=1e-9)
    assert v[y == 1.0] == pytest.approx(np.full(3, 0.2), rel=1e-9)


def test_windows_around_the_region_are_exact(monkeypatch: pytest.MonkeyPatch) -> None:
    inside = pressed("region")
    used: list[Any] = []
    narrowed = stepper.narrowed
    monkeypatch.setattr(stepper, "narrowed", lambda *a, **k: used.append(narrowed(*a, **k)))
    whole = pressed("region")
    assert sum(each is not None for each in used) > len(used) / 2
    assert inside.status is whole.status is Status.OK
    for name in ("residual_x_half_plane", "residual_x_punch", "plastic_work"):
        assert inside.scalars[name] == pytest.approx(whole.scalars[name], rel=1e-6)


def test_a_punch_has_the_residual_stress_of_whole_bodies_of_large_strain() -> None:
    small, region, large = (pressed(strain) for strain in ("small", "region", "large"))
    assert region.status is large.status is Status.OK
    assert region.scalars["residual_x_punch"] == pytest.approx(
        large.scalars["residual_x_punch"], abs=1.0
    )
    strains = "max_plastic_strain_half_plane", "max_plastic_strain_punch"
    for name in ("residual_x_half_plane", *strains):
        off = abs(region.scalars[name] - large.scalars[name])
        assert off < 0.1 * abs(small.scalars[name] - large.scalars[name])
    assert region.scalars["audit_large_strain"] < 0.2 * small.scalars["audit_large_strain"]


def test_strain_beside_the_region_is_reported() -> None:
    """The lower half has small strain, and is stretched by a quarter."""
    pulled = bar(material=STEEL, loads=(Displacement(boundary="top", y=0.5),))
    found = solve(Model(bodies=(pulled,)), load=1.0, control=PathControl(load_step=0.1)).audit()
    assert not found.violations
    assert any("plastic strain" in each for each in found.outside)


def test_the_elements_that_strain_are_a_region() -> None:
    """A second solution has large strain where the first one strained."""
    lines = np.linspace(0, 1, 3), np.linspace(0, 2, 9)
    small = bar(mesh=grid(*lines), material=STEEL, strain="small", large_region="",
                thickness=1.0, loads=(Displacement(boundary="top", y=0.02),))  # fmt: skip
    notched = replace(small, supports={"bottom": "xy", "top": "x", "left": "x"})
    first = solve(Model(bodies=(notched,)), load=1.0)
    assert len(first.strained("bar", beyond=0.5)) == 0
    elements = first.strained("bar", beyond=0.0101, layers=0)
    assert 0 < len(elements) < 16
    more = first.strained("bar", beyond=0.0101, layers=1)
    assert set(elements) < set(more)
    mesh = notched.mesh.with_subdomains({"near": elements})
    second = replace(notched, mesh=mesh, strain="large", large_region="near")
    assert np.flatnonzero(second.large_elements).tolist() == elements.tolist()
    assert not solve(Model(bodies=(second,)), load=1.0).audit().violations


@pytest.mark.parametrize("load", [
    BodyForce(y=-1.0), Temperature(rise=300.0, expansion=1e-5),
    InitialStress(xx=10.0),
    Pressure(boundary="top", value=100.0),
], ids=lambda load: type(load).__name__)  # fmt: skip
def test_loads_of_all_kinds_act_on_a_body_with_a_region(load: Any) -> None:
    found = solve(Model(bodies=(bar(loads=(load,)),)), load=1.0)
    assert not found.audit().violations
    assert np.abs(found.displacement("bar", "loaded")).max() > 0


def test_a_hinge_turns_the_rest_of_a_beam_by_a_small_angle() -> None:
    """The free end has little stress: what small strain neglects is small beside the hinge."""
    mesh = marked(grid(np.linspace(0, 20, 81), np.linspace(0, 1, 5)), "root", x=(0.0, 4.0))
    pushed = {"pushed": lambda x: (x[1] > 0.999) & (x[0] > 2.4) & (x[0] < 3.0)}
    mesh = mesh.with_boundaries(pushed)
    beam = bar(mesh=mesh, material=STEEL, large_region="root", supports={"left": "xy"},
               loads=(Displacement(boundary="pushed", y=-0.044),))  # fmt: skip
    found = solve(Model(bodies=(beam,)), load=1.0, control=PathControl(load_step=0.1)).audit()
    assert not found.violations
    assert not found.outside


def test_a_body_that_contact_alone_holds_is_refused() -> None:
    """Its rest has small strain, and cannot turn with it."""
    block = bar(supports={})
    lower = RigidBody(name="plate", surfaces={"face": line((2.0, 0.0), (-1.0, 0.0))})
    pair = ContactPair(slave=("bar", "bottom"), master=("plate", "face"))
    with pytest.raises(ModelError, match="contact alone holds"):
        solve(Model(bodies=(block,), rigid=(lower,), contacts=(pair,)), load=1.0)


def region(elements: Any) -> Any:
    mesh = grid(np.linspace(0, 1, 3), np.linspace(0, 2, 5))
    return mesh.with_subdomains({"upper": np.asarray(elements)})


@pytest.mark.parametrize(("fields", "field", "allowed"), [
    ({"strain": "small"}, "large_region", "left out"),
    ({"large_region": "lower"}, "large_region", "upper"),
    ({"mesh": region([])}, "large_region", "empty"),
    ({"mesh": region(range(8))}, "large_region", "all of the body"),
    ({"mesh": region([3, 99])}, "large_region", "0 to 7"),
    ({"mesh": region([-1])}, "large_region", "0 to 7"),
    ({"loads": (Pressure(boundary="right", value=1.0),)}, "pressure", "not both"),
])  # fmt: skip
def test_regions_that_cannot_be_are_refused(
    fields: dict[str, Any], field: str, allowed: str
) -> None:
    with pytest.raises(ModelError, match=allowed) as error:
        bar(**fields)
    assert field in error.value.field


@pytest.mark.parametrize("given", [{"beyond": float("nan")}, {"layers": -1}])
def test_limits_of_a_region_are_checked(given: dict[str, Any]) -> None:
    small = bar(strain="small", large_region="", loads=(Traction(boundary="top", y=1.0),))
    with pytest.raises(ModelError, match="at least 0"):
        solve(Model(bodies=(small,)), load=1.0).strained("bar", **given)
