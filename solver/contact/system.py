"""A model made ready to solve: its parts, their operators, its contact pairs, its states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from solver.contact.geometry import Pairing, pair
from solver.contact.overlap import check_overlap, largest_overlap
from solver.contact.state import ContactState, State
from solver.errors import ModelError
from solver.fem import surface
from solver.fem.discretisation import Discretisation
from solver.fem.substructure import Substructure
from solver.fem.wheel import Wheel
from solver.model.model import effective_friction

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.fem.part import Part
    from solver.fem.surface import Surface
    from solver.materials.state import Response
    from solver.model.model import ContactPair, Model


_TOUCHING = 1e-9
"""Gap / length of the longest contact surface, below which vertices touch."""
_SET_DOWN = 1e-9
"""Gap / radius of a wheel that is set down, below which vertices touch."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A contact pair on its two parts.

    ``shear_strength`` is the largest shear it carries at any pressure [MPa].
    """

    slave: int
    master: int
    slave_surface: Surface
    master_surface: Surface
    friction: float
    shear_strength: float
    parts: tuple[Part, Part]
    reach: float
    reference: Pairing | None

    @property
    def sides(self) -> tuple[tuple[int, Part, Surface], tuple[int, Part, Surface]]:
        """Slave and master: number, part and surface."""
        return (
            (self.slave, self.parts[0], self.slave_surface),
            (self.master, self.parts[1], self.master_surface),
        )

    @property
    def floating(self) -> bool:
        """Whether contact has to hold a rigid motion of either part."""
        return any(part.rigid.shape[1] for part in self.parts)

    def pairing(self, u: tuple[NDArray[np.float64], ...]) -> Pairing:
        """Return gap, area and derivative rows at displacements ``u``."""
        motions = [part.motion(chain, u[number]) for number, part, chain in self.sides]
        if self.reference is not None:
            change = sum(
                block @ motion.T.ravel()
                for block, motion in zip(self.reference.normal, motions, strict=True)
            )
            return replace(self.reference, gap=self.reference.gap + change)
        return pair(self.slave_surface, motions[0], self.master_surface, motions[1], self.reach)


def _surfaces(model: Model, wholes: Mapping[str, Discretisation]) -> dict[tuple[str, str], Surface]:
    """Return the surfaces of all pairs in the numbering of the whole bodies.

    Where a surface continues as the surface of another pair, contact may pass on: no end is there.
    """
    found = {
        side: surface.extract(wholes[side[0]], side[1])
        for contact in model.contacts
        for side in (contact.slave, contact.master)
    }
    ends = {side: chain.nodes[chain.vertices[[0, -1]]] for side, chain in found.items()}

    def alone(side: tuple[str, str], node: int) -> bool:
        return not any(node in ends[o] for o in ends if o[0] == side[0] and o != side)

    out = {}
    for side, chain in found.items():
        start, end = (
            on and alone(side, node)
            for on, node in zip(chain.goes_on, ends[side].tolist(), strict=True)
        )
        out[side] = replace(chain, goes_on=(start, end))
    return out


def _part(whole: Discretisation, own: list[Surface], linear_solver: str) -> Part:
    body = whole.body
    if body.axle is not None:
        return Wheel(whole, own, linear_solver)
    if body.material.elastic and body.condense and own:
        return Substructure(whole, own, linear_solver)
    return whole


def _interface(
    contact: ContactPair,
    parts: tuple[Part, ...],
    names: list[str],
    surfaces: dict[tuple[str, str], Surface],
) -> Interface:
    sides = []
    for side in (contact.slave, contact.master):
        number, chain = names.index(side[0]), surfaces[side]
        part = parts[number]
        sides.append((number, part.surface(chain)))
    (slave, slave_surface), (master, master_surface) = sides
    both = (parts[slave], parts[master])
    check_overlap(both[0].body, both[1].body, (slave_surface, master_surface))
    reference, reach = None, float(np.ptp(both[0].body.mesh.p, axis=1).max())
    if contact.sliding == "small":
        at_rest = [np.zeros_like(chain.X) for _, chain in sides]
        reach = largest_overlap(both[0].body, both[1].body)
        reference = pair(slave_surface, at_rest[0], master_surface, at_rest[1], reach)
        if not reference.area.any():
            raise ModelError(
                "contacts", (contact.slave, contact.master),
                "these surfaces do not face each other: before loading no normal of the slave "
                "meets the master from outside; check the boundaries and where the bodies are",
            )  # fmt: skip
    strength = min(part.body.material.shear_yield_stress for part in both)
    return Interface(
        slave=slave,
        master=master,
        slave_surface=slave_surface,
        master_surface=master_surface,
        friction=effective_friction(contact.friction),
        shear_strength=contact.shear_limit * strength,
        parts=both,
        reach=reach,
        reference=reference,
    )


class System:
    """A model's parts, operators and interfaces, built once and shared by all its runs."""

    def __init__(self, model: Model, linear_solver: str = "auto") -> None:
        self.model = model
        self._wholes = {body.name: Discretisation(body) for body in model.bodies}
        surfaces = _surfaces(model, self._wholes)
        own = [[chain for (name, _), chain in surfaces.items() if name == body.name]
               for body in model.bodies]  # fmt: skip
        self.parts: tuple[Part, ...] = tuple(
            _part(whole, chains, linear_solver)
            for whole, chains in zip(self._wholes.values(), own, strict=True)
        )
        self.operators = tuple(
            part.operators(chains, linear_solver)
            for part, chains in zip(self.parts, own, strict=True)
        )
        names = [body.name for body in model.bodies]
        self.interfaces = tuple(
            _interface(contact, self.parts, names, surfaces) for contact in model.contacts
        )

        self._check_held()

    def _check_held(self) -> None:
        """Raise `ModelError` when a body has a rigid motion that nothing resists."""
        sizes = [part.rigid.shape[1] for part in self.parts]
        ends = np.cumsum(sizes)
        rows = []
        for interface in self.interfaces:
            pairing = interface.pairing(tuple(part.start() for part in self.parts))
            kinds = (pairing.normal, pairing.tangent)[: 2 if interface.friction else 1]
            for kind, gaps in zip(kinds, (len(pairing.area), 0), strict=False):
                A = np.zeros((len(pairing.area), ends[-1]))
                for (number, part, chain), block in zip(interface.sides, kind, strict=True):
                    columns = slice(ends[number] - sizes[number], ends[number])
                    dofs, rows_of = part.pull_back(chain, part.start(), block, gaps)
                    A[:, columns] += rows_of @ part.rigid[dofs]
                rows.append(A)
        A = np.vstack([np.zeros((0, ends[-1])), *rows])
        loose = null_space(A, rcond=1e-9) if len(A) else np.eye(ends[-1])
        for part, size, end in zip(self.parts, sizes, ends, strict=True):
            if size and np.abs(loose[end - size : end]).max(initial=0.0) > 1e-6:
                raise ModelError(
                    "supports",
                    dict(part.body.supports),
                    f"body {part.body.name!r} can move freely: support it, or hold it by contact",
                )

    @property
    def n_unknowns(self) -> int:
        """Displacement unknowns of all parts."""
        return sum(len(part.free) for part in self.parts)

    @cached_property
    def touching(self) -> float:
        """Largest gap or overlap before loading that counts as touching [mm]."""
        lengths = [np.ptp(i.slave_surface.X, axis=1).max() for i in self.interfaces]
        return _TOUCHING * float(max(lengths, default=0.0))

    @cached_property
    def moves(self) -> bool:
        """Whether a load moves along a body."""
        return any(part.moves for part in self.parts)

    @property
    def has_amplitude(self) -> bool:
        """Whether a pressure follows an amplitude of its own, not the time."""
        return any(body.amplitude is not None for body in self.model.bodies)

    @cached_property
    def overlapping(self) -> bool:
        """Whether bodies overlap before loading; moving loads are set down so that they touch."""
        return not self.moves and any(
            (contact.gap < -self.touching).any() for contact in self.initial().contacts
        )

    @cached_property
    def proportional(self) -> bool:
        """Whether an elastic state depends on the load alone, and not on its history.

        True without friction, and where all facing vertices touch before loading: every status
        then stays the same while the load grows. A limit of shear makes it false, since it does
        not grow with the load.
        """
        if self.overlapping or not all(np.isinf(i.shear_strength) for i in self.interfaces):
            return False
        gaps = np.concatenate([np.zeros(0), *(c.gap for c in self.initial().contacts)])
        conforming = (np.isinf(gaps) | (np.abs(gaps) < self.touching)).all()
        return bool(conforming) or all(i.friction == 0 for i in self.interfaces)

    def part(self, name: str) -> int:
        """Return the number of the part called ``name``."""
        return [body.name for body in self.model.bodies].index(name)

    def full(self, name: str) -> Discretisation:
        """Return the whole body called ``name``."""
        return self._wholes[name]

    def displacement(self, name: str, state: State) -> NDArray[np.float64]:
        """Return the displacements (n,) of a whole body [mm]."""
        number = self.part(name)
        part, u = self.parts[number], state.u[number]
        return part.expand(u, state.time)

    def response(self, name: str, converged: Converged) -> Response:
        """Return stress and internal variables at the points of a whole body."""
        number = self.part(name)
        if not self.parts[number].meshed:
            whole = self.full(name)
            return whole.respond(self.displacement(name, converged.state), whole.virgin())
        return converged.responses[number]

    def initial(self) -> State:
        """Return the unloaded, undeformed state."""
        u = tuple(part.start() for part in self.parts)
        contacts = []
        for interface in self.interfaces:
            gap = interface.pairing(u).gap
            contacts.append(ContactState.at_rest(gap, gap <= self.touching))
        return State(0.0, u, tuple(part.virgin() for part in self.parts), tuple(contacts))

    def moved(self, state: State, time: float) -> State:
        """Return a state with prescribed motions at their values for a time."""
        parts = zip(self.parts, state.u, strict=True)
        return replace(state, u=tuple(part.moved(u, time) for part, u in parts))

    def set_down(self, state: State, time: float) -> State:
        """Return the state at the time a lap begins: its wheels undeformed and just touching."""
        u, contacts = list(state.u), list(state.contacts)
        for number, part in enumerate(self.parts):
            if not isinstance(part, Wheel):
                continue
            u[number] = part.placed(time)
            own = [k for k, i in enumerate(self.interfaces) if number in (i.slave, i.master)]
            gaps = [self.interfaces[k].pairing(tuple(u)).gap for k in own]
            least = min(gap.min() for gap in gaps)
            u[number] = part.lowered(u[number], least)
            for k, gap in zip(own, gaps, strict=True):
                contacts[k] = ContactState.at_rest(gap, gap < least + _SET_DOWN * part.radius)
        return replace(state, time=time, u=tuple(u), contacts=tuple(contacts))
