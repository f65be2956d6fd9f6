"""Candidates: the vertices near contact at given displacements, with their gaps and slips.

The conditions of links follow after the gaps and slips; they hold at any time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np

from solver.contact.geometry import Cover, Pairing
from solver.contact.links import Links
from solver.contact.problem import OPEN, ContactRows, OnParts, joined
from solver.contact.state import ContactState, State
from solver.contact.system import System
from solver.contact.turning import Turning, turning_of
from solver.fem.operators import Operator
from solver.model.friction import BoundLines
from solver.typing import Array, Ints

_MARGIN = 0.25
"""Gap over element length: vertices with a smaller one are candidates."""
_POWER = 5 / 3
"""Exponent of the gap in the slip before contact, see `_slip_before_contact`."""
_FELL = 0.5
"""The contact counts as growing if the normal forces that fell sum to at most this share of those
that rose."""


@dataclass(frozen=True, slots=True)
class Candidates(OnParts):
    """Vertices near contact, n in all interfaces together, and the c conditions of links.

    Arrays of all conditions have gaps first, then slips since the last converged state if there is
    friction, then links: n + c or 2 n + c values.

    Attributes
    ----------
    vertices : for each interface, the slave vertices that are candidates
    lines : friction bound, the least of these lines of tangential over normal force [N]
    motion : (m,) gaps, slips and violations of links [mm]
    uncounted : (n,) slip before the vertex touched, not counted in ``motion`` [mm]
    forces : (m,) normal, tangential and link forces of the current iterate [N]
    status : (n,) of the current iterate, as in `solver.contact.problem`
    unsure : (n,) possible error of ``uncounted`` [mm]; inf if the time of first contact is unknown
    rows : for each part, the derivatives of all conditions; None without contact surface or link
    turned : for each part, the derivatives (n, n_rigid) of gaps by its rigid motions
    covered : for each interface, the share of each candidate's hat function that faces the master
    covers : for each interface, where its slave faces the master
    gaps, slips : for each interface, gap and slip of all its vertices [mm]; the gap is inf where no
        master faces them, the slip 0 without friction
    beyond : smallest gap of the vertices that are not candidates [mm]
    leaving : for each interface that is being removed, the normal and tangential forces (2, n)
        that remain of its last ones [N]; None for the others. Its vertices are no candidates
    pushes : for each part, the nodal forces (n_dofs,) of pairs that are being removed [N]
    holds : for each part, whether a contact pair may hold its rigid motions
    links : the conditions of links
    turning : how the contact forces turn with bodies of large strain; None without these, or forces
    """

    vertices: tuple[Ints, ...]
    lines: BoundLines
    motion: Array
    uncounted: Array
    forces: Array
    status: Ints
    unsure: Array
    rows: tuple[ContactRows | None, ...]
    turned: tuple[Array, ...]
    covered: tuple[Array, ...]
    covers: tuple[Cover, ...]
    gaps: tuple[Array, ...]
    slips: tuple[Array, ...]
    beyond: float
    leaving: tuple[Array | None, ...]
    pushes: tuple[Array, ...]
    holds: tuple[bool, ...]
    links: Links
    turning: Callable[[], Turning] | None = None

    @property
    def frictional(self) -> bool:
        """Whether slips and tangential forces are among the unknowns."""
        return len(self.motion) > self.n + len(self.links)

    @property
    def along(self) -> slice:
        """The places of slips and tangential forces; empty without friction."""
        return slice(self.n, len(self.motion) - len(self.links))

    @property
    def linked(self) -> slice:
        """The places of the conditions of links."""
        return slice(len(self.motion) - len(self.links), None)

    @property
    def n(self) -> int:
        """Number of candidate vertices."""
        return len(self.status)

    @property
    def places(self) -> list[slice]:
        """For each interface, the slice of its candidates in the arrays of all."""
        return _places(self.vertices)

    def motions(self, part: int, rigid: Array) -> Array:
        """Return the conditions (m, k) per rigid motion (n_dofs, k) of a part [mm].

        Gaps change along the master's normals (``turned``); `of_part` returns the motions along
        the forces (see `Pairing`).
        """
        moved = self.of_part(part, rigid)
        if moved.size:
            moved[: self.n] = self.turned[part]
        return moved

    @property
    def stays(self) -> tuple[bool, ...]:
        """For each part, whether neither pairs nor links hold it; it then keeps its position."""
        return self.links.loose(self.holds)

    def smooth(self) -> Candidates:
        """Return the same candidates without friction."""
        return replace(self, lines=BoundLines.none(self.n))

    def all_on_part(self, part: int, forces: Array) -> Array:
        """Return the nodal forces on a part, including those of pairs being removed [N]."""
        pushes = self.pushes[part]
        return self.on_part(part, forces, len(pushes)) + pushes

    def of_part(self, part: int, u: Array) -> Array:
        """Return the motions (m, ...) along the forces per displacement (n_dofs, ...) [mm]."""
        rows = self.rows[part]
        if rows is None:
            return np.zeros((len(self.motion), *u.shape[1:]))
        return np.asarray(rows.block @ u[rows.dofs])

    def touched(self, part: int) -> Ints:
        """Return the unknowns of a part on which contact forces may act."""
        rows, pushed = self.rows[part], np.flatnonzero(self.pushes[part])
        return pushed if rows is None else np.union1d(rows.dofs, pushed)

    def compliance(self, operators: Sequence[Operator]) -> Array:
        """Return the compliance W (m, m): motions of the conditions per force [mm/N]."""
        W = np.zeros((len(self.motion), len(self.motion)))
        for operator, rows in zip(operators, self.rows, strict=True):
            if rows is not None:
                W += operator.compliance(rows.dofs, rows.block)
        return W

    def violation(self, stiffness: Array) -> float:
        """Return the natural residual of the contact conditions, as a force [N].

        ``|N - max(0, N - k gap)|`` and, where N > 0, ``|T - clip(T - k slip, -s, s)|`` with
        their bound s and the stiffness k of the elastic contact points.
        """
        F, off = self.forces, stiffness * self.motion
        N = F[: self.n]
        worst = float(np.abs(N - np.maximum(0, N - off[: self.n])).max(initial=0.0))
        if self.frictional:
            bound, T = self.lines.least(N), F[self.along]
            wanted = np.clip(T - off[self.along], -bound, bound)
            worst = max(worst, float(np.abs(T - wanted)[N > 0].max(initial=0.0)))
        return max(worst, float(np.abs(off[self.linked]).max(initial=0.0)))

    def work(self, before: tuple[ContactState, ...]) -> tuple[float, float]:
        """Return the work of friction and the work against contact in an increment [N mm].

        Both use the mean of the forces before and after. Work against contact is then an error of
        this mean, at vertices that open or close within the increment; elsewhere it is zero.
        """
        normal, friction = 0.0, 0.0
        each = zip(
            before, self.vertices, self.gaps, self.places, self.leaving, self.slips, strict=True
        )
        for state, vertices, gap, here, remaining, slip in each:
            force = state.normal.copy()
            force[vertices] += self.forces[: self.n][here]
            if remaining is not None:
                force += remaining[0]
                normal -= float((state.tangential + remaining[1]) @ slip) / 2
            moved = force > 0
            with np.errstate(invalid="ignore"):
                opened = np.nan_to_num(gap - state.gap, posinf=0.0, neginf=0.0)
            normal -= float(force[moved] @ opened[moved]) / 2
            if self.frictional:
                shear = state.tangential[vertices] + self.forces[self.along][here]
                friction -= float(shear @ (self.motion[self.along] + self.uncounted)[here]) / 2
        return friction, normal

    def states(
        self,
        before: tuple[ContactState, ...],
        forces: Array,
        status: Ints,
    ) -> tuple[ContactState, ...]:
        """Return the contact states with these forces and statuses."""
        out = []
        each = zip(before, self.vertices, self.places, self.leaving, strict=True)
        for state, vertices, here, remaining in each:
            nothing = np.zeros((2, len(state.normal)))
            normal, tangential = nothing if remaining is None else remaining.copy()
            normal[vertices] = forces[: self.n][here]
            if self.frictional:
                tangential[vertices] = forces[self.along][here]
            statuses = np.full_like(state.status, OPEN)
            statuses[vertices] = status[here]
            out.append(replace(state, normal=normal, tangential=tangential, status=statuses))
        return tuple(out)

    def kept(
        self, before: tuple[ContactState, ...], span: float, *, grows: bool
    ) -> tuple[ContactState, ...]:
        """Return the contact states after an increment over ``span`` of time.

        ``grows`` is false if a load moves along a body: the contact then moves instead of growing.
        """
        after = self.states(before, self.forces, self.status)
        way = np.abs(self.motion[self.along]) if self.frictional else 0.0
        moved, out = np.where(self.status == OPEN, 0.0, way), []
        each = zip(
            before, after, self.vertices, self.places, self.covers, self.gaps, self.slips,
            strict=True,
        )  # fmt: skip
        for old, new, at, here, cover, gap, slip in each:
            slipped = old.slipped
            if self.frictional:
                slipped = slipped.copy()
                slipped[:, at] += moved[here] * _over_way(old, new, cover)[:, at]
            with np.errstate(invalid="ignore", divide="ignore"):
                rates = np.stack([gap - old.gap, slip]) / span
                earlier = np.stack([old.gap, old.earlier[0], old.rates[1] / old.rates[0]])
            rates[:, ~np.isfinite(rates).all(axis=0)] = np.nan
            earlier[:, not (grows and _grew(old.normal, new.normal))] = np.nan
            past = {"gap": gap, "rates": rates, "earlier": earlier}
            out.append(replace(new, touching=new.status != OPEN, slipped=slipped, **past))
        return tuple(out)


def _over_way(old: ContactState, new: ContactState, cover: Cover) -> Array:
    """Return 1, and what acts over the slip in an increment (3, n): normal force and friction [N].

    It is the mean normal force. What slides reaches its friction bound, in the end and on the way:
    friction is that of the end in the ratio of this mean to the normal force of the end.
    """
    mean = (old.normal + new.normal) / 2
    share = np.divide(mean, new.normal, out=np.ones_like(mean), where=new.normal > 0)
    return np.stack([
        np.ones_like(mean), cover.spread(mean), np.abs(cover.spread(share * new.tangential))
    ])  # fmt: skip


def _places(vertices: Sequence[Ints]) -> list[slice]:
    """Return for each interface the slice of its candidates in the arrays of all."""
    ends = accumulate(map(len, vertices), initial=0)
    return [slice(first, last) for first, last in pairwise(ends)]


def no_candidates(system: System, u: tuple[Array, ...], links: Array) -> Candidates:
    """Return the candidates of separated bodies: the links alone."""
    joins = system.links.at(u)
    empty, off = np.zeros(0), joins.off(u, links)
    none = tuple(np.zeros(0, dtype=int) for _ in system.interfaces)
    rows = joins.rows
    covered = tuple(empty for _ in system.interfaces)
    covers = tuple(
        Cover(np.zeros(len(i.slave_surface.edges) + 1), np.zeros(len(i.slave_surface.edges)))
        for i in system.interfaces
    )
    gaps = tuple(np.full(len(i.slave_surface.edges) + 1, np.inf) for i in system.interfaces)
    slips = tuple(map(np.zeros_like, gaps))
    status = empty.astype(int)
    lines = BoundLines.none(0)
    pushes = tuple(np.zeros(part.n) for part in system.parts)
    turned = tuple(np.zeros((0, part.rigid.shape[1])) for part in system.parts)
    return Candidates(
        none, lines, off, empty, links, status, empty, rows, turned, covered, covers, gaps,
        slips, np.inf,
        leaving=(None,) * len(none), pushes=pushes, holds=(False,) * len(pushes),
        links=joins, turning=_turning(system, u, rows, (), (), (), (joins, links)),
    )  # fmt: skip


def find_candidates(
    system: System,
    start: State,
    u: tuple[Array, ...],
    contacts: tuple[ContactState, ...],
    links: Array,
    span: float = 0.0,
) -> Candidates:
    """Return the candidates at displacements ``u``, a ``span`` of time after ``start``.

    ``contacts`` and ``links`` have the forces of the current iterate. Slip counts from ``start``;
    of a vertex without contact then, from its first contact, extrapolated from the last increments.
    """
    time = start.time + span
    shares = [interface.declared.left(start.time, time) for interface in system.interfaces]
    pairings = [
        interface.facing(u, time, finite=before.finite)
        if share is None or before.normal.any()
        else interface.pairing(u, time, finite=before.finite)
        for interface, before, share in zip(system.interfaces, start.contacts, shares, strict=True)
    ]
    vertices = [
        _near(pairing, contact, interface.floating)
        if share is None
        else np.zeros(0, dtype=np.int64)
        for pairing, contact, interface, share in zip(
            pairings, contacts, system.interfaces, shares, strict=True
        )
    ]
    leaving = tuple(
        None if share is None else share * np.stack([before.normal, before.tangential])
        for before, share in zip(start.contacts, shares, strict=True)
    )
    pushes = tuple(np.zeros(part.n) for part in system.parts)
    n = sum(len(v) for v in vertices)
    frictional = any(interface.rough for interface in system.interfaces)
    joins = system.links.at(u)
    m = (2 * n if frictional else n) + len(joins)
    motion, uncounted, unsure, beyond = np.zeros(m), np.zeros(n), np.zeros(n), np.inf
    motion[m - len(joins) :] = joins.off(u, links)
    lines: list[BoundLines] = []
    pieces = [_below(m, rows) for rows in joins.rows]
    slips: list[Array] = []
    turned = [np.zeros((n, part.rigid.shape[1])) for part in system.parts]
    for pair, (interface, pairing, at, before, normal) in enumerate(
        zip(system.interfaces, pairings, vertices, start.contacts, _places(vertices), strict=True)
    ):
        tangent = slice(n + normal.start, n + normal.stop)
        motion[normal] = pairing.gap[at]
        remaining = leaving[pair]
        if remaining is None:
            beyond = min(beyond, np.delete(pairing.gap, at).min(initial=np.inf))
        approach = np.where(before.touching, 0.0, _slip_before_contact(before, span))
        uncounted[normal], unsure[normal] = approach[:, at]
        shear = system.bound(pair, pairing, start, time).at(at)
        lines.append(shear.over(pairing.area[at]))
        for side, (number, part, surface) in enumerate(interface.sides):
            closing = pairing.closing[side][at if part.rigid.shape[1] else []]
            block = np.zeros((m, 2 * len(surface.nodes)))
            block[normal] = pairing.normal[side][at]
            if frictional:
                block[tangent] = pairing.tangent[side][at]
            every, gaps = np.vstack([closing, block]), len(closing) + n
            dofs, every = part.pull_back(surface, u[number], every, gaps)
            closing, block = np.split(every, [len(closing)])
            pieces[number].append(ContactRows(dofs, block))
            if len(closing):
                turned[number][normal] += closing @ part.rigid[dofs]
            if remaining is not None and remaining.any():
                rows = remaining[:1] @ pairing.normal[side], remaining[1:] @ pairing.tangent[side]
                dofs, both = part.pull_back(surface, u[number], np.vstack(rows), 1)
                np.add.at(pushes[number], dofs, both.sum(axis=0))
        slip = np.zeros(len(pairing.gap))
        if frictional:
            slip = interface.slip(pairing, u, start.u)
            motion[tangent] = slip[at] - uncounted[normal]
        slips.append(slip)

    def gather(name: str) -> Array:
        values = [getattr(c, name)[v] for c, v in zip(contacts, vertices, strict=True)]
        return np.concatenate([np.zeros(0), *values])

    acting = tuple(joined(p) for p in pieces)
    forces = [gather("normal"), *([gather("tangential")] if frictional else []), links]
    return Candidates(
        vertices=tuple(vertices),
        lines=BoundLines.joined(lines),
        motion=motion,
        uncounted=uncounted,
        forces=np.concatenate(forces),
        status=gather("status").astype(np.int64),
        unsure=unsure,
        rows=acting,
        turned=tuple(turned),
        covered=tuple(p.covered[v] for p, v in zip(pairings, vertices, strict=True)),
        covers=tuple(p.cover for p in pairings),
        gaps=tuple(p.gap for p in pairings),
        slips=tuple(slips),
        beyond=float(beyond),
        leaving=leaving,
        pushes=pushes,
        holds=system.holds(start.time, time),
        links=joins,
        turning=_turning(system, u, acting, pairings, contacts, vertices, (joins, links)),
    )


def _turning(
    system: System,
    u: tuple[Array, ...],
    rows: Sequence[ContactRows | None],
    pairings: Sequence[Pairing],
    contacts: Sequence[ContactState],
    vertices: Sequence[Ints],
    links: tuple[Links, Array],
) -> Callable[[], Turning] | None:
    """Return what finds how forces turn; None if no body has large strain, or none act."""
    joins, forces = links
    if not system.model.large or not (forces.any() or any(c.normal.any() for c in contacts)):
        return None
    interfaces = system.interfaces[: len(pairings)]  # none of bodies that are separated
    each = (interfaces, pairings, contacts, vertices, _places(vertices))
    return lambda: turning_of(
        system.parts, u, rows, list(zip(*each, strict=True)), joins.turning(u, forces)
    )


def _below(m: int, rows: ContactRows | None) -> list[ContactRows]:
    """Return the rows of links on a part, padded with zeros above to m rows."""
    if rows is None:
        return []
    return [ContactRows(rows.dofs, np.pad(rows.block, ((m - len(rows.block), 0), (0, 0))))]


def _slip_before_contact(before: ContactState, span: float) -> tuple[Array, Array]:
    """Return the slip (n,) before contact, and its possible error [mm].

    Gap and slip continue at their last rates. A vertex that would close after ``span`` touches at
    its end. If contact grew in the last two increments, slip continues as a function of the gap,
    ``a + b gap + c gap^(5/3)`` through the last three states; the difference from the line is the
    possible error. The power is that of a growing contact: at the distance y beyond its end, gap
    and slip are ``y^1.5`` times series in y, and d slip / d gap is a series in ``gap^(2/3)``.

    If the gap does not close, or the rates are unknown, the slip is 0 and its possible error inf.
    """
    closing, sliding = before.rates * span
    share = np.divide(before.gap, -closing, out=np.full_like(closing, np.nan), where=closing < 0)
    share = share.clip(0.0, 1.0)
    last, first, slope = before.earlier
    with np.errstate(invalid="ignore", divide="ignore"):
        gaps = np.stack([before.gap + share * closing, before.gap, last, first]).clip(0.0)
        power = np.diff(gaps**_POWER, axis=0) / np.diff(gaps, axis=0)
        change = (sliding / closing - slope) / (power[1] - power[2]) * (power[0] - power[1])
        more = change * share * closing
        bends = np.isfinite(more) & (before.gap < last) & (last < first)
    more = np.where(bends, more, 0.0)
    known = np.isfinite(share)
    return np.where(known, sliding * share + more, 0.0), np.where(known, more, np.inf)


def _grew(before: Array, after: Array) -> bool:
    """Whether the normal forces (n,) mostly grew; if a contact moves, as many fall."""
    change = after - before
    return bool(-change.sum(where=change < 0) <= _FELL * change.sum(where=change > 0))


def _near(pairing: Pairing, contact: ContactState, floating: bool) -> Ints:
    """Return the vertices near contact.

    The nearest vertex of a body held by contact alone always counts, at any distance.
    """
    margin = _MARGIN * pairing.length
    if floating:
        margin = margin + max(pairing.gap.min(initial=np.inf, where=pairing.area > 0), 0.0)
    near = (pairing.gap < margin) | (contact.normal > 0)
    return np.flatnonzero(near & (pairing.area > 0))
