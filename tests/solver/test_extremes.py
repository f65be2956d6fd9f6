"""The extreme residual stresses are those of the nodes, and are where they are said to be."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver.results.record import Record
from solver.tensors import components
from studies.scenes.registry import scene_named

pytestmark = pytest.mark.solves

SIGNS = {"max": 1.0, "min": -1.0}


@cache
def computed(name: str) -> Record:
    """Return a run of a scene that leaves residual stress."""
    scene = scene_named(name)
    parameters = scene.parameters(accuracy="draft", hardening="isotropic")
    load = {"punch": 0.8571}.get(name, getattr(parameters, scene.branch))
    (found,) = scene.path(parameters, [load], lambda fraction: None)
    return found


@pytest.mark.parametrize("name", ["punch", "ball"])
@pytest.mark.parametrize("most", SIGNS)
def test_the_extreme_of_a_body_is_at_one_of_its_nodes(name: str, most: str) -> None:
    record = computed(name)
    assert record.mesh is not None
    mesh = record.mesh()
    stress = mesh.stages["unloaded"]["stress"]
    for number, body in enumerate(record.coordinates["body"]):
        nodes = np.unique(mesh.bodies[body][1])
        for c in range(len(components(4))):
            value, x, y = (
                record.fields[f"residual_{most}{place}"][1][number, c] for place in ("", "_x", "_y")
            )
            assert value == SIGNS[most] * (SIGNS[most] * stress[c, nodes]).max()
            if np.isfinite(x):
                at = nodes[np.hypot(mesh.X[0, nodes] - x, mesh.X[1, nodes] - y) == 0.0]
                assert value == pytest.approx(
                    stress[c, at].max() if most == "max" else stress[c, at].min(), rel=1e-6
                )
    assert np.isfinite(record.fields[f"residual_{most}_x"][1][:, 0]).all()


@pytest.mark.parametrize("most", SIGNS)
def test_the_extreme_of_the_surface_is_where_the_surface_has_it(most: str) -> None:
    record = computed("punch")
    s, line = record.coordinates["s"], record.fields["surface_residual"][1]
    for number, stress in enumerate(line[:, 0]):
        value, at = (
            record.fields[f"surface_residual_{most}{place}"][1][number, 0] for place in ("", "_s")
        )
        there = np.isfinite(stress)
        scale = np.abs(stress[there]).max()
        if most == "max" or np.isfinite(at):  # there may be no compression
            assert np.interp(at, s[there], stress[there]) == pytest.approx(value, abs=0.1 * scale)
        assert SIGNS[most] * value >= (SIGNS[most] * stress[there]).max() - 1e-9 * scale
