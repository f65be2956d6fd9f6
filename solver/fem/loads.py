"""The loads of a body: nodal forces, prescribed displacements, eigenstrain, loss of stiffness.

The removal of an element lowers its stiffness gradually. The forces on its neighbours so decrease
to zero along a path with an equilibrium at every point, and their work is known. The share `_GHOST`
of the stiffness remains: the nodes follow, and the equations keep their form. The yield stress is
constant, so that the element does not yield meanwhile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from solver.errors import ModelError
from solver.fem.cells import LOBATTO, smooth_cells
from solver.fem.nodes import Dofs, Nodes, vectors
from solver.fem.surface import edges_of
from solver.materials import Law
from solver.materials.heated import Heated
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.loads import Load, checked
from solver.tensors import AXES, to_mandel
from solver.typing import Array, Bools, Ints

Push = Callable[[Array, Array], Array | None]


_ACCURATE, _HALVINGS, _MOST = 1e-9, 40, 100_000
"""Error of the nodal force of a part of an edge, over the largest nodal force: a part with a larger
one is halved, because tractions may have kinks and jumps. Most halvings in a row. Most parts:
values that are mere rounding would be halved without end."""
_SAME = 1e-9
"""Difference of two prescribed values over the larger one: they are equal up to this ratio."""


@dataclass(frozen=True)
class Superposed:
    """A sum of fields, each multiplied by the factor of its load at a time.

    Attributes
    ----------
    cases : the loads
    fields : (n, n_cases) field of each load at load factor 1
    """

    cases: tuple[Load, ...]
    fields: Array

    @classmethod
    def of(cls, size: int, each: Iterable[tuple[Load, Array]]) -> Superposed:
        """Return the fields (size,) of some loads."""
        pairs = list(each)
        fields = [np.ravel(field) for _, field in pairs]
        together = np.stack(fields, axis=1) if pairs else np.zeros((size, 0))
        return cls(tuple(load for load, _ in pairs), together)

    def factors(self, time: float) -> Array:
        """Return the load factors (n_cases,) at a time."""
        return np.array([load.factor(time) for load in self.cases])

    def at(self, time: float) -> Array:
        """Return the sum (n,) at a time."""
        return np.asarray(self.fields @ self.factors(time))

    def grows(self, before: float, after: float) -> bool:
        """Whether one of the fields grows from one time to another."""
        more = np.abs(self.factors(after)) > np.abs(self.factors(before))
        return bool((more & self.fields.any(axis=0)).any())


def nodal_forces(part: Nodes) -> Superposed:
    """Return the nodal forces (n,) of the loads on a body that do not move [N]."""
    each: list[tuple[Load, Array]] = []
    for load in part.body.every_load:
        # no load acts on faces yet
        edges = load.boundaries if part.dim == 2 and not load.moves else ()
        own = [_tractions(part, b, load.push) for b in edges]
        own.append(_body_forces(part, load))
        given = [force for force in own if force is not None]
        if given:
            each.append((load, sum(given[1:], given[0])))
    return Superposed.of(part.n, each)


def _body_forces(part: Nodes, load: Load) -> Array | None:
    """Return the nodal forces (n,) of a load's force per volume [N]; None if it has none.

    Gauss's rule integrates them on cells on which they are smooth.
    """
    if load.body_force(part.X[:, :0]) is None:
        return None

    def force(x: Array) -> Array:
        flat = x.reshape(2, -1)
        given = checked(f"{load.name}.body_force", load.body_force(flat), flat.shape, "N/mm3")
        return given.reshape(x.shape) * part.measure(x)

    basis, rule = part.basis, np.polynomial.legendre.leggauss(4)
    cells = smooth_cells(basis, force)
    local, x, area = cells.points(rule, rule)
    given, nodal = force(x) * area, np.zeros((part.X.shape[1], 2))
    for k, own in enumerate(basis.element_dofs):
        shape = np.asarray(basis.elem.lbasis(local, k)[0])
        np.add.at(nodal, own[cells.element], (given * shape).sum(axis=2).T)
    return nodal.ravel()


def prescribed(part: Nodes) -> tuple[Superposed, Bools]:
    """Return the prescribed displacements (n,) [mm], and whether an unknown is held (n,).

    Loads on one boundary add up; a support prescribes zero. Raises `ModelError` if boundaries that
    share a node prescribe different displacements at any time.
    """
    loads = [load for load in part.body.every_load if load.components]
    each, held = [(load, np.zeros(part.n)) for load in loads], np.zeros(part.n, dtype=bool)
    for axis in range(part.dim):
        prescriptions = _prescriptions(part, loads, axis)
        for k, prescription in enumerate(prescriptions):
            for other in prescriptions[:k]:
                prescription.check(other, part)
            own = prescription.dofs[~held[prescription.dofs]]
            for load, field in each:
                if load in prescription.loads:
                    field[own] = load.components[axis]
            held[own] = True
    return Superposed.of(part.n, each), held


def _prescriptions(part: Nodes, loads: Sequence[Load], axis: int) -> list[_Prescription]:
    """Return the displacements that supports and loads prescribe along an axis, by boundary."""
    still = [b for b, axes in part.body.supports.items() if AXES[axis] in axes]
    moved: dict[str, list[Load]] = {}
    for load in loads:
        if axis in load.components:
            for boundary in load.boundaries:
                moved.setdefault(boundary, []).append(load)
    both: list[tuple[str, str, list[Load]]] = [("supports", b, []) for b in still]
    both += [("displacement", b, own) for b, own in moved.items()]
    return [
        _Prescription(
            f"{kind}.{boundary}",
            Dofs(part.boundary_nodes(boundary), part.dim).along(axis),
            tuple(own),
            axis,
        )
        for kind, boundary, own in both
    ]


@dataclass(frozen=True)
class _Prescription:
    """Prescribed displacement of a boundary along one axis, by a sum of loads or by a support.

    ``name`` is the field of the body that prescribes it.
    """

    name: str
    dofs: Ints
    loads: tuple[Load, ...]
    axis: int

    def at(self, times: Array) -> Array:
        """Return the displacement (n,) at times (n,) [mm]."""
        each = (load.components[self.axis] * np.array([load.factor(t) for t in times])
                for load in self.loads)  # fmt: skip
        return sum(each, np.zeros(len(times)))

    def check(self, other: _Prescription, part: Nodes) -> None:
        """Raise `ModelError` if the two differ on a shared unknown."""
        shared = np.intersect1d(self.dofs, other.dofs)
        if not len(shared):
            return
        times = comparing([*self.loads, *other.loads])
        mine, others = self.at(times), other.at(times)
        apart = np.abs(mine - others)
        worst = int(apart.argmax())
        if apart[worst] <= _SAME * max(np.abs(mine).max(), np.abs(others).max()):
            return
        at = ", ".join(f"{x:g}" for x in part.X[:, shared[0] // part.dim])
        raise ModelError(
            f"{self.name}.{AXES[self.axis]}", float(f"{mine[worst]:g}"),
            f"must be {others[worst]:g} mm at time {times[worst]:g}, the value of {other.name} of "
            f"body {part.body.name!r}, because both boundaries have the node at ({at}) mm; or "
            "shorten one of the boundaries by an element",
        )  # fmt: skip


def comparing(loads: Sequence[Load]) -> Array:
    """Return times (n,) at which sums of amplitudes must be equal to be equal at all times.

    Amplitudes are linear between knots and may jump at knots: two times between knots are enough.
    """
    knots = [load.amplitude.time for load in loads if load.amplitude is not None]
    at = np.unique(np.concatenate([[0.0], *knots]))
    at = np.append(at, at[-1] + 1.0)
    return np.concatenate([at, *(at[:-1] + share * np.diff(at) for share in (0.25, 0.75))])


def eigenstrains(part: Nodes) -> Superposed:
    """Return the eigenstrain (components x n_points,) of the loads, Mandel.

    An initial stress s is the eigenstrain ``-C^-1 s``, which causes s in the undeformed body.
    """
    x = part.positions
    shape = (part.components, x.shape[1])
    each: list[tuple[Load, Array]] = []
    for load in part.body.every_load:
        strain, stress = load.eigenstrain(x), load.initial_stress(x)
        if strain is not None:
            each.append((load, to_mandel(checked(f"{load.name}.eigenstrain", strain, shape, "1"))))
        if stress is not None:
            stress = checked(f"{load.name}.initial_stress", stress, shape, "MPa")
            if part.body.kinematics == "plane_stress":
                _check_plane(stress)
            strain = part.body.material.elasticity.strain(to_mandel(stress))
            each.append((load, -strain))
    return Superposed.of(math.prod(shape), each)


def _check_plane(stress: Array) -> None:
    """Raise `ModelError` if an initial stress (4, n_points) has a zz component [MPa]."""
    across = np.abs(stress[2])
    if across.max(initial=0.0) > _SAME * np.abs(stress).max(initial=0.0):
        worst = float(stress[2, across.argmax()])
        raise ModelError("initial_stress.zz", worst, "must be zero in plane stress [MPa]")


def check_removed(part: Nodes, loads: Superposed) -> None:
    """Raise `ModelError` if a load acts on nodes that only removed elements have.

    ``loads`` are nodal forces [N]. A load that moves may act on all nodes of its boundaries.
    """
    acting = list(zip(loads.cases, loads.fields.T, strict=True))
    for load in (each for each in part.body.every_load if each.moves):
        reached = np.zeros(part.n)
        for boundary in load.boundaries:
            reached[Dofs(part.boundary_nodes(boundary), part.dim).every] = 1.0
        acting.append((load, reached))
    for removal in (load for load in part.body.every_load if load.removes):
        gone = np.zeros(part.basis.element_dofs.shape[1], dtype=bool)
        gone[part.body.region(removal.removes)] = True
        alone = np.ones(part.X.shape[1], dtype=bool)
        alone[part.basis.element_dofs[:, ~gone]] = False
        for load, field in acting:
            if not vectors(field, part.dim)[:, alone].any():
                continue
            after = [t for t in comparing([load, removal]) if removal.factor(t) >= 1]
            if any(load.factor(t) for t in after):
                allowed = (
                    f"acts on region {removal.removes} of body {part.body.name} after it is "
                    "removed: let it end before"
                )
                raise ModelError(load.name, load.boundaries or part.body.name, allowed)


def moving_forces(part: Nodes, loads: Iterable[Load], time: float) -> Array:
    """Return the nodal forces (n,) of loads that move at a time [N].

    Each edge has eight Gauss points: to find where a force has kinks would take longer than the
    increment, and it moves on.
    """
    force = np.zeros(part.n)
    for load in loads:
        for boundary in load.boundaries:
            load.check_at(time, part.X[:, edges_of(part, boundary)[:, :2]])
            own = _tractions(part, boundary, partial(load.push_at, time), 8)
            force += 0.0 if own is None else own
    return force


def _tractions(part: Nodes, boundary: str, push: Push, points: int = 0) -> Array | None:
    """Return the nodal forces (n,) of a traction [N]; None if ``push`` returns None.

    Parameters
    ----------
    push : (positions (2, n), tangents (2, n) with the body on their left) -> force per area times
        length of the tangent (2, n)
    points : Gauss points of each edge; 0 for four in each of as many parts as are needed
    """
    edges = edges_of(part, boundary)
    X = part.X[:, edges]
    if push(X.mean(axis=2), X[..., 1] - X[..., 0]) is None:
        return None

    def pushed(row: Ints, start: Array, width: float, at: Array, weights: Array) -> Array:
        """Return the forces (2, n, n_nodes) of parts of edges by a rule on [-1, 1]."""
        xi = start[:, None] + width * (1 + at) / 2
        N = shape_functions(xi, edges.shape[1])
        x, t = (
            np.einsum("dmk,mqk->dmq", X[:, row], each).reshape(2, -1)
            for each in (N, shape_derivatives(xi, edges.shape[1]))
        )
        given = checked(f"push on {boundary}", push(x, t), t.shape, "N/mm") * part.measure(x)
        return np.einsum("dmq,q,mqk->dmk", given.reshape(2, *xi.shape), weights * width / 2, N)

    row, start, width = np.arange(len(edges)), np.full(len(edges), -1.0), 2.0
    gauss = np.polynomial.legendre.leggauss(points or 4)
    force, largest = np.zeros((part.X.shape[1], 2)), 0.0
    for further in reversed(range(1 if points else _HALVINGS)):
        found = pushed(row, start, width, *gauss)
        halved = np.zeros(len(row), dtype=bool)
        if further and len(row) < _MOST:
            off = np.abs(found - pushed(row, start, width, *LOBATTO))
            largest = largest or np.abs(found).max(initial=0.0)
            halved = off.max(axis=(0, 2)) > _ACCURATE * largest
        np.add.at(force, edges[row[~halved]], found[:, ~halved].transpose(1, 2, 0))
        if not halved.any():
            break
        row, start, width = np.tile(row[halved], 2), start[halved], width / 2
        start = np.concatenate([start, start + width])
    return force.ravel()


_LEAST = 0.05
"""Young's modulus, and yield stress, over its cold value: least permitted ratio."""
_GHOST = 1e-7
"""Stiffness of a removed element over its value before."""


@dataclass(frozen=True, slots=True)
class Softening:
    """Relative losses (n,) of Young's modulus and yield stress at places, by load.

    ``removed`` is 1 in the elements that a load removes.
    """

    modulus: Superposed
    strength: Superposed
    removed: Superposed

    @classmethod
    def of(cls, part: Nodes, x: Array, elements: Ints | None = None) -> Softening | None:
        """Return the losses that the loads of a body cause at places x (2, n); None without any.

        ``elements`` (n,) are the elements of the places; without them nothing is removed.
        """
        body, n = part.body, x.shape[1]
        both = [(load, load.softening(x)) for load in body.every_load]
        lost = [(load, shares) for load, shares in both if shares is not None]
        gone = [
            (load, np.isin(elements, body.region(load.removes)).astype(float))
            for load in body.every_load
            if load.removes and elements is not None
        ]
        if not (lost or gone):
            return None
        return cls(
            Superposed.of(n, ((load, modulus) for load, (modulus, _) in lost)),
            Superposed.of(n, ((load, strength) for load, (_, strength) in lost)),
            Superposed.of(n, gone),
        )

    def law(self, cold: Law, time: float) -> Law:
        """Return the law at a time; the cold law itself while nothing has changed."""
        present = 1 - (1 - _GHOST) * np.minimum(self.removed.at(time), 1.0)
        stiff = present * _remaining(self.modulus, "modulus_drop", time)
        strong = self.strong(time)
        unchanged = (stiff == 1).all() and (strong == 1).all()
        return cold if unchanged else Heated(law=cold, stiff=stiff, strong=strong)

    def gone(self, time: float) -> Bools:
        """Return whether elements at the places (n,) are removed at a time."""
        return np.asarray(self.removed.at(time) >= 1)

    def strong(self, time: float) -> Array:
        """Return the ratio (n,) of the yield stress at a time to its cold value."""
        return _remaining(self.strength, "yield_drop", time)


def _remaining(lost: Superposed, name: str, time: float) -> Array:
    """Return the remaining ratios at a time; raise `ModelError` if one is below `_LEAST`."""
    share = 1 - lost.at(time)
    if not share.min() >= _LEAST:
        allowed = f"must be at least {_LEAST:g} at every temperature (time {time:.6g})"
        raise ModelError(f"1 - {name} * rise", round(float(share.min()), 6), allowed)
    return np.asarray(share)
