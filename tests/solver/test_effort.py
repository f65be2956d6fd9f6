"""What a scene tells of the work of a path is what the solver then makes and walks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from solver.contact.system import System
from solver.rolling.scenes.rolling_endless import rim_of, track_for
from solver.scenes import Scene
from solver.shipped import SCENES
from tests.counted import counted

COARSE = {"smallest_element": 0.02, "growth": 2.0}
ROUGH = {"element_size": 4.0, "growth": 1.5, "advance_step": 5.0, "track": 50.0}
ENDLESS: dict[str, Any] = {"element_size": 2.5, "growth": 1.5}
CASES: list[tuple[str, dict[str, Any]]] = [
    ("punch", COARSE),
    ("punch", COARSE | {"element": "quad9", "friction": 0.3}),
    ("punch", COARSE | {"element": "quad4", "half_plane_size": 20.0}),
    ("punch", COARSE | {"element": "tri6", "half_width": 7.0}),
    ("punch", COARSE | {"element": "tri3", "punch_height": 4.0}),
    ("punch", COARSE | {"elastic_punch": True}),
    ("punch", {"smallest_element": 0.003, "growth": 1.6}),
    ("rolling", ROUGH),
    ("rolling", ROUGH | {"load": "hertz", "friction": 0.0}),
    ("rolling", ROUGH | {"traction": 0.5, "element": "quad4"}),
    ("rolling", ROUGH | {"traction": 1.0, "radius": 200.0, "element_size": 2.0}),
    ("rolling", ROUGH | {"control": "creepage", "given_creepage": -0.01, "track": 33.0}),
    ("rolling", ROUGH | {"friction": 0.0, "element_size": 3.0, "load_ratio": 2.0}),
]


def parts(scene: Scene, changes: dict[str, Any]) -> tuple[Any, Callable[..., Any]]:
    assert scene.effort is not None
    return scene.parameters(**changes), scene.effort


@pytest.mark.parametrize(("name", "changes"), CASES)
def test_elements_and_unknowns_are_those_of_the_system(name: str, changes: dict[str, Any]) -> None:
    scene = SCENES[name]
    parameters, effort = parts(scene, changes)
    system = System(scene.model(parameters))
    told = effort(parameters, [getattr(parameters, scene.branch)])
    assert told.elements == sum(body.mesh.nelements for body in system.model.bodies)
    assert told.unknowns == system.n_unknowns


@pytest.mark.parametrize("changes", [{}, {"load": "hertz", "load_ratio": 2.0, "growth": 1.2}])
def test_those_of_a_track_without_ends_are_told_too(changes: dict[str, Any]) -> None:
    parameters, effort = parts(SCENES["rolling"], ENDLESS | changes)
    track = track_for(parameters)
    wheel = rim_of(parameters).wheel.whole.body.mesh.nelements if not changes else 0
    told = effort(parameters, [1])
    assert told.elements == track.part.body.mesh.nelements + wheel
    assert told.unknowns == len(track.part.free)


@pytest.mark.solves
@pytest.mark.parametrize(
    ("name", "changes", "values"),
    [
        ("punch", COARSE | {"yield_stress": 300.0}, [0.5]),
        ("punch", COARSE | {"friction": 0.2, "unload_steps": 3}, [0.9, 0.6]),
        ("rolling", ROUGH | {"load": "hertz", "friction": 0.0, "track": 25.0}, [1, 2]),
        ("rolling", ENDLESS, [2, 5]),
        ("rolling", ROUGH | {"load": "hertz", "press_steps": 3, "advance_step": 8.0}, [1]),
    ],
)
def test_increments_are_those_that_are_walked(
    name: str, changes: dict[str, Any], values: list[float]
) -> None:
    scene = replace(SCENES[name], increment_error=math.inf)  # none is divided
    parameters, effort = parts(scene, changes)
    calls: list[float] = []
    (*_, last) = scene.path(parameters, values, calls.append)
    told = effort(parameters, values)
    assert last.status.name == "OK"
    assert last.scalars["cut_increments"] == 0
    assert last.scalars["degrees_of_freedom"] == told.unknowns
    assert len(calls) == told.increments + 1  # the end is told too
    assert told.most_increments == told.increments


def test_halving_of_increments_is_told_as_the_most_there_can_be() -> None:
    parameters, effort = parts(SCENES["rolling"], ROUGH | {"passes": 3, "advance_tolerance": 1e-9})
    told = effort(parameters, [3])
    fixed, rolled = 8 + 4, 10
    assert told.increments == 3 * (fixed + rolled)
    assert told.most_increments == 9 * fixed + rolled * (127 + 2 * 64)


def test_passes_until_a_state_is_decided_are_few_at_least_and_all_at_most() -> None:
    scene = SCENES["rolling"]
    found = [
        scene.effort(scene.parameters(passes=600, until=until), [600])
        for until in ("passes", "decided")
    ]
    assert [(each.increments, each.most_increments) for each in found] == [(600, 600), (3, 600)]


@pytest.mark.parametrize(
    ("name", "branch"),
    [("punch", [0.3, 0.6]), ("rolling", [1, 2, 3])],
)
def test_effort_takes_microseconds(name: str, branch: list[float]) -> None:
    """A hundred paths that differ in what decides the mesh, then as many that do not."""
    one = "half_width" if "punch" in name else "radius"
    meshes = [{one: 300.0 + k} for k in range(100)]
    for changes in (meshes, [{"friction": k / 200} for k in range(100)]):
        known = [parts(SCENES[name], each) for each in changes]
        with counted() as calls:
            for parameters, effort in known:
                effort(parameters, branch)
        assert calls < 100_000, changes[0]
