"""The discretised model: parts with their operators, interfaces, links and states."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.linalg import null_space
from scipy.sparse import csr_array

from solver.contact.geometry import Pairing
from solver.contact.interface import Interface, interface_of, surfaces_of, with_slaves
from solver.contact.links import Links, links_of, surfaces_of_links
from solver.contact.state import BodyState, ContactState, Converged, State
from solver.errors import ModelError
from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation
from solver.fem.fields import Sampler, recovery, sampler
from solver.fem.large import LargeDiscretisation
from solver.fem.operators import Operator, Operators, operators_of
from solver.fem.part import Part
from solver.fem.rigid import RigidPart
from solver.fem.substructure import Substructure
from solver.fem.surface import Surface
from solver.fem.wheel import Wheel
from solver.fem.window import Region, Windowed
from solver.materials.law import Law
from solver.model.friction import BoundLines, ContactPlaces, lines_of
from solver.model.model import Model
from solver.model.pairs import Side
from solver.model.rigid import RigidBody
from solver.typing import Array

LEAST = 1e-7
"""Rounding level of forces over the nodal forces of heat, initial stress and prescribed motion. It
is the least force that errors are divided by."""
LEAST_ENERGY = 1e-8
"""The same ratio for energies: free expansion leaves 1e-13 of the energy by rounding."""
_TOUCHING = 1e-9
"""Gap over the length of the longest contact surface: vertices with a smaller ratio touch."""
_SET_DOWN = 1e-9
"""Gap over the radius of a wheel that is set down: vertices with a smaller ratio touch."""
_EXPANDED = 8
"""Number of displacement fields of condensed bodies kept in memory for results and audit."""


def _part(whole: Discretisation | RigidPart, own: list[Surface], linear_solver: str) -> Part:
    if isinstance(whole, RigidPart):
        return whole
    body = whole.body
    if body.axle is not None:
        return Wheel(whole, own, linear_solver)
    constant = not (whole.driven.cases or whole.softening or whole.moving or body.large)
    if body.material.elastic and body.condense and own and constant:
        return Substructure(whole, own, linear_solver)
    return whole


def _reach(body: RigidBody, model: Model, linked: Mapping[Side, Surface]) -> float:
    """Return the largest distance of linked nodes from the centre of a rigid body [mm]."""
    moved = (linked[link.slave].X for link in model.links if link.rigid == body.name)
    away = (np.hypot(*(X - np.reshape(body.centre, (2, 1)))).max() for X in moved)
    return float(max(away, default=0.0))


class System:
    """The parts, operators and interfaces of a model, built once for all its runs.

    Attributes
    ----------
    model : the model; slave and master of a pair are exchanged where that is better
    names : names of the meshed bodies
    all_names : these names, then those of the rigid bodies, in the order of ``parts``
    surfaces : for each part, its surfaces in contact or links in the numbering of the whole body
    links : conditions of links between the unknowns of the parts
    """

    def __init__(self, model: Model, linear_solver: str = "auto") -> None:
        round_axis = model.bodies[0].kinematics == "axisymmetric"
        self._wholes = {
            body.name: LargeDiscretisation(body) if body.large else Discretisation(body)
            for body in model.bodies
        }
        linked = surfaces_of_links(model, self._wholes)
        rigid = {
            body.name: RigidPart(body, round_axis, _reach(body, model, linked))
            for body in model.rigid
        }
        wholes: dict[str, Discretisation | RigidPart] = {**self._wholes, **rigid}
        self._chains = wholes
        surfaces = surfaces_of(model, wholes)
        free = {name for name, whole in self._wholes.items() if whole.rigid.shape[1] == 3}
        free -= {side[0] for side in linked} | {b.name for b in model.bodies if b.axle}
        for body in model.bodies:
            if body.large_region and body.name in free:
                allowed = (
                    f"must be left out: contact alone holds body {body.name!r}, which can turn"
                )
                raise ModelError("large_region", body.large_region, allowed)
        self.model = model = with_slaves(model, surfaces, free)
        every = [*surfaces.items(), *linked.items()]
        own = [[chain for (name, _), chain in every if name == body] for body in wholes]
        self.surfaces, self._linear_solver = own, linear_solver
        self.names = [body.name for body in model.bodies]
        self.all_names = list(wholes)
        self.parts: tuple[Part, ...] = tuple(
            _part(whole, chains, linear_solver)
            for whole, chains in zip(wholes.values(), own, strict=True)
        )
        self.interfaces = tuple(
            interface_of(contact, self.parts, self.all_names, surfaces)
            for contact in model.contacts
        )
        self.links: Links = links_of(model, self.parts, self.all_names, linked)

        self._windows: dict[int, tuple[bytes, Windowed, Operators]] = {}
        self._least: tuple[float, tuple[float, float]] = (np.nan, (0.0, 0.0))
        self._at_vertices: dict[int, csr_array] = {}
        self._expanded: deque[tuple[Array, float, Array]] = deque(maxlen=_EXPANDED)
        # the pairings of one state only: their rows may be large
        self._paired: deque[tuple[State, int, Pairing]] = deque(maxlen=len(self.interfaces))
        self._check_held()

    def _check_held(self) -> None:
        """Raise `ModelError` if a body has a rigid motion that nothing resists."""
        sizes = [part.rigid.shape[1] for part in self.parts]
        ends = np.cumsum(sizes)
        u = tuple(part.start() for part in self.parts)
        rows = []
        for interface in self.interfaces:
            pairing = interface.pairing(u)
            kinds = (pairing.normal, pairing.tangent)[: 2 if interface.rough else 1]
            for kind, gaps in zip(kinds, (len(pairing.area), 0), strict=False):
                rows.append(self.rigid_rows(interface, kind, u, gaps))
        rows.append(self.linked_motions())
        A = np.vstack([np.zeros((0, ends[-1])), *rows])
        loose = null_space(A, rcond=1e-9) if len(A) else np.eye(ends[-1])
        for part, size, end in zip(self.parts, sizes, ends, strict=True):
            if size and np.abs(loose[end - size : end]).max(initial=0.0) > 1e-6:
                held = getattr(part.body, "supports", {})
                allowed = "can move freely: hold it by supports, links or contact"
                raise ModelError("supports", held, f"body {part.body.name!r} {allowed}")

    def linked_motions(self, u: tuple[Array, ...] | None = None) -> Array:
        """Return the violations of links (c, n_rigid) per rigid motion of all parts.

        They are those before loading, or at displacements ``u``.
        """
        each = zip(self.parts, (self.links.at(u) if u else self.links).rows, strict=True)
        return np.hstack([
            np.zeros((len(self.links), part.rigid.shape[1]))
            if rows is None else rows.block @ part.rigid[rows.dofs]
            for part, rows in each
        ])  # fmt: skip

    def rigid_rows(
        self,
        interface: Interface,
        kind: tuple[Array, Array],
        u: tuple[Array, ...],
        gaps: int,
    ) -> Array:
        """Return gaps or slips (n, n_rigid) per free rigid motion of all parts.

        ``kind`` are the rows of a pairing at displacements ``u``; its first ``gaps`` rows are gaps,
        the others slips.
        """
        ends = np.cumsum([0, *(part.rigid.shape[1] for part in self.parts)])
        A = np.zeros((len(kind[0]), ends[-1]))
        for (number, part, chain), block in zip(interface.sides, kind, strict=True):
            dofs, rows = part.pull_back(chain, u[number], block, gaps)
            A[:, ends[number] : ends[number + 1]] += rows @ part.rigid[dofs]
        return A

    def least(self, time: float) -> tuple[float, float]:
        """Return the rounding levels of force [N] and energy [N mm]; smaller values are rounding.

        Under heat, initial stress or prescribed motion a body may deform freely: large forces of
        its elements cancel, and only their rounding remains.
        """
        at, found = self._least
        if at != time:  # several callers need it at the same time
            each = [
                whole.clamped(time) if isinstance(whole, Discretisation) else (0.0, 0.0)
                for whole in self._chains.values()
            ]
            force, energy = np.array([*each, self.links.clamped(self.parts, time)]).T
            found = LEAST * float(np.linalg.norm(force)), LEAST_ENERGY * float(energy.sum())
            self._least = time, found
        return found

    @cached_property
    def operators(self) -> tuple[Operators, ...]:
        """The inverses of the stiffness of each part."""
        return tuple(
            operators_of(part, chains, self._linear_solver)
            for part, chains in zip(self.parts, self.surfaces, strict=True)
        )

    def window(self, number: int, region: Region) -> Windowed:
        """Return a meshed body that may yield and touch only in a region.

        The last window of each body is kept in memory.
        """
        known = self._windows.get(number)
        if known is None or known[0] != region.key:
            self._windows.pop(number, None)  # frees its factors before new ones are made
            part = self.parts[number]
            assert isinstance(part, Discretisation)
            made = Windowed(part, region, self._linear_solver)
            inverses = made.inverses(self.operators[number].elastic, self._linear_solver)
            known = self._windows[number] = region.key, made, inverses
        return known[1]

    def tangents(self, now: Converged) -> list[Operator]:
        """Return the inverse tangent of each part at the end of an increment.

        Parts that were solved in a window are factorised there.

        Raises
        ------
        Singular
            if a part has no stiffness
        """
        state, found = now.state, []
        windows = now.windows or (None,) * len(self.parts)
        for k, (part, u, region) in enumerate(zip(self.parts, state.u, windows, strict=True)):
            if region is None:
                law = now.responses[k]
                if isinstance(part, Discretisation):
                    here = PartResponse(law, part.undeformed.at(u), (u, state.time))
                else:
                    here = part.respond(u, now.start.plastic[k], state.time)
                found.append(self.operators[k].tangent(here, 0.0))
                continue
            window, plastic = self.window(k, region), now.start.plastic[k]
            response = window.respond(u[window.kept], plastic.at(window.inside), state.time)
            tangent = self._windows[k][2].tangent(response, 0.0)
            found.append(window.over_whole(tangent))
        return found

    def during(self, start: State) -> System:
        """Return the system for an increment from ``start``; it locks motions of rigid bodies."""
        each = zip(self.parts, start.u, strict=True)
        return self.within(tuple(part.during(start.time, u) for part, u in each))

    def turned(self, u: tuple[Array, ...]) -> System:
        """Return the system with the rigid motions of its parts at displacements ``u``."""
        each = zip(self.parts, u, strict=True)
        return self.within(tuple(part.turned(own) for part, own in each))

    def holds(self, before: float, time: float) -> tuple[bool, ...]:
        """Return for each part whether a pair may hold its rigid motions between two times.

        A pair that is absent, or being removed, holds nothing.
        """
        held = {
            number
            for interface in self.interfaces
            if interface.declared.left(before, time) is None
            for number in (interface.slave, interface.master)
        }
        return tuple(number in held for number, _ in enumerate(self.parts))

    def within(self, parts: tuple[Part, ...]) -> System:
        """Return the system with other ``parts``; windowed ones use the operators of `window`."""
        if all(one is other for one, other in zip(parts, self.parts, strict=True)):
            return self
        small = copy(self)
        small.parts = parts
        small.operators = tuple(
            self._windows[number][2] if isinstance(part, Windowed) else self.operators[number]
            for number, part in enumerate(parts)
        )
        small.interfaces = tuple(
            replace(interface, parts=(parts[interface.slave], parts[interface.master]))
            for interface in self.interfaces
        )
        return small

    @property
    def laws(self) -> list[Law]:
        """The material laws of the meshed bodies."""
        return [body.material for body in self.model.bodies]

    @property
    def n_unknowns(self) -> int:
        """Displacement unknowns of all parts."""
        return sum(len(part.free) for part in self.parts)

    @cached_property
    def gap_tolerance(self) -> float:
        """Largest gap or overlap before loading that counts as touching [mm]."""
        lengths = [np.ptp(i.slave_surface.X, axis=1).max() for i in self.interfaces]
        return _TOUCHING * float(max(lengths, default=0.0))

    @cached_property
    def blur(self) -> float:
        """Rounding error of a gap [mm]."""
        farthest = [np.abs(i.slave_surface.X).max() for i in self.interfaces]
        return float(np.finfo(float).eps * max(farthest, default=0.0))

    @cached_property
    def moves(self) -> bool:
        """Whether a load or a wheel moves along a body."""
        loads = (load for body in self.model.bodies for load in body.every_load)
        return self.rolls or any(load.moves for load in loads)

    @property
    def rolls(self) -> bool:
        """Whether a wheel rolls: it is set down to touch at the beginning of each lap."""
        return any(body.axle is not None for body in self.model.bodies)

    @property
    def has_amplitude(self) -> bool:
        """Whether a load, an interference or the presence of a pair has an amplitude."""
        amplitudes = [load.amplitude for part in self.parts for load in part.body.every_load]
        for contact in self.model.contacts:
            amplitudes += [contact.amplitude, contact.presence]
        return any(amplitude is not None for amplitude in amplitudes)

    @property
    def prestressed(self) -> list[str]:
        """Names of the bodies that have stress before any load."""
        return [p.body.name for p in self.parts if not all(x.varies for x in p.body.every_load)]

    @cached_property
    def overlapping(self) -> bool:
        """Whether bodies overlap before loading."""
        return self.overlaps(self.initial())

    def overlaps(self, state: State) -> bool:
        """Whether bodies overlap in a state; false with wheels, which are set down to touch."""
        gaps = (contact.gap for contact in state.contacts)
        return not self.rolls and any((gap < -self.gap_tolerance).any() for gap in gaps)

    @cached_property
    def proportional(self) -> bool:
        """Whether an elastic state depends on the load alone, and not on its history.

        True without friction, or if all facing vertices touch before loading: their status does not
        change while the load grows. False if the friction bound is not proportional to the pressure
        (cohesion, shear limit), if bodies overlap before loading, or if sliding is declared finite:
        normals rotate, and the work of contact needs increments. False with large strain and with
        loads that move: on their way they may cause more than at the end.
        """
        finite = any(i.declared.sliding == "finite" for i in self.interfaces)
        if (
            self.model.large
            or self.moves
            or finite
            or self.overlapping
            or not all(contact.law.proportional for contact in self.model.contacts)
        ):
            return False
        gaps = np.concatenate([np.zeros(0), *(c.gap for c in self.initial().contacts)])
        conforming = (np.isinf(gaps) | (np.abs(gaps) < self.gap_tolerance)).all()
        return bool(conforming) or not any(i.rough for i in self.interfaces)

    def bound(self, pair: int, pairing: Pairing, start: State, time: float) -> BoundLines:
        """Return the friction bound at the vertices of a slave: lines of shear over pressure [MPa].

        ``pairing`` belongs to ``time``, ``start`` is the state at the beginning of the increment.
        """
        interface, contact = self.interfaces[pair], start.contacts[pair]
        return lines_of(
            interface.declared.law,
            ContactPlaces(
                n=len(pairing.gap),
                find_strength=lambda: interface.strength(pairing, time),
                find_plastic_strain=lambda: self.plastic_strain(pair, start),
                find_slip=lambda: contact.slipped[0],
            ),
        )

    def plastic_strain(self, pair: int, state: State) -> Array:
        """Return the accumulated plastic strain (n,) at the vertices of a slave."""
        interface = self.interfaces[pair]
        number, chain = interface.slave, self.chain(*interface.declared.slave)
        if not isinstance(self.parts[number], Discretisation):
            return np.zeros(len(chain.vertices))
        if pair not in self._at_vertices:
            at = chain.nodes[chain.vertices]
            self._at_vertices[pair] = csr_array(self.recovery(self.all_names[number])[at])
        return np.maximum(self._at_vertices[pair] @ state.plastic[number].accumulated, 0.0)

    def part(self, name: str) -> int:
        """Return the number of the part called ``name``."""
        return self.all_names.index(name)

    def full(self, name: str) -> Discretisation:
        """Return the whole body called ``name``."""
        return self._wholes[name]

    def chain(self, name: str, boundary: str) -> Surface:
        """Return a surface of a whole body, meshed or rigid."""
        return self._chains[name].chain(boundary)

    def distorted(self, state: State) -> tuple[str, ...]:
        """Return messages on distorted elements in bodies of large strain."""
        each = zip(self.parts, state.u, strict=True)
        found = (part.distorted(u) for part, u in each if isinstance(part, LargeDiscretisation))
        return tuple(filter(None, found))

    def displacement(self, name: str, state: State) -> Array:
        """Return the displacements (n,) of a whole body [mm]."""
        number = self.part(name)
        part, u, time = self.parts[number], state.u[number], state.time
        for of, at, known in self._expanded:
            if of is u and at == time:
                return known
        found = part.expand(u, time)
        if found is not u:  # a condensed body: the inner displacements need a solve
            self._expanded.append((u, time, found))
        return found

    def pairing(self, state: State, pair: int) -> Pairing:
        """Return the pairing of a contact pair in a state, as its increment used it.

        The pairings of the last state are kept in memory.
        """
        for of, number, known in self._paired:
            if of is state and number == pair:
                return known
        finite = state.contacts[pair].finite
        found = self.interfaces[pair].pairing(state.u, state.time, finite=finite)
        self._paired.append((state, pair, found))
        return found

    def pressure(self, state: State, pair: int) -> tuple[Array, Array]:
        """Return pressure and shear on the slave's vertices (n,) [MPa]: means under each hat.

        Means have the same resultant as the values of the multiplier field at the vertices (see
        `Cover.spread`), but do not oscillate next to a sharp corner, and do not grow where the
        master ends under a hat (force over a small covered area). The sum of mean times area of the
        whole hat is the contact force.

        The area is that before loading, as the small strains of the slave imply.
        """
        contact, hats = state.contacts[pair], self.interfaces[pair].slave_surface.hats
        cover = self.pairing(state, pair).cover

        def mean(force: Array) -> Array:
            out = np.zeros_like(force)
            return np.divide(cover.spread(force), hats, out=out, where=hats > 0)

        return mean(contact.normal), mean(contact.tangential)

    def sampler(self, name: str, X: Array) -> Sampler:
        """Return a sampler of nodal fields of a body at positions (2, n) [mm]."""
        return sampler(self.full(name), X)

    def recovery(self, name: str) -> csr_array:
        """Return the matrix (n_nodes, n_points) from values at points to those at nodes."""
        return recovery(self.full(name))

    def positions(self, name: str) -> Array:
        """Return the positions of the integration points of a body (dim, n_points) [mm]."""
        return self.full(name).positions

    def state(self, name: str, converged: Converged) -> BodyState:
        """Return the state of a whole body; its fields are NaN in elements that are removed.

        With large strain, stress is the Cauchy stress and strain is logarithmic.
        """
        number, whole, time = self.part(name), self.full(name), converged.state.time
        u, found = self.displacement(name, converged.state), converged.responses[number]
        if not isinstance(self.parts[number], Discretisation):
            found = whole.respond(u, whole.virgin(), time).law
        stress, plastic, gone = found.stress, found.state, whole.gone(time)
        if gone is not None and gone.any():
            stress = np.where(gone, np.nan, stress)
            plastic = replace(
                plastic,
                accumulated=np.where(gone, np.nan, plastic.accumulated),
                plastic_strain=np.where(gone, np.nan, plastic.plastic_strain),
            )
        law = whole.law(time)
        strain = law.elasticity.strain(stress) / law.stiff + plastic.plastic_strain
        strain = strain + whole.eigenstrain(time)
        if whole.body.large:
            across = strain[2] * (whole.body.kinematics == "plane_stress")
            stress = whole.undeformed.at(u).cauchy(stress, across)
        return BodyState(time, u, stress, strain, plastic)

    def initial(self) -> State:
        """Return the unloaded, undeformed state."""
        u = tuple(part.start() for part in self.parts)
        plastic = tuple(part.virgin() for part in self.parts)
        return self.at_rest(State(0.0, u, plastic, (), links=np.zeros(len(self.links))))

    def at_rest(self, state: State) -> State:
        """Return a state without contact forces; vertices that touch stick."""
        contacts = []
        known = state.contacts or (None,) * len(self.interfaces)
        for interface, before in zip(self.interfaces, known, strict=True):
            gap = interface.pairing(state.u, state.time).gap
            touching = gap <= self.gap_tolerance
            contacts.append(
                ContactState.at_rest(gap, touching, finite=interface.finite, before=before)
            )
        return replace(state, contacts=tuple(contacts))

    def joined(self, state: State, time: float) -> State:
        """Return a state in which pairs that are present at ``time`` but had no gap are at rest.

        These pairs were absent, or their bodies were separated.
        """
        contacts = list(state.contacts)
        for k, interface in enumerate(self.interfaces):
            apart = not np.isfinite(contacts[k].gap).any()
            if apart and not interface.declared.absent(time):
                gap = interface.pairing(state.u, time, finite=contacts[k].finite).gap
                touching, finite = gap <= self.gap_tolerance, contacts[k].finite
                contacts[k] = ContactState.at_rest(gap, touching, finite=finite, before=contacts[k])
        return replace(state, contacts=tuple(contacts))

    def moved(self, state: State, time: float) -> State:
        """Return a state with prescribed motions at their values at a time."""
        parts = zip(self.parts, state.u, strict=True)
        return replace(state, u=tuple(part.moved(u, time) for part, u in parts))

    def set_down(self, state: State, time: float) -> State:
        """Return the state at the beginning of a lap: its wheels are undeformed and just touch."""
        u, contacts = list(state.u), list(state.contacts)

        def gaps(pairs: Sequence[int]) -> list[Array]:
            return [self.interfaces[k].pairing(tuple(u), time).gap for k in pairs]

        for number, part in enumerate(self.parts):
            if not isinstance(part, Wheel):
                continue
            u[number] = part.placed(time)
            own = [k for k, i in enumerate(self.interfaces) if number in (i.slave, i.master)]
            u[number] = part.lowered(u[number], min(gap.min() for gap in gaps(own)))
            lowered = gaps(own)
            least = min(gap.min() for gap in lowered)
            for k, gap in zip(own, lowered, strict=True):
                touching = gap < least + _SET_DOWN * part.frame.radius
                finite = self.interfaces[k].finite
                contacts[k] = ContactState.at_rest(gap, touching, finite=finite, before=contacts[k])
        return replace(state, time=time, u=tuple(u), contacts=tuple(contacts))
