"""Stress intensities of crack-tip elements against closed forms and the weight function."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import (
    Body,
    Displacement,
    InitialStress,
    Link,
    Material,
    Model,
    ModelError,
    PathControl,
    Pressure,
    Solution,
    Temperature,
    Traction,
    solve,
)
from solver.fatigue import stress_intensity
from solver.fracture.intensity import by_integral
from solver.mesh import graded, grid, opened
from solver.model.amplitude import Amplitude
from solver.model.loads import BodyForce, TravellingPressure
from solver.results import cracks
from studies.scenes.scene import read_scene

Array = NDArray[np.float64]
SCENE = Path(__file__).parents[2] / "data/scenes/crack.toml"
STEEL: Any = {"youngs_modulus": 2e5, "poisson_ratio": 0.3}
WIDTH, SIDE, LENGTH = 60.0, 0.05, 1.0
UNIT = np.sqrt(np.pi * LENGTH)
ONCE = PathControl(load_step=1.0)
CELLS = {"quad": "quad8", "tri": "tri6"}


def lines() -> tuple[Array, Array]:
    """Return lines of a half of a large plate, fine at the tip of an edge crack."""
    away = graded(WIDTH, SIDE, 1.3, 8.0)
    within = LENGTH - graded(LENGTH, SIDE, 1.3, 0.2)[::-1]
    return np.concatenate([within, LENGTH + away[1:]]), np.concatenate([-away[::-1], away[1:]])


def solved(cells: str, *loads: Any, cracked: bool = True, **more: Any) -> Solution:
    """Return the plate under its loads, with an edge crack or without."""
    mesh = grid(*lines(), cells)
    if cracked:
        mesh = opened(mesh, "root", (0.0, 0.0), (LENGTH, 0.0))
    body = Body(
        name="plate", mesh=mesh, material=Material(**STEEL), element=CELLS[cells], loads=loads,
        cracks=("root",) if cracked else (), supports={"right": "xy"}, **more,
    )  # fmt: skip
    return solve(Model(bodies=(body,)), control=ONCE)


@pytest.mark.parametrize("cells", CELLS)
def test_edge_crack_under_constant_and_linear_stress(cells: str) -> None:
    """1.1215 and 0.4387 of sigma sqrt(pi a): pressure on the faces (weight function, Tada).

    Displacements of the faces alone are wrong by some percent, whatever the mesh.
    """
    for factor, stress in ((1.1215, 100.0), (0.4387, lambda x: 100 * (1 - x[0]))):
        loads = (Pressure(boundary=f"root_{side}", value=stress) for side in ("left", "right"))
        solution = solved(cells, *loads)
        for rings in (1, 4, 6):
            (tip,) = solution.stress_intensities(rings=rings)
            assert tip.K[0] == pytest.approx(100 * factor * UNIT, rel=2e-3)
            assert abs(tip.K[1]) < 5e-3 * tip.K[0]
        assert tip.of_faces[0] == pytest.approx(tip.K[0], rel=0.04)
    assert tip.tip == "plate.root" and tip.at.tolist() == [LENGTH, 0.0]


@pytest.mark.parametrize("outwards", [False, True])
def test_shear_on_the_faces_of_a_crack_that_is_turned(outwards: bool) -> None:
    """1.1215 tau sqrt(pi a), positive where the upper face, seen from the tip, moves ahead."""
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    plain, tip = grid(*lines()), (LENGTH * np.cos(0.5), LENGTH * np.sin(0.5))
    ends = (tip, (0.0, 0.0)) if outwards else ((0.0, 0.0), tip)
    shear = {"left": 50 * turn[:, 0], "right": -50 * turn[:, 0]}
    body = Body(
        name="plate.1", mesh=opened(replace(plain, doflocs=turn @ plain.p), "root", *ends),
        material=Material(**STEEL), cracks=("root",), supports={"right": "xy"},
        loads=tuple(
            Traction(boundary=f"root_{side}", x=float(x), y=float(y))
            for side, (x, y) in shear.items()
        ),
    )  # fmt: skip
    (found,) = solve(Model(bodies=(body,)), control=ONCE).stress_intensities()
    sign = -1 if outwards else 1
    assert found.K == pytest.approx(np.array([0.0, sign * 50 * 1.1215 * UNIT]), rel=2e-3, abs=1e-6)
    assert found.of_faces[1] == pytest.approx(found.K[1], rel=0.09) and found.at == pytest.approx(
        np.array(tip)
    )


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize(
    "load",
    [
        InitialStress(yy=lambda x: 300 * np.cos(2.6 * x[0]) * np.exp(-x[0] / 0.8)),
        Temperature(rise=lambda x: -100 * np.exp(-x[0] / 0.7), expansion=1.2e-5),
        BodyForce(y=lambda x: -x[1]),
    ],
    ids=lambda load: load.name,
)
def test_residual_stress_has_the_intensity_of_the_weight_function(
    load: Any, kinematics: str
) -> None:
    """The stress of the body without the crack, along its line."""
    whole = solved("quad", load, cracked=False, kinematics=kinematics)
    depth = np.linspace(0.0, LENGTH, 201)
    stress = whole.at("plate", np.stack([depth, 0 * depth]), "loaded")["stress"][1]
    (expected,) = stress_intensity(depth, stress, np.array([LENGTH]))
    each = [solved("quad", load, kinematics=kinematics).stress_intensities(rings=r)[0].K[0]
            for r in (1, 5)]  # fmt: skip
    assert each == pytest.approx([expected, expected], rel=7e-3)


def under_hertz(depth: Array, x: float, a: float, peak: float, ratio: float) -> tuple[Array, Array]:
    """Return xx and xz of a half-plane at x from the centre, z downwards: Flamant's integral."""
    angle = (np.arange(400) + 0.5)[:, None] * np.pi / 400
    d = x - a * np.cos(angle)
    scale = -2 / np.pi * peak * a * np.sin(angle) ** 2 * np.pi / 400 / (d**2 + depth**2) ** 2
    along = (scale * (d**2 * depth + ratio * d**3)).sum(axis=0)
    return along, (scale * (d * depth**2 + ratio * d**2 * depth)).sum(axis=0)


@pytest.mark.parametrize("position", [3.0, 4.0, 6.0])
def test_a_hertz_pressure_that_has_passed_opens_and_shears_a_crack(position: float) -> None:
    """Weight function on the stress of the half-plane; that of K_II is the same.

    The plate is large: the stress of a force falls as one over the distance.
    """
    away = graded(6e3, SIDE, 1.3, 6e3)
    within = LENGTH - graded(LENGTH, SIDE, 1.3, 0.2)[::-1]
    x, depth = np.concatenate([-away[::-1], away[1:]]), np.concatenate([within, LENGTH + away[1:]])
    body = Body(
        name="plate", mesh=opened(grid(x, -depth[::-1]), "root", (0.0, 0.0), (0.0, -LENGTH)),
        material=Material(**STEEL), cracks=("root",), supports={"bottom": "xy"},
        loads=(TravellingPressure(
            boundary="top", half_width=2.0, peak=1000.0, position=Amplitude.constant(position),
            shear_ratio=Amplitude.constant(0.3),
        ),),
    )  # fmt: skip
    (tip,) = solve(Model(bodies=(body,)), control=ONCE).stress_intensities()
    z = np.linspace(1e-3, LENGTH, 201)
    stress = np.stack(under_hertz(z, -position, 2.0, 1000.0, 0.3))
    expected = stress_intensity(z, stress, np.array([LENGTH]))[:, 0]
    assert expected[0] > 0 and tip.K == pytest.approx(expected, rel=5e-3)


def test_an_inclined_crack_pulled_and_pressed_with_friction() -> None:
    """K_I = s sin2, K_II = s sin cos; pressed, the faces carry friction: tau - mu p, K_I = 0."""
    scene = read_scene(SCENE)
    run = scene.parameters(angle=30.0, friction=0.3, element=0.08)
    (found,) = scene.path(run, [], lambda done: None)
    assert found.status.name == "OK"
    sine, cosine = 0.5, 0.75**0.5
    K = {mode: found.fields[f"K_{mode}"] for mode in ("I", "II")}
    assert found.coordinates["tip"].tolist() == ["plate.slit.start", "plate.slit.end"]
    shear, pressure = 100 * sine * cosine, 100 * sine**2
    pulled = {"I": pressure, "II": shear}
    pressed = {"I": 0.0, "II": -(shear - 0.3 * pressure)}
    assert "overlap" not in found.message
    for mode, (dims, values) in K.items():
        assert dims == ("tip", "stage")
        expected = np.array([pulled[mode], pressed[mode]]) * UNIT
        assert values == pytest.approx(np.array([expected, expected]), rel=1e-3, abs=0.01)


def test_faces_that_overlap_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pressed, without a contact; each state has its integrals once."""
    text = "".join(
        x for x in SCENE.read_text().splitlines(keepends=True) if not x.startswith("friction = {")
    )
    before, sep, after = text.partition("[[contacts]]")
    own = tmp_path / "crack.toml"
    own.write_text(before + after.partition("\n\n")[2])
    scene, counted = read_scene(own), Mock(side_effect=by_integral)
    monkeypatch.setattr(cracks, "by_integral", counted)
    (found,) = scene.path(scene.parameters(angle=30.0, element=0.2), [], lambda done: None)
    assert sep and counted.call_count == np.size(found.fields["K_I"][1])
    for end in ("start", "end"):
        assert found.message.count(f"K_I of tip plate.slit.{end} is negative: the faces over") == 1


@pytest.mark.parametrize("cells", CELLS)
def test_nodes_at_a_tip_are_at_a_quarter_of_the_sides(cells: str) -> None:
    """Nothing else moves, and the faces have the names of the sides of one who walks along it."""
    plain = grid(*lines(), cells)
    mesh = opened(plain, "root", (0.0, 0.0), (LENGTH, 0.0))
    tip = int(np.hypot(*(mesh.p - [[LENGTH], [0.0]])).argmin())
    sides = (mesh.facets == tip).any(axis=0)
    ends, middle = mesh.p[:, mesh.facets], mesh.p[:, mesh.dofs.facet_dofs[0]]
    share = np.hypot(*(middle - mesh.p[:, [tip]])) / np.hypot(*(ends[:, 1] - ends[:, 0]))
    assert share[sides] == pytest.approx(np.full(sides.sum(), 0.25))
    assert middle[:, ~sides] == pytest.approx(ends[..., ~sides].mean(axis=1))
    count = len(np.flatnonzero(lines()[0] <= LENGTH)) - 1
    assert mesh.nvertices == plain.nvertices + count
    for side, above in (("left", 1.0), ("right", -1.0)):
        facets = mesh.boundaries[f"root_{side}"]
        inside = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
        assert len(facets) == count and (inside[1] * above > 0).all()


def test_plastic_strain_at_the_tip_is_allowed_but_not_through_the_domain() -> None:
    law = Material(**STEEL, yield_stress=400.0)
    mesh = opened(grid(*lines()), "root", (0.0, 0.0), (LENGTH, 0.0))
    loads = tuple(Pressure(boundary=f"root_{s}", value=200.0) for s in ("left", "right"))
    body = Body(name="plate", mesh=mesh, material=law, loads=loads, cracks=("root",),
                supports={"right": "xy"})  # fmt: skip
    solution = solve(Model(bodies=(body,)), control=PathControl(load_step=0.25))
    near, far = (solution.stress_intensities(rings=r)[0] for r in (1, 8))
    assert np.isnan(near.K).all() and "plastic" in near.why
    assert not far.why and far.K[0] == pytest.approx(200 * 1.1215 * UNIT, rel=0.03)


@pytest.mark.parametrize("how", ["displacement", "support", "link", "inside"])
def test_forces_of_what_holds_nodes_of_the_domain_are_not_left_out(how: str) -> None:
    mesh = opened(grid(*lines()), "root", (0.0, 0.0), (LENGTH, 0.0))
    x, y = mesh.p[:, mesh.facets].mean(axis=1)
    ahead = np.flatnonzero((np.abs(y) < 1e-9) & (x > LENGTH) & (x < LENGTH + 2 * SIDE))
    mesh = mesh.with_boundaries({**mesh.boundaries, "ahead": ahead})
    loads: tuple[Any, ...] = (Pressure(boundary="root_right", value=100.0),)
    if how == "displacement":
        loads += (Displacement(boundary="root_left", y=0.01),)
    held = {"support": {"root_left": "y"}, "inside": {"ahead": "y"}}.get(how, {})
    body = Body(name="plate", mesh=mesh, material=Material(**STEEL), loads=loads, cracks=("root",),
                supports={"right": "xy", **held})  # fmt: skip
    links = (Link(slave=("plate", "root_left"), stiffness=1e3),) if how == "link" else ()
    (found,) = solve(Model(bodies=(body,), links=links), control=ONCE).stress_intensities()
    assert np.isnan(found.K).all() and "hold nodes of the domain" in found.why


@pytest.mark.parametrize(
    ("start", "end", "words"),
    [
        ((0.0, 0.1234), (1.0, 0.1234), "along edges"),
        ((0.0, 0.0), (1.01, 0.0), "along edges"),
        ((0.0, 0.0), (WIDTH + LENGTH, 0.0), "must have a tip"),
        ((LENGTH, 0.0), (LENGTH, 0.0), "along edges"),
    ],
)
def test_a_crack_must_run_along_edges_and_end_inside(start: Any, end: Any, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        opened(grid(*lines()), "root", start, end)


def test_what_bodies_with_cracks_do_not_have_is_refused() -> None:
    mesh = opened(grid(*lines()), "root", (0.0, 0.0), (LENGTH, 0.0))
    given: Any = {"name": "plate", "mesh": mesh, "material": Material(**STEEL)}
    with pytest.raises(ModelError, match="folded"):
        Body(**given)
    wrong = {"element": "quad4", "kinematics": "axisymmetric", "strain": "large"}
    for name, value in wrong.items():
        with pytest.raises(ModelError, match=f"^{name}.*which has a crack"):
            Body(**given, **{name: value}, cracks=("root",))
