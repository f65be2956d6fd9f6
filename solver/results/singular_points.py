"""The singular points of a model, near which numbers depend on the mesh."""

from __future__ import annotations

import numpy as np

from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values

_EACH = ("singular",)
SINGULAR = declare("singular", "number of the singular point", "", dims=_EACH)
SINGULAR_X = declare("singular_x", "position of the singular point along x", "mm", dims=_EACH)
SINGULAR_Y = declare("singular_y", "position of the singular point along y", "mm", dims=_EACH)
SINGULAR_S = declare(
    "singular_s", "distance along the surface from its middle of the singular point", "mm",
    dims=_EACH,
)  # fmt: skip
SINGULAR_RADIUS = declare(
    "singular_radius", "radius around the singular point in which numbers depend on the mesh", "mm",
    dims=_EACH,
)  # fmt: skip


def singular_points(run: FinishedRun) -> Values:
    """Return positions and radii of the singular points; empty if there are none."""
    if not run.singular:
        return {}
    X = np.array([point.at for point in run.singular]).T
    return {
        SINGULAR: np.arange(len(run.singular)),
        SINGULAR_X: X[0],
        SINGULAR_Y: X[1],
        SINGULAR_S: run.view.axis.reached(X),
        SINGULAR_RADIUS: np.array([point.radius for point in run.singular]),
    }
