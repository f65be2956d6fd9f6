"""What stacked bodies must satisfy, computed again without the solver's contact and audit code.

From the solver come displacements, stress and internal variables at the integration points, and
the contact forces. What internal forces leave at a node after the applied ones is what contact
and supports put there: nothing at free nodes; at those of a contact surface, the resultant of
the contact forces, opposite on both sides. Surfaces are level (y constant) before loading. The
gap under each hat of a slave is integrated here. Every figure is 0 for a perfect answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.mesh.elements import element_type
from tests.stability.closed import passed
from tests.stability.kinds.punch_oracle import law
from tests.stability.trial import Figure

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from solver import ContactPair, Solution, System
    from solver.contact.state import Converged

    Array = NDArray[np.float64]

LIMITS = {
    "free nodes": 1e-6,  # force at free nodes over the force level, loaded and unloaded
    "resultant y": 1e-7,  # of contact forces against that of stress, over the force level
    "resultant x": 1e-6,  # the same along the surface, or its moment about a held edge
    "applied": 1e-7,  # contact resultant against what is applied above it
    "tension": 0.0,  # negative contact force over the force level
    "cone": 1e-7,  # friction beyond its bound over the force level
    "overlap": 1e-7,  # negative gap over the largest displacement
    "complementarity": 1e-7,  # force times gap, over force level times largest displacement
    "left over": 0.0,  # contact force after unloading
    "yield": 1e-7,
    "law": 1e-8,
    "state": 1e-8,
    "dissipation": 1e-9,
}


def judge(solution: Solution, applied: Mapping[int, float]) -> dict[str, Figure]:
    """Return the figures; ``applied`` is the vertical force above a pair, where known [N]."""
    system, loaded = solution.system, solution.loaded
    model = system.model
    level = max(_norm(system.full(b.name).external(loaded.state.time)) for b in model.bodies)
    level = max([level, *(abs(f) for f in applied.values())])
    travel = max(float(np.abs(solution.displacement(b.name, "loaded")).max()) for b in model.bodies)
    found = dict.fromkeys(LIMITS, 0.0)

    def worst(name: str, value: float) -> None:
        # a NaN is kept: it is right within no limit
        found[name] = value if not value <= found[name] else found[name]

    for converged in (loaded, solution.unloaded):
        for body in model.bodies:
            free, surfaces = _left_over(system, body.name, converged)
            worst("free nodes", free / level)
            for name, value in law(system, body.name, converged).items():
                worst(name, value)
            if converged is loaded:
                for name, value in surfaces.items():
                    worst(name, value / level)
    for k, pair in enumerate(model.contacts):
        contact = loaded.state.contacts[k]
        N, T = contact.normal, contact.tangential
        gap = mean_gaps(system, pair, k, loaded)
        worst("tension", -float(N.min()) / level)
        worst("cone", float((np.abs(T) - pair.friction * N).max()) / level)
        worst("overlap", -float(gap.min()) / travel)
        open_or_not = np.where(np.isfinite(gap), gap, 1e300 * (N > 0))
        worst("complementarity", float(np.abs(N * open_or_not).max()) / (level * travel))
        if k in applied:
            worst("applied", abs(float(N.sum()) - applied[k]) / applied[k])
    for contact in solution.unloaded.state.contacts:
        worst("left over", float(np.abs([contact.normal, contact.tangential]).max()))
    worst("dissipation", -solution.tally.plastic_work / (level * travel))
    across, along = tilt(solution)
    more = dict.fromkeys(("overlap", "complementarity", "resultant y", "applied"), across)
    more["resultant x"] = along
    limits = {name: limit + more.get(name, 0.0) for name, limit in LIMITS.items()}
    return {"audit": passed(solution)} | {n: Figure(found[n], limits[n]) for n in LIMITS}


def tilt(solution: Solution) -> tuple[float, float]:
    """Return what tilted normals change in resultants, for level surfaces that slide.

    A normal tilted by theta carries ``N (1 - cos theta)`` less, and the friction on it
    ``mu N sin theta``, across the surface; along it, ``N sin theta``. A point that moved along by
    v has ``mu N v`` more moment about a held edge.
    """
    across, along = 0.0, 0.0
    for pair in solution.system.model.contacts:
        if pair.sliding == "finite":
            theta, moved = 0.0, 0.0
            for side in (pair.slave, pair.master):
                nodes = _chain(solution.system, side)
                x, y = solution.nodes(side[0])[:2, nodes]
                u = solution.displacement(side[0], "loaded")[:, nodes]
                theta = max(
                    theta, float(np.abs(np.diff(u[1]) / np.hypot(np.diff(x), np.diff(y))).max())
                )
                moved = max(moved, float(np.abs(u[0]).max() / np.ptp(x)))
            across = max(across, theta**2 + pair.friction * theta)
            along = max(along, theta + pair.friction * moved)
    return across, along


def _norm(force: Array) -> float:
    return max(abs(float(force[0::2].sum())), abs(float(force[1::2].sum())))


def _chain(system: System, side: tuple[str, str]) -> Array:
    """Return the node numbers of a boundary, by x."""
    part = system.full(side[0])
    nodes = part.boundary_nodes(side[1])
    return nodes[np.argsort(part.X[0, nodes])]


def _left_over(system: System, name: str, converged: Converged) -> tuple[float, dict[str, float]]:
    """Return the force at free nodes, and by how much resultants at surfaces differ [N]."""
    part = system.full(name)
    force = part.undeformed.internal_force(system.state(name, converged).stress)
    force -= part.external(converged.state.time)
    rest = force.copy()
    rest[np.setdiff1d(np.arange(part.n), part.free)] = 0.0
    held = np.setdiff1d(np.arange(part.n), part.free)
    sides: dict[str, list[tuple[int, bool]]] = {}
    for number, pair in enumerate(system.model.contacts):
        for side, is_slave in ((pair.slave, True), (pair.master, False)):
            if side[0] == name:
                sides.setdefault(side[1], []).append((number, is_slave))
    miss = {"resultant x": 0.0, "resultant y": 0.0}
    for boundary, members in sides.items():
        nodes = _chain(system, (name, boundary))
        rest[2 * nodes], rest[2 * nodes + 1] = 0.0, 0.0
        # about the edge that is held along x, whose reaction is not known
        origin = part.X[0, np.intersect1d(2 * nodes, held) // 2]
        wanted = np.zeros(2)
        for number, is_slave in members:
            wanted += _resultant(system, converged, number, is_slave, origin)
        arm = part.X[0, nodes] - origin[0] if len(origin) else np.ones(len(nodes))
        size = float(np.abs(arm).max())
        along = abs(float(force[2 * nodes] @ arm) - wanted[0]) / size
        miss["resultant x"] = max(miss["resultant x"], along)
        across = abs(float(force[2 * nodes + 1].sum()) - wanted[1])
        miss["resultant y"] = max(miss["resultant y"], across)
    return float(np.abs(rest).max()), miss


def _resultant(
    system: System, converged: Converged, number: int, is_slave: bool, origin: Array
) -> Array:
    """Return the contact force on a side: along x (or its moment about ``origin``), along y."""
    pair, contact = system.model.contacts[number], converged.state.contacts[number]
    part = system.full(pair.slave[0])
    nodes = _chain(system, pair.slave)
    up = -1.0 if part.X[1, nodes].mean() < part.X[1].mean() else 1.0  # outward normal
    sign = 1.0 if is_slave else -1.0
    # vertices of a chain with the body on its left go along x below the body, back above it
    T = contact.tangential if up < 0 else contact.tangential[::-1]
    arm = np.ones_like(T)
    if len(origin):
        x, weight, hats = _points(system, pair, converged)
        area = hats @ weight
        mean = np.divide(hats @ (weight * x), area, out=np.zeros_like(area), where=area > 0)
        arm = mean - origin[0]
    return sign * np.array([-up * float(T @ arm), -up * float(contact.normal.sum())])


def _points(system: System, pair: ContactPair, converged: Converged) -> tuple[Array, Array, Array]:
    """Return x, weights and hats (n, points) of points on a slave where it faces the master."""
    slave = system.full(pair.slave[0])
    nodes, opposite = _chain(system, pair.slave), _chain(system, pair.master)
    stride = 2 if element_type(slave.body.element).quadratic else 1
    x = slave.X[0, nodes[::stride]]
    other = system.full(pair.master[0]).X[0, opposite]
    if pair.sliding == "finite":  # where on the slave the master's nodes are now
        here, there = (
            system.displacement(side[0], converged.state)[2 * of]
            for side, of in ((pair.slave, nodes), (pair.master, opposite))
        )
        before, now = slave.X[0, nodes], slave.X[0, nodes] + here
        other = _through(now, before, other + there)
    low, high = max(x[0], other[0]), min(x[-1], other[-1])
    cuts = np.unique(np.concatenate([x, other]))
    cuts = cuts[(cuts >= low) & (cuts <= high)]
    cuts = cuts[np.append(True, np.diff(cuts) > 1e-9 * (high - low))]
    xi, w = np.polynomial.legendre.leggauss(4)
    at = (cuts[:-1, None] + cuts[1:, None]) / 2 + np.diff(cuts)[:, None] / 2 * xi
    weight = (np.diff(cuts)[:, None] / 2 * w * np.ones_like(at)).ravel()
    at = at.ravel()
    weight = weight * (2 * np.pi * at if slave.body.kinematics == "axisymmetric" else 1.0)
    hats = np.stack([np.interp(at, x, row) for row in np.eye(len(x))])
    return at, weight, hats


def _through(known: Array, values: Array, at: Array) -> Array:
    """Return values linear between known places, and beyond them on the last lines."""
    inside = np.interp(at, known, values)
    below = values[0] + (at - known[0])
    above = values[-1] + (at - known[-1])
    return np.where(at < known[0], below, np.where(at > known[-1], above, inside))


def mean_gaps(system: System, pair: ContactPair, number: int, converged: Converged) -> Array:
    """Return the mean gap under each hat, in the order of the contact's vertices; inf beyond."""
    slave = _chain(system, pair.slave)
    part = system.full(pair.slave[0])
    x, weight, hats = _points(system, pair, converged)
    moved = [_heights(system, side, converged, x) for side in (pair.slave, pair.master)]
    finite = pair.sliding == "finite"
    if finite:  # the master's point is under where the slave's has gone
        along = moved[0][1]
        moved[1] = _heights(system, pair.master, converged, x + along, current=True)
    above = part.X[1, slave].mean() < part.X[1].mean()
    gap = (moved[0][0] - moved[1][0]) * (1.0 if above else -1.0)
    area = hats @ weight
    mean = np.divide(hats @ (weight * gap), area, out=np.full_like(area, np.inf), where=area > 0)
    mean[area < 2e-3 * area.max()] = np.inf
    return mean if above else mean[::-1]


def _heights(
    system: System, side: tuple[str, str], converged: Converged, x: Array, *, current: bool = False
) -> tuple[Array, Array]:
    """Return the height of a displaced surface, and its motion along x, at positions x."""
    part, nodes = system.full(side[0]), _chain(system, side)
    u = system.displacement(side[0], converged.state).reshape(-1, 2)[nodes]
    X, y = part.X[0, nodes], part.X[1, nodes] + u[:, 1]
    quadratic = element_type(part.body.element).quadratic
    place = X + u[:, 0] if current else X
    stride = 2 if quadratic else 1
    ends = place[::stride]
    edge = np.clip(np.searchsorted(ends, x) - 1, 0, len(ends) - 2)
    first = stride * edge
    left, right = place[first], place[first + stride]
    xi = 2 * (x - left) / (right - left) - 1
    if not quadratic:
        N = np.stack([(1 - xi) / 2, (1 + xi) / 2])
        at = np.stack([first, first + 1])
    else:
        at = np.stack([first, first + 2, first + 1])
        for _ in range(4):  # the middle node need not stay in the middle
            N = np.stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2])
            slope = (np.stack([xi - 0.5, xi + 0.5, -2 * xi]) * place[at]).sum(axis=0)
            xi = xi - ((N * place[at]).sum(axis=0) - x) / slope
        N = np.stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2])
    return (N * y[at]).sum(axis=0), (N * u[at, 0]).sum(axis=0)
