"""Links of a model as conditions between the unknowns of its parts.

Each condition is ``C u + compliance F = 0`` with a force F of any sign, which acts on the parts by
``C' F``. Those of a body of large strain with a rigid body are linear in the frame of this body:
there C turns, and a shift is added (`Links.at`). A Newton step eliminates the conditions exactly,
together with the rigid motions that they hold; a contact problem without links remains.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from solver.contact.complementarity import solve_contact
from solver.contact.geometry import pair
from solver.contact.overlap import largest_overlap
from solver.contact.problem import ContactProblem, ContactRows, ContactSolution, OnParts, joined
from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.loads import comparing
from solver.fem.nodes import Dofs, vectors
from solver.fem.part import Part
from solver.fem.rigid import MovingFrame, RigidPart
from solver.fem.surface import Surface
from solver.linear.solvers import Singular
from solver.model.body import Body
from solver.model.model import Model
from solver.model.pairs import Link, Side
from solver.typing import Array, Bools, Ints

_DEPENDENT = 1e-9
"""Part of a condition that is independent of the others, over the condition: with a smaller ratio
the condition depends on them. Also the least singular value of rigid motions that links hold."""
_ALIKE = 1e-13
"""Mean square of a motion of a slave over the largest one: a smaller ratio is rounding."""
_LITTLE = 1e-9
"""Area of a node over the largest one: no spring acts on nodes with a smaller ratio."""


@dataclass(frozen=True, slots=True)
class Links(OnParts):
    """The conditions of all links.

    Attributes
    ----------
    rows : for each part, the derivatives C (c, ...) on its unknowns; None if no link acts on it
    compliance : (c,) compliance of springs [mm/N], 0 if the link is rigid
    whose : (c,) number of the link that a condition belongs to
    shift : (c,) violation at the displacements of `at`, less that by ``rows`` [mm]
    _each, _kept : conditions of each link, and which of all are kept: those independent at rest
    """

    rows: tuple[ContactRows | None, ...]
    compliance: Array
    whose: Ints
    shift: Array
    _each: tuple[_LinkRows, ...]
    _kept: Ints | slice

    @classmethod
    def of(
        cls, each: tuple[_LinkRows, ...], parts: int, kept: Ints | slice,
        u: Sequence[Array] | None = None,
    ) -> Links:  # fmt: skip
        """Return the ``kept`` conditions of each link, of a number of parts, at displacements."""
        ends = np.cumsum([0, *(len(own.compliance) for own in each)])
        pieces: list[list[ContactRows]] = [[] for _ in range(parts)]
        shift = np.zeros(ends[-1])
        for k, own in enumerate(each):
            here, rows = slice(ends[k], ends[k + 1]), own.rows
            if own.framed is not None and u is not None:
                rows, off = own.framed.at(u)
                shift[here] = off - sum(r.block @ u[number][r.dofs] for number, r in rows)
            for number, one in rows:
                block = np.zeros((ends[-1], one.block.shape[1]))
                block[here] = one.block
                pieces[number].append(ContactRows(one.dofs, block[kept]))
        compliance = np.concatenate([np.zeros(0), *(own.compliance for own in each)])[kept]
        whose = np.repeat(np.arange(len(each)), np.diff(ends))[kept]
        return cls(tuple(map(joined, pieces)), compliance, whose, shift[kept], each, kept)

    @property
    def turn(self) -> bool:
        """Whether some of the conditions turn with rigid bodies, and so are not linear."""
        return any(own.framed is not None for own in self._each)

    def at(self, u: Sequence[Array]) -> Links:
        """Return the conditions at displacements ``u``, at which some have turned."""
        if not self.turn:
            return self
        return Links.of(self._each, len(self.rows), self._kept, u)

    def __len__(self) -> int:
        """Return the number of conditions."""
        return len(self.compliance)

    def loose(self, paired: Sequence[bool]) -> tuple[bool, ...]:
        """Return for each part whether no link and no pair (``paired``) holds it."""
        each = zip(self.rows, paired, strict=True)
        return tuple(rows is None and not held for rows, held in each)

    def off(self, u: Sequence[Array], forces: Array) -> Array:
        """Return the violation (c,) of the conditions by unknowns and forces [mm]."""
        out = self.compliance * forces + self.shift
        for own, rows in zip(u, self.rows, strict=True):
            if rows is not None:
                out = out + rows.block @ own[rows.dofs]
        return np.asarray(out)

    def energy(self, forces: Array) -> float:
        """Return the energy of the springs [N mm]."""
        return float(self.compliance @ forces**2) / 2

    def turning(self, u: Sequence[Array], forces: Array) -> list[tuple[Ints, Array]]:
        """Return unknowns (k,) of all parts, derivatives (k, k) of nodal forces by them [N/mm]."""
        ends, out = np.cumsum([0, *map(len, u)]), []
        for k, own in enumerate(self._each):
            if (link := own.framed) is None:
                continue
            q, own_u, radius = u[link.reference], u[link.slave], link.frame.radius
            nodal = self.on_part(link.slave, forces * (self.whose == k), len(own_u))
            force, place = (vectors(v[link.dofs], 2) for v in (nodal, own_u))
            arm = link.X + place - (link.frame.centre + q[:2])[:, None]
            turned = np.stack([-force[1], force[0]]) / radius
            last = [*turned.T.ravel(), *-turned.sum(axis=1), -(force * arm).sum() / radius**2]
            K = np.zeros((len(last),) * 2)
            K[-1] = K[:, -1] = last
            three = ends[link.reference] + np.arange(3)
            out.append((np.r_[ends[link.slave] + link.dofs, three], K))
        return out

    def clamped(self, parts: Sequence[Part], time: float) -> tuple[float, float]:
        """Return a force [N] and an energy [N mm] if only the linked nodes moved as prescribed.

        They use the diagonal of the stiffness, as the level of rounding: see `System.least`.
        """
        moved, force, energy = np.zeros(len(self)), 0.0, 0.0
        each = [(p, rows) for p, rows in zip(parts, self.rows, strict=True) if rows is not None]
        for part, rows in each:
            if part.driven.cases:
                moved += rows.block @ part.driven.at(time)[rows.dofs]
        for part, rows in each if moved.any() else ():
            nodal, stiffness = np.abs(rows.block).T @ np.abs(moved), part.diagonal[rows.dofs]
            force = float(np.hypot(force, np.linalg.norm(stiffness * nodal)))
            energy += float(stiffness @ nodal**2) / 2
        return force, energy


def solve_linked(
    problem: ContactProblem, links: Array, touched: Bools, start: Ints
) -> ContactSolution | None:
    """Return the solution with links; None if there is none or none was found.

    If none is found, A replaces G: the problem is then symmetric, and this approximate step of
    Newton's method may still lead to a solution.

    Parameters
    ----------
    links, touched : see `eliminated`
    start : (n,) see `solve_contact`
    """
    rest, whole = eliminated(problem, links, touched) if len(links) else (problem, None)
    found = solve_contact(rest, start)
    if found is None and (problem.turned != problem.A).any():
        return solve_linked(replace(problem, G=None), links, touched, start)
    return found if found is None or whole is None else whole(found)


def eliminated(
    problem: ContactProblem, links: Array, touched: Bools
) -> tuple[ContactProblem, Callable[[ContactSolution], ContactSolution]]:
    """Return the contact problem without links, and a function from its solution to the whole one.

    Parameters
    ----------
    links : (c, k) motions of the conditions of links, the last of ``offset`` and ``W``, per rigid
        motion, were the forces on its body zero
    touched : (k,) whether contact may hold the rigid motion; motions that neither links nor contact
        hold stay zero

    Raises
    ------
    Singular
        if a tangent has lost its stiffness against the links
    """
    m, n = len(problem.offset) - len(links), len(problem.offset)
    size = np.abs(links).max(initial=0.0) or 1.0
    _, sizes, ways = linalg.svd(links / size)
    rank = int((sizes > _DEPENDENT).sum())
    held, loose = ways[:rank].T, ways[rank:].T
    _, moved, ways = linalg.svd(loose[touched])
    loose = loose @ ways[: int((moved > _DEPENDENT).sum())].T
    # scale: forces and motions differ in magnitude by the compliance; that of supports is zero
    held = held * ((np.abs(np.diag(problem.W)[m:]).max(initial=0.0) or 1.0) / size)
    every = np.hstack([loose, held])
    D = np.zeros((len(every),) * 2) if problem.D is None else problem.D
    S = np.block([
        [problem.W, problem.turned @ every], [(problem.A @ every).T, every.T @ D @ every]
    ])  # fmt: skip
    ahead = np.concatenate([problem.offset, every.T @ problem.balance])
    last = np.zeros(len(S), dtype=bool)
    last[m:n], last[n + loose.shape[1] :] = True, True
    try:
        inverse = np.linalg.solve(
            S[np.ix_(last, last)], np.column_stack([S[np.ix_(last, ~last)], ahead[last]])
        )
    except np.linalg.LinAlgError as error:  # the linked boundary flows without stiffness
        raise Singular("links cannot hold bodies without stiffness") from error
    left = np.column_stack([S[np.ix_(~last, ~last)], ahead[~last]])
    left -= S[np.ix_(~last, last)] @ inverse
    rest = replace(
        problem,
        W=left[:m, :m],
        offset=left[:m, -1],
        A=left[m:, :m].T,
        G=None if problem.G is None and problem.D is None else left[:m, m:-1],
        balance=left[m:, -1],
        D=None if problem.D is None else left[m:, m:-1],
    )

    def whole(found: ContactSolution) -> ContactSolution:
        own = -(inverse @ np.concatenate([found.forces, found.rigid, [1.0]]))
        return replace(
            found,
            forces=np.concatenate([found.forces, own[: n - m]]),
            rigid=held @ own[n - m :] + loose @ found.rigid,
        )

    return rest, whole


def surfaces_of_links(
    model: Model, wholes: Mapping[str, Discretisation | RigidPart]
) -> dict[Side, Surface]:
    """Return the surfaces of all links in the numbering of the whole bodies."""
    tied = {side for link in model.links if link.master for side in link.sides}
    every = {side for link in model.links for side in link.sides}
    return {side: wholes[side[0]].chain(side[1], side not in tied) for side in sorted(every)}


def links_of(
    model: Model, parts: Sequence[Part], names: Sequence[str], surfaces: Mapping[Side, Surface]
) -> Links:
    """Return the independent conditions of all links of a model.

    Raises
    ------
    ModelError
        if surfaces do not face each other, or prescribed motions contradict supports or other links
    """
    each = tuple(
        _conditions(f"links[{k}]", link, parts, names, surfaces)
        for k, link in enumerate(model.links)
    )
    X = np.hstack([np.zeros((2, 0)), *(own.X for own in each)])
    return Links.of(
        each, len(parts), _independent(Links.of(each, len(parts), slice(None)), parts, X)
    )


@dataclass(frozen=True, slots=True)
class _LinkRows:
    """The conditions of one link: rows by number of the part, compliance (c,), positions (2, c).

    ``rows`` are those before loading. If ``framed`` is given, they turn.
    """

    rows: list[tuple[int, ContactRows]]
    compliance: Array
    X: Array
    framed: _InFrame | None = None


@dataclass(frozen=True, slots=True)
class _InFrame:
    """Conditions on the displacements of a boundary in the frame of a rigid body, for any rotation.

    Attributes
    ----------
    slave, reference : numbers of the boundary's part and of the rigid body
    dofs, X : (2 n,) unknowns and (2, n) positions of the boundary's nodes
    block : (c, 2 n) the conditions by displacements in the frame
    """

    slave: int
    reference: int
    frame: MovingFrame
    dofs: Ints
    X: Array
    block: Array

    def at(self, u: Sequence[Array]) -> tuple[list[tuple[int, ContactRows]], Array]:
        """Return derivatives by the unknowns, and violations (c,) [mm]."""
        q, moved = u[self.reference], vectors(u[self.slave][self.dofs], 2)
        inside = self.frame.within(q, self.X, moved)
        block = self.block.reshape(len(self.block), -1, 2) @ self.frame.turned(q).T
        block = block.reshape(self.block.shape)
        motion = self.frame.rows(q, block, self.frame.passing(self.X + inside))
        rows = [(self.reference, ContactRows(np.arange(3), -motion)),
                (self.slave, ContactRows(self.dofs, block))]  # fmt: skip
        return rows, self.block @ inside.T.ravel()


def _conditions(
    name: str, link: Link, parts: Sequence[Part], names: Sequence[str],
    surfaces: Mapping[Side, Surface],
) -> _LinkRows:  # fmt: skip
    number, slave = names.index(link.slave[0]), surfaces[link.slave]
    rows: list[tuple[int, ContactRows]] = []
    framed: _InFrame | None = None
    if link.master is None:
        along_each = _ways(link, slave)
        nodes = np.tile(np.arange(len(slave.nodes)), len(along_each))
        areas, X = slave.areas[nodes], slave.X[:, nodes]
        block = np.zeros((len(nodes), 2 * len(slave.nodes)))
        for axis, along in enumerate(np.concatenate(along_each, axis=1)):
            block[np.arange(len(nodes)), Dofs(nodes, 2).along(axis)] = along
    else:
        bodies = [parts[names.index(of)].body for of, _ in link.sides]
        at_rest = [np.zeros_like(surfaces[side].X) for side in link.sides]
        master = surfaces[link.master]
        pairing = pair(slave, at_rest[0], master, at_rest[1], largest_overlap(*bodies), tied=True)
        at = np.flatnonzero(pairing.area > 0)
        if not len(at):
            allowed = "these surfaces do not face each other: check boundaries and positions"
            raise ModelError(name, link.sides, allowed)
        areas = np.tile(pairing.area[at], len(link.axes))
        ways = [(pairing.normal, pairing.tangent)[axis] for axis in link.axes]
        block, others = (np.vstack([way[side][at] for way in ways]) for side in (0, 1))
        X = np.tile(slave.X[:, slave.vertices[at]], len(link.axes))
        other = names.index(link.master[0])
        rows.append((other, ContactRows(parts[other].surface(master).dofs, others)))
    if link.rigid is not None:
        reference = names.index(link.rigid)
        part = parts[reference]
        assert isinstance(part, RigidPart)
        motion = block @ part.linear(slave.X)
        if link.distributed:
            around = slave.thickness is None
            block, motion = _mean(name, link, block, motion, areas, around=around)
            X = np.tile(X.mean(axis=1, keepdims=True), len(block))
            areas = np.full(len(block), np.inf)
        rows.append((reference, ContactRows(np.arange(3), -motion)))
        body = parts[number].body
        if isinstance(body, Body) and body.turned_by(link):
            dofs = parts[number].surface(slave).dofs
            framed = _InFrame(number, reference, part.frame, dofs, slave.X, block)
    elif link.master is None and not link.grounded:  # the slave moves as one
        count = len(slave.nodes)
        first = np.arange(len(block)) // count * count
        block = block - block[first]
        others_ = np.arange(len(block)) != first
        block, areas, X = block[others_], areas[others_], X[:, others_]
    rows.append((number, ContactRows(parts[number].surface(slave).dofs, block)))
    if np.isinf(link.stiffness):
        return _LinkRows(rows, np.zeros(len(areas)), X, framed)
    acts = areas > _LITTLE * areas.max()
    rows = [(k, ContactRows(own.dofs, own.block[acts])) for k, own in rows]
    framed = framed and replace(framed, block=framed.block[acts])
    return _LinkRows(rows, 1 / (link.stiffness * areas[acts]), X[:, acts], framed)


def _ways(link: Link, slave: Surface) -> list[Array]:
    """Return the unit vectors (2, n_nodes) of each component of a link at its slave."""
    if link.local:
        x, y = slave.normals
        return [np.stack([x, y] if link.components == "normal" else [-y, x])]
    return [np.repeat(np.eye(2)[:, [axis]], len(slave.nodes), axis=1) for axis in link.axes]


def _mean(
    name: str, link: Link, block: Array, motion: Array, areas: Array, *, around: bool
) -> tuple[Array, Array]:
    """Return rows of slave and rigid body: the mean motion of the slave equals the rigid motion.

    The mean is the rigid motion of least squares over the rows; ``motion`` (c, 3) are the motions
    of the rows per rigid motion. They may be dependent: a rotation moves a straight boundary along
    itself as a translation does. ``around`` an axis only y has a mean.
    """
    motion = motion * ([0.0, 1.0, 0.0] if around else 1.0)
    weighted = motion.T * areas
    sizes, ways = linalg.eigh(weighted @ motion)
    kept = sizes > _ALIKE * sizes[-1]
    if not kept.any():
        allowed = "must include y where it is distributed in axisymmetric bodies: x is radial"
        raise ModelError(f"{name}.components", link.components, allowed)
    ways, sizes = ways[:, kept], sizes[kept]
    return (ways / sizes).T @ weighted @ block, ways.T


def _independent(made: Links, parts: Sequence[Part], X: Array) -> Ints:
    """Return the conditions that do not depend linearly on supports and on each other.

    Raises `ModelError` if a dependent condition contradicts the others by prescribed motions.
    """
    each = [(p, rows) for p, rows in zip(parts, made.rows, strict=True) if rows is not None]
    times = comparing([load for part, _ in each for load in part.driven.cases])
    free, driven = [np.zeros((len(made), 0))], np.zeros((len(made), len(times)))
    for part, rows in each:
        free.append(rows.block[:, np.isin(rows.dofs, part.free)])
        driven += rows.block @ np.stack([part.driven.at(t)[rows.dofs] for t in times], axis=1)
    rigid = np.flatnonzero(made.compliance == 0)
    if not len(rigid):
        return np.arange(len(made))
    G, moves = np.hstack(free)[rigid], driven[rigid]
    size = np.linalg.norm(G, axis=1)
    G = np.divide(G, size[:, None], out=np.zeros_like(G), where=size[:, None] > 0)
    R, order = linalg.qr(G.T, mode="r", pivoting=True)
    rank = int((np.abs(np.diag(R)) > _DEPENDENT).sum())
    kept, others = order[:rank], order[rank:]
    follow = np.linalg.lstsq(G[kept].T, G[others].T)[0].T
    scale = np.where(size > 0, size, 1.0)[:, None]
    off = np.abs(moves[others] / scale[others] - follow @ (moves[kept] / scale[kept]))
    wrong = others[(off > _DEPENDENT * np.abs(moves).max(initial=0.0)).any(axis=1)]
    if len(wrong):
        x, y = X[:, rigid[wrong[0]]]
        raise ModelError(
            f"links[{made.whose[rigid[wrong[0]]]}]", f"({x:g}, {y:g})",
            "must not contradict supports, prescribed motions or other links at this node: shorten "
            "one of the boundaries by an element, or leave a component out",
        )  # fmt: skip
    return np.setdiff1d(np.arange(len(made)), rigid[others])
