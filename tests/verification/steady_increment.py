"""A steady pass of a wheel, put into the system that goes by increments, and one increment of it.

The increment takes the axle from x = -h to 0, where the mesh has the steady state: h is the side of
the elements, so that every vertex, node of the rim and point takes the place of the next one
downstream.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from solver import Model, System
from solver.contact.geometry import pair
from solver.contact.problem import OPEN
from solver.contact.state import ContactState, Converged, State
from solver.loading.increment import Increment
from solver.materials.elastic_plastic import Material
from solver.model.amplitude import Amplitude
from solver.model.body import Axle
from solver.model.pairs import ContactPair
from solver.rolling.passing import passing
from solver.rolling.plane.track import under_load
from solver.rolling.plane.wheel import flowed
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import load_on, rim_of
from solver.rolling.scenes.rolling_model import wheel_body
from tests.verification.interleaved import InterleavedTrack

Array = NDArray[np.float64]


def until_now(before: float) -> Amplitude:
    """Return what goes from a value to zero in the increment."""
    return Amplitude(np.array([0.0, 1.0]), np.array([before, 0.0]))


class SteadyIncrement:
    """One increment from a steady pass, the first one over the track.

    ``reach`` enlarges the window. Behind it elements grow; a layer that the load leaves at yield
    flows there in increments, where the steady pass has it at rest.
    """

    def __init__(self, reach: float = 1.0, tolerance: float = 1e-6, **fields: object) -> None:
        self.parameters = p = RollingParameters(**fields)
        self.material = p.material()
        elasticity = self.material.elasticity
        self.track = InterleavedTrack(
            p.mesh_width, p.element_size, p.growth, elasticity, reach=reach
        )
        self.rim = rim_of(p)
        virgin, load = self.track.rows.virgin(self.material), load_on(self.track, p, p)
        self.found = passing(self.track, self.material, load, virgin, parts=1, tolerance=tolerance)
        self.arc = (1 - self.found.loading.creepage) * p.element_size
        """By which the wheel turns."""

    @cached_property
    def system(self) -> System:
        """Wheel and track, on the meshes of the pass."""
        p = self.parameters
        rotation = until_now(self.arc / p.radius) if p.guided else None
        axle = Axle(
            centre=(0.0, p.radius),
            radius=p.radius,
            force=Amplitude.constant(p.force),
            moment=Amplitude.constant(p.radius * p.traction * p.friction * p.force),
            position=until_now(-p.element_size),
            rotation=rotation,
        )
        stays_elastic = Material(youngs_modulus=p.youngs_modulus, poisson_ratio=p.poisson_ratio)
        wheel = wheel_body(axle, p.reach, p.element_size, stays_elastic)
        track = replace(self.track.part.body, material=self.material)
        contact = ContactPair(
            slave=(track.name, "contact"),
            master=(wheel.name, "rim"),
            friction=p.friction,
            sliding="finite",
        )
        return System(Model(bodies=(wheel, track), contacts=(contact,)))

    @cached_property
    def displacements(self) -> tuple[Array, Array]:
        """Those of the track, and of the rim from the forces on it, in the steady state."""
        u, touching = under_load(self.track, self.found).u, self.found.loading
        surface, rim = self.track.surface, self.rim.surface
        d, lifted = np.zeros((2, rim.X.size))
        lifted[1::2] = touching.height
        for _ in range(20):
            moved = ((d + lifted).reshape(-1, 2).T, u[surface.dofs].reshape(-1, 2).T)
            of_normal, of_tangent = (
                rows[1]
                for pairing in [pair(surface, moved[1], rim, moved[0])]
                for rows in (pairing.normal, pairing.tangent)
            )
            d = self.rim.compliance @ (
                touching.normal @ of_normal + touching.tangential @ of_tangent
            )
        return u, d

    def unknowns(self, elements: int) -> tuple[Array, Array]:
        """Those of wheel and track, so many elements before the load is at x = 0.

        Of the track those of its contact surface are right: the others mean nothing to it.
        """
        (u, d), p, touching = self.displacements, self.parameters, self.found.loading
        surface, rim = self.track.surface, self.rim.surface
        back, arc = u.copy(), elements * self.arc
        stretched = self.rim.passing(d) - self.rim.passing(np.zeros_like(d))
        for _ in range(elements):
            back[surface.dofs] -= flowed(surface, +1) @ back[surface.dofs]
            creeps = touching.creepage * p.element_size * stretched
            d = d - flowed(rim, -1) @ d - creeps
        c, s = np.cos(arc / p.radius), np.sin(arc / p.radius)
        wheel = np.zeros(self.system.parts[0].n)
        # in the frame of the hub, which turns by -arc / R from here to x = 0
        chain = self.system.interfaces[0].master_surface
        wheel[chain.dofs] = (np.array([[c, s], [-s, c]]) @ d.reshape(-1, 2).T).T.ravel()
        wheel[-3:] = -elements * p.element_size, touching.height, arc
        return wheel, back

    def start(self, *, from_touch: bool) -> State:
        """Return the state one element before.

        ``from_touch`` tells whether the slip of a vertex counts from when it touches; else it
        counts from here, for all vertices, as the steady pass takes it.
        """
        found, rows = self.found, self.track.rows
        whole = np.arange(self.track.part.weights.size)
        plastic = under_load(self.track, found).plastic.at(whole)
        packed = plastic.packed
        packed[:, rows.points] = np.concatenate(
            [found.before.state.packed[..., None], found.states.packed[..., :-1]], axis=2
        )
        plastic = plastic.unpacked(packed)
        u = self.unknowns(1)
        virgin = self.system.parts[0].virgin()
        return State(0.0, u, (virgin, plastic), (self._contact(u, from_touch=from_touch),))

    def _contact(self, u: tuple[Array, Array], *, from_touch: bool) -> ContactState:
        """Return the contact one element before, with the rates at which it comes about."""
        (interface,), touching = self.system.interfaces, self.found.loading
        now, before = interface.pairing(u), interface.pairing(earlier := self.unknowns(2))
        slip = interface.slip(now, u, earlier)
        faces = np.isfinite(now.gap) & np.isfinite(before.gap)
        closing = np.subtract(now.gap, before.gap, out=np.full_like(slip, np.nan), where=faces)
        status = np.append(OPEN, touching.status[:-1])
        return ContactState(
            normal=np.append(0.0, touching.normal[:-1]),
            tangential=np.append(0.0, touching.tangential[:-1]),
            status=status,
            touching=(status != OPEN) | (not from_touch),
            gap=now.gap,
            rates=np.stack([closing, np.where(faces, slip, np.nan)]),
            earlier=np.full((3, len(slip)), np.nan),
            finite=interface.finite,
            slipped=np.zeros((3, len(slip))),
        )

    def solve(self, *, from_touch: bool) -> Converged:
        """Return the increment, which begins its iterations where it starts."""
        start = self.start(from_touch=from_touch)
        return Increment(self.system, start, 1.0, guess=self.system.moved(start, 1.0)).solve()

    def change(self, increment: Converged) -> float:
        """Return 2 G |change of plastic strain| against the pass, the largest component [MPa]."""
        after = increment.state.plastic[1].plastic_strain[:, self.track.rows.points]
        change = np.moveaxis(after, 0, 2) - self.found.plastic_strain
        return 2 * self.material.elasticity.shear_modulus * float(np.abs(change).max())
