"""The punch as a scene file has the numbers of the built-in scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver import SCENES, Record, Status
from studies.scenes.scene import read_scene

pytestmark = pytest.mark.solves

HERE = Path(__file__).parent


def one(scene_file: str, **values: object) -> Record:
    scene = read_scene(HERE / scene_file)
    parameters = scene.parameters(**values)
    (record,) = scene.path(parameters, [values.get(scene.branch)], lambda share: None)
    assert record.status is Status.OK, record.message
    return record


def twin(name: str, load: float, like: Record | None = None, **values: object) -> Record:
    """Return a run of a built-in scene; its map has the points of another record."""
    scene = SCENES[name]
    if like is not None:
        grid = {axis: like.coordinates[axis] for axis in ("x", "y")}
        scene = replace(
            scene, view=lambda parameters: replace(SCENES[name].view(parameters), **grid)
        )
    parameters = scene.parameters(**values)
    (record,) = scene.path(parameters, [load], lambda share: None)
    assert record.status is Status.OK, record.message
    return record


def distance(found: Record, wanted: Record, name: str) -> float:
    """Return the mean difference of two maps / mean of the second."""
    a, b = found.fields[name][1], wanted.fields[name][1]
    assert (np.isnan(a) == np.isnan(b)).all(), name
    return float(np.nanmean(np.abs(a - b)) / np.nanmean(np.abs(b)))


@pytest.mark.parametrize("rule", [pytest.param("isotropic", marks=pytest.mark.long), "kinematic"])
def test_the_punch_as_a_file_is_as_far_from_a_finer_one_as_the_built_in_scene(rule: str) -> None:
    values = {"load_ratio": 0.5714, "friction": 0.3, "hardening": rule}
    own = one("punch.toml", **values)
    known, finer = (
        twin("punch", 0.5714, own, state="plane_stress", accuracy=accuracy, **values)
        for accuracy in ("draft", "standard")
    )
    for name, share in (("residual_stress", 1.2), ("plastic_strain", 1.2), ("map_mises", 1.25)):
        mesh_error = distance(known, finer, name)
        assert distance(own, finer, name) < share * mesh_error, name
        assert distance(own, known, name) < mesh_error, name
    s, surface = known.coordinates["s"], known.fields["surface_residual"][1][1, 0]
    at = np.array([25.0, 40.0, 48.0])  # away from the corner, where stress is singular
    lines = own.fields["line_stress"][1][0, 1, 0], own.fields["line_x"][1][0]
    found, wanted = np.interp(at, lines[1], lines[0]), np.interp(at, s, surface)
    assert found == pytest.approx(wanted, abs=0.02 * np.abs(surface[np.isfinite(surface)]).max())
    peak = known.scalars["peak_contact_pressure"]
    middle = np.interp(25.0, own.fields["contact_x"][1][0], own.fields["contact_pressure"][1][0, 0])
    same = np.interp(25.0, s, known.fields["contact_pressure"][1][0])
    assert middle == pytest.approx(same, abs=0.002 * peak)
