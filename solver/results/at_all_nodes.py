"""Fields of all bodies of a run at the nodes of their meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from solver.results.fields import Solved, SystemFields
from solver.results.mesh_fields import MeshFields, counterclockwise


def mesh_fields(
    fields: SystemFields,
    states: Mapping[str, Solved],
    beside: Callable[[], MeshFields] | None = None,
) -> MeshFields:
    """Return the fields of all bodies in the given states.

    Parameters
    ----------
    states : state at each stage
    beside : function that returns the fields of further bodies at the same stages
    """
    wholes = {name: fields.system.full(name) for name in fields.system.names}
    bodies, first = {}, 0
    for name, whole in wholes.items():
        cells = whole.basis.element_dofs.T
        if len(whole.X) == 2:  # cells in three dimensions have no orientation to correct
            cells = counterclockwise(cells, whole.X)
        bodies[name] = (whole.body.element, first + cells)
        first += whole.X.shape[1]
    stages = {}
    for stage, at in states.items():
        each = [fields.at_nodes(at, name)._asdict() for name in wholes]
        stages[stage] = {name: np.concatenate([f[name] for f in each], axis=-1) for name in each[0]}
    X = np.hstack([whole.X for whole in wholes.values()])
    found = MeshFields(X=X, bodies=bodies, stages=stages)
    return found if beside is None else found.joined(beside())
