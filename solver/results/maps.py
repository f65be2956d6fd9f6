"""Maps, outlines, depth profiles, surfaces: residual stress, plastic strain, stress under load."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from solver.results.body_fields import BODY_FIELDS, STORED
from solver.results.mesh_fields import counterclockwise
from solver.results.outputs import output
from solver.results.quantities import Quantity, declare, declare_along
from solver.results.run import FinishedRun, Values
from solver.tensors import AXES, stress_difference
from solver.typing import Array, Ints

_MAP = ("y", "x")
"""Dimensions of a map: vertical, horizontal; a section has others, see `_on_map`."""

RESIDUAL_STRESS = declare("residual_stress", "residual stress", "MPa", dims=("component", *_MAP))
PLASTIC_STRAIN = declare("plastic_strain", "equivalent plastic strain after unloading", dims=_MAP)
MAP_FIELDS = {
    name: declare(
        f"map_{name}", BODY_FIELDS[name].long_name, BODY_FIELDS[name].units,
        dims=("stage", *filter(None, [BODY_FIELDS[name].over]), *_MAP),
    )
    for name in STORED
}  # fmt: skip
"""Variables on the map in every stage, by field."""
STRESS_DIFFERENCE = declare(
    "stress_difference",
    "difference of the principal stresses in the plane under load", "MPa", dims=_MAP,
)  # fmt: skip
RESIDUAL_PROFILE = declare(
    "residual_profile", "residual stress along depth", "MPa",
    dims=("station", "component", "depth"),
)  # fmt: skip
PROFILE_PLASTIC_STRAIN = declare(
    "profile_plastic_strain",
    "equivalent plastic strain along depth after unloading",
    dims=("station", "depth"),
)
SURFACE_RESIDUAL = declare(
    "surface_residual", "residual stress at the contact surface", "MPa",
    dims=("body", "component", "s"),
)  # fmt: skip
SURFACE_MISES = declare(
    "surface_mises", "von Mises stress at the surface of the lower body", "MPa",
    dims=("stage", "s"),
)  # fmt: skip
HOOP_STRESS = declare(
    "hoop_stress", "hoop stress along the contact under load", "MPa", dims=("body", "s")
)


@output("maps", "map")
def maps(run: FinishedRun) -> Values:
    """Return maps of residual stress, plastic strain and, in every stage, von Mises stress.

    If the bodies are not unloaded at the end, stress and plastic strain are those of every stage.
    """
    if not run.view.unloaded:
        return _staged(run, "stress", "mises", "plastic_strain")
    samples = run.samples
    residual = {
        RESIDUAL_STRESS: samples.on_map("stress", run.unloaded),
        PLASTIC_STRAIN: samples.on_map("plastic_strain", run.unloaded),
    }
    return _on_map(run, residual) | _staged(run, "mises")


@output("strains", "map")
def strains(run: FinishedRun) -> Values:
    """Return maps of the components of strain and of plastic strain in every stage."""
    return _staged(run, "strain", "plastic_tensor")


def _staged(run: FinishedRun, *names: str) -> dict[Quantity, Any]:
    """Return maps of fields in every stage."""
    on_map = run.samples.on_map
    return _on_map(
        run,
        {MAP_FIELDS[n]: np.stack([on_map(n, at) for at, _ in run.stages]) for n in names},
    )


@output("isochromatics", "map")
def isochromatics(run: FinishedRun) -> Values:
    """Return the map whose contours are isochromatics: twice the largest shear in the plane."""
    stress = run.samples.on_map("stress", run.loaded)
    return _on_map(run, {STRESS_DIFFERENCE: stress_difference(stress, run.view.map_axes)})


def _on_map(run: FinishedRun, values: Values) -> dict[Quantity, Any]:
    """Return the values with the map axes of the view as their last two dimensions."""
    across, up = run.view.map_axes
    return {each.at(*each.dims[:-2], up, across): value for each, value in values.items()}


@output("profiles", "profile", "release")
def profiles(run: FinishedRun) -> Values:
    """Return residual stress and plastic strain along depth."""
    return {
        RESIDUAL_PROFILE: run.samples.profile("stress", run.unloaded).swapaxes(0, 1),
        PROFILE_PLASTIC_STRAIN: run.samples.profile("plastic_strain", run.unloaded),
    }


@output("surfaces", "s", "surfaces", "release")
def surfaces(run: FinishedRun) -> Values:
    """Return residual stress along the contact surfaces, and von Mises stress of the lower one."""
    samples, bodies = run.samples, run.view.surfaces
    return {
        SURFACE_RESIDUAL: np.stack([samples.on_surface("stress", b, run.unloaded) for b in bodies]),
        SURFACE_MISES: np.stack([samples.surface_mises(at, x) for at, x in run.stages]),
    }


@output("hoop_stress", "s", "surfaces")
def hoop_stress(run: FinishedRun) -> Values:
    """Return the hoop stress along the contact surface of each body."""
    sides = [run.samples.on_surface("stress", body, run.loaded)[2] for body in run.view.surfaces]
    return {HOOP_STRESS: np.stack(sides)}


OUTLINE = declare("outline", "number of a point of the outlines", dims=("outline",), count=True)
OUTLINE_AT = declare_along(
    "outline_{}", "position along {} of a point of the outlines before loading, NaN between them",
    "mm", dims=("outline",),
)  # fmt: skip
_STRAIGHT = 1e-9
"""Sine of the angle between two edges: their common point is left out at a smaller angle."""


def outlines(run: FinishedRun) -> Values:
    """Return the outlines of all bodies in the plane of the map; empty without a map.

    A curve ends at its first point, and has its body on the left. NaN separates two curves.
    """
    if not all(axis.size for axis in run.view.map_grid):
        return {}
    rows = [AXES.index(axis) for axis in run.view.map_axes]
    curves: list[Array] = []
    for name in run.system.names:
        whole = run.system.full(name)
        curves += closed_curves(whole.X[rows], whole.basis.element_dofs.T)
    gaps = [np.hstack([curve, np.full((2, 1), np.nan)]) for curve in curves]
    points = np.hstack(gaps)[:, :-1]
    along = {OUTLINE_AT[row]: points[k] for k, row in enumerate(rows)}
    return {OUTLINE: np.arange(points.shape[1]), **along}


def closed_curves(X: Array, cells: Ints) -> Iterator[Array]:
    """Yield the border of a mesh as closed curves (2, n), without points on straight pieces.

    Parameters
    ----------
    X : (2, n_nodes) positions [mm]
    cells : (n_cells, k) nodes of elements: corners, mid-sides, middle
    """
    corners = 3 if cells.shape[1] in (3, 6) else 4
    cells = counterclockwise(cells, X)
    start, end = cells[:, :corners], np.roll(cells[:, :corners], -1, axis=1)
    bent = cells.shape[1] >= 2 * corners
    middle = cells[:, corners : 2 * corners] if bent else start
    n = X.shape[1]
    alone = ~np.isin(start * n + end, end * n + start)  # no other element has the edge
    after: dict[int, list[tuple[int, int]]] = {}
    for a, m, b in zip(*(each[alone].tolist() for each in (start, middle, end)), strict=True):
        after.setdefault(a, []).append((m, b))
    while after:
        a = next(iter(after))
        nodes = [a]
        while a in after:
            m, b = after[a].pop()
            if not after[a]:
                del after[a]
            nodes += [m, b] if bent else [b]
            a = b
        yield _without_straight(X[:, nodes])


def _without_straight(curve: Array) -> Array:
    """Return a closed curve (2, n) without points on its straight pieces."""
    ahead = np.diff(curve, axis=1)
    before = np.roll(ahead, 1, axis=1)
    turn = ahead[0] * before[1] - ahead[1] * before[0]
    size = np.hypot(*ahead) * np.hypot(*before)
    kept = curve[:, :-1][:, np.abs(turn) > _STRAIGHT * size]
    return np.hstack([kept, kept[:, :1]])
