"""Audit figures of each contact pair, measured on the deformed bodies.

The discretisation error of pressure (`contact_error`) is an estimate. Pressure comes from the
contact forces. The stress of the body gives a second value, -n . sigma . n,
with sigma recovered from patches of elements inside the body (`ErrorPoints`), without the contact
forces. Both converge to the true pressure as the mesh is refined, but differently: their difference
has the magnitude of the error. It is large if the contact has few edges.

It is evaluated on the slave, or on the master if the slave is rigid and has no stress. The figure
is the integral of the absolute difference over the area before loading, of a body of large strain
over the present one, divided by the contact force.
(The integral of the square is unbounded under refinement at a sharp corner.)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from solver.audit.plain import LEAST
from solver.audit.surfaces import PairState, Surfaces, deformed
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.error import ErrorPoints
from solver.fem.surface import Surface
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.friction import ContactPlaces, lines_of
from solver.model.pairs import ContactPair
from solver.tensors import to_tensor
from solver.typing import Array, Bools

PRESSED = 1e-6
"""Normal force of a vertex over the force level: the vertex is open below this ratio."""
GAP = 2e-3
"""Gap over the elastic approach, at most."""
OVERLAP = (0.02, 2.5e-3)
"""Overlap over the elastic approach, and over the side of an element, at most; the larger limit
counts."""
COARSE = 0.36
"""Edge over the width of the contact of curved surfaces, at most: about three vertices across the
contact, with which the error of Hertz's pressure is 4 %."""
_LITTLE = 0.01
"""Force of a pair over the force level: below it the resolution of its contact is not checked."""
_CUT = 0.9
"""Share of a hat that faces the master: with less the pressure at the vertex, a mean under the
whole hat, is too low by more than a tenth."""
STILL = 1e-3
"""Least slip over the elastic approach, in the friction work to which wrong slip refers."""


class LeftOut(NamedTuple):
    """The error of small sliding; means are weighted with the normal force.

    Attributes
    ----------
    way : motion along the partner [mm]
    sides, length : the same over the side of an element, and over the length of the contact
    off : error of the gap over the elastic approach
    x, y : position of the largest motion [mm]
    """

    way: float
    sides: float
    length: float
    off: float
    x: float
    y: float


_LEFT_OUT = LeftOut(way=np.inf, sides=1.0, length=0.01, off=5e-3, x=np.nan, y=np.nan)
"""Limits; that of ``length`` applies if a surface is curved."""


def untouched(system: System, states: Iterable[Converged]) -> tuple[str, ...]:
    """Return a warning for each pair that touches in none of the states."""
    every = [converged.state for converged in states]
    return tuple(
        f"{' and '.join(_names(pair))} do not touch at the end of any stage: move them together, "
        "or remove the pair"
        for k, pair in enumerate(system.model.contacts)
        if not any(_closed(state, k).any() for state in every)
    )


def _closed(state: State, number: int) -> Bools:
    return np.asarray(state.contacts[number].normal > PRESSED * state.force_scale)


def _names(pair: ContactPair) -> tuple[str, str]:
    return ".".join(pair.slave), ".".join(pair.master)


class AuditedPair:
    """A contact pair in a converged increment.

    Attributes
    ----------
    measured : gaps, slips and nodal forces, measured on the bodies
    normal, tangential : contact forces (n,) of the state [N]
    """

    def __init__(self, system: System, number: int, converged: Converged) -> None:
        self._system = system
        self._pair: ContactPair = system.model.contacts[number]
        self._number = number
        contact, self._start = converged.state.contacts[number], converged.start
        self.normal, self.tangential = contact.normal, contact.tangential
        self._state = converged.state
        self._closed = _closed(converged.state, number)
        self.surfaces = Surfaces(system, number, finite=contact.finite)
        self.measured: PairState = self.surfaces.measured(
            converged.state, converged.start, self.normal, self.tangential
        )

    @property
    def bodies(self) -> tuple[str, str]:
        """Names of slave and master body."""
        return self._pair.slave[0], self._pair.master[0]

    @property
    def approach(self) -> float:
        """Elastic approach of the bodies [mm]: peak pressure over E*, times the contact's width."""
        closed, area = self._closed & (self.measured.area > 0), self.measured.area
        if not closed.any():
            return 0.0
        pressure = float((self.normal[closed] / area[closed]).max())
        return pressure * self._compliance * float(self.measured.edge[closed].sum())

    @property
    def _compliance(self) -> float:
        """One over the contact modulus E* [1/MPa]."""
        moduli = (self._system.model.body(name).material.elasticity for name in self.bodies)
        return sum(1 / elasticity.plane_strain_modulus for elasticity in moduli)

    @property
    def rounding(self) -> float:
        """Gap or slip that counts as zero, at the force level of the model [mm]."""
        depth = self.measured.area.sum() / self.measured.edge.sum()
        closer = self._state.force_scale * self._compliance / depth if depth else 0.0
        return max(LEAST * closer, self._system.gap_tolerance)

    @property
    def force(self) -> float:
        """Sum of the normal forces [N]."""
        return float(self.normal[self._closed].sum())

    @property
    def limits(self) -> dict[str, float]:
        """Limits of this pair, by figure."""
        edges = self.measured.edge[self._closed] if self._closed.any() else self.measured.edge
        overlap = max(OVERLAP[0] * self.approach, OVERLAP[1] * float(edges.mean()))
        return {
            "audit_closed_gap": max(GAP * self.approach, self.rounding),
            "audit_overlap": max(overlap, self.rounding),
            "audit_contact_resolution": COARSE,
        }

    @cached_property
    def left_out(self) -> LeftOut | None:
        """The error of small sliding; None if nothing slides, or sliding is finite."""
        if self.surfaces.finite or self.force <= 0.0:
            return None
        share = np.where(self._closed, self.normal, 0.0) / self.force
        edge, measured = self.measured.edge, self.measured
        moved = np.abs(np.nan_to_num(measured.way)) * share
        way = float(moved.sum())
        off = float(np.abs(np.nan_to_num(measured.true_gap - measured.gap)) @ share)
        slave = self.surfaces.slave
        x, y = slave.X[:, slave.vertices[moved.argmax()]]
        return LeftOut(
            way=way,
            sides=way / float(edge @ share),
            length=way / float(edge[self._closed].sum()),
            off=off / (self.approach or np.inf),
            x=float(x),
            y=float(y),
        )

    @property
    def outside(self) -> tuple[str, ...]:
        """A message if surfaces have moved by more than the side of an element."""
        left_out = self.left_out
        return (self._describe(left_out),) if left_out and left_out.sides > _LEFT_OUT.sides else ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages on a smaller but relevant error of small sliding, and on a cut peak."""
        left_out, cut = self.left_out, self._cut_peak
        if not left_out or self.outside:
            return cut
        far = self.surfaces.curved and left_out.length > _LEFT_OUT.length
        return (*(self._describe(left_out),) * (far or left_out.off > _LEFT_OUT.off), *cut)

    @property
    def _cut_peak(self) -> tuple[str, ...]:
        """A message if the largest pressure is where the master ends under the slave."""
        slave = self.surfaces.slave
        cut = self._closed & (self.measured.area < _CUT * slave.hats)
        if not cut.any():
            return ()
        pressure, _ = self._system.pressure(self._state, self._number)
        near = cut | np.append(cut[1:], False) | np.append(False, cut[:-1])
        at = int(np.where(near, pressure, -np.inf).argmax())
        if pressure[at] < pressure.max():
            return ()
        x, y = slave.X[:, slave.vertices[at]]
        own, other = _names(self._pair)
        return (
            f"{own} has its largest pressure at ({x:z.4g}, {y:z.4g}), where it extends beyond the "
            f"end of {other}: pressure there is a mean over a partly covered edge, and too low. "
            "Exchange slave and master of this pair, or use smaller elements there",
        )

    def _describe(self, left_out: LeftOut) -> str:
        slave, master = _names(self._pair)
        return (
            f"{slave} moved {left_out.way:.2g} mm along {master}, mostly at ({left_out.x:z.4g}, "
            f"{left_out.y:z.4g}): {left_out.sides:.2g} sides of an element, "
            f"{left_out.length:.1%} of the length of contact; gaps differ by {left_out.off:.1%} of "
            "the elastic approach. Small sliding neglects this: for a pair of your own, in a scene "
            'file or a model, set sliding = "finite"'
        )

    @cached_property
    def _bound(self) -> Array:
        """The friction bound (n,) [N], from the measured area and strength."""
        places = ContactPlaces(
            n=len(self.normal),
            find_strength=lambda: self.measured.strength,
            find_plastic_strain=lambda: self._system.plastic_strain(self._number, self._start),
            find_slip=lambda: self._start.contacts[self._number].slipped[0],
        )
        return lines_of(self._pair.law, places).over(self.measured.area).least(self.normal)

    @cached_property
    def figures(self) -> dict[str, float]:
        """The figures of the pair; lengths in mm, forces in N."""
        gap, true = np.nan_to_num(self.measured.gap), np.nan_to_num(self.measured.true_gap)
        pressed = np.where(self._closed, self.normal, 0.0)
        pressed /= max(float(pressed.sum()), 1e-300)
        # the mean over the area: at a sharp corner the overlap of the last vertex is distortion
        deep = np.maximum(-np.minimum(gap, true), 0.0) @ self.measured.area
        area = float(self.measured.area[self._closed].sum() or self.measured.area.sum())
        found = {
            "audit_overlap": max(float(deep) / (area or 1.0), float(np.abs(true) @ pressed)),
            "audit_closed_gap": float(np.abs(gap) @ pressed),
            "audit_tension": max(0.0, -float(self.normal.min(initial=0.0))),
            "audit_friction_excess": float(
                (np.abs(self.tangential) - self._bound).max(initial=0.0)
            ),
            "audit_slip": self._wrong_slip(),
            "audit_contact_resolution": self._coarseness(),
        }
        if self._pair.left(self._start.time, self._state.time) is not None:
            # forces of a pair being removed are prescribed, whatever its gaps
            found |= dict.fromkeys((*self.limits, "audit_slip"), 0.0)
        return found

    def _coarseness(self) -> float:
        """Return the longest edge in a contact of curved surfaces over its width; 0 if flat.

        If bodies overlap although no vertex has a force, the width is that of the overlap.
        """
        if not self.surfaces.curved:
            return 0.0
        if not self._closed.any():
            deep = self.measured.point_gap < -self.limits["audit_overlap"]
            width = float(self.measured.point_length[deep].sum())
            return float(self.measured.edge.max()) / width if width else 0.0
        little = _LITTLE * self._state.force_scale
        if self.force <= little:
            return 0.0
        return self.surfaces.coarseness(self._state, np.where(self._closed, self.normal, 0.0))

    def _wrong_slip(self) -> float:
        """Return the friction work missing because of wrong slip, over the friction work.

        Slip is wrong if the shear is below its bound, or if the friction force on the vertex does
        not oppose it. Vertices new in contact are left out.
        """
        before = self._start.contacts[self._number].touching
        judged = self._closed & before & (self.measured.area > 0)
        bound, slip = self._bound[judged], np.nan_to_num(self.measured.slip[judged])
        least = max(STILL * self.approach, self.rounding)
        should = float(bound @ np.maximum(np.abs(slip), least))
        if should == 0.0:
            return 0.0
        does = -float(self.tangential[judged] @ slip)
        return (float(bound @ np.abs(slip)) - does) / should


_XI, _WEIGHT = np.polynomial.legendre.leggauss(4)
_ROUNDING = 1e-6
"""Pressure over the largest stress of the body: a smaller ratio is rounding."""
_BEYOND = 1e-6
"""Distance of a point beyond the end of a chord, over its length: up to it the point belongs to the
chord."""


def contact_error(system: System, converged: Converged) -> float:
    """Return the estimated error of contact pressure, over the contact force of all pairs.

    Only edges with pressure count; 0 if there are none, as after unloading.
    """
    error, level = 0.0, 0.0
    recovered: dict[str, Array] = {}
    for k, pair in enumerate(system.model.contacts):
        at_vertices, _ = system.pressure(converged.state, k)
        if not at_vertices.any():
            continue
        name, boundary = pair.slave if pair.slave[0] in system.names else pair.master
        if name not in recovered:
            points = ErrorPoints(system.full(name))
            recovered[name] = points.at_nodes(system.state(name, converged).stress)
        if at_vertices.max() <= _ROUNDING * np.nan_to_num(np.abs(recovered[name])).max():
            continue
        chain = system.chain(name, boundary)
        if system.full(name).body.large:  # its stress is that on the deformed area
            at_vertices = at_vertices * system.pairing(converged.state, k).shrunk
            chain = replace(chain, X=deformed(system, name, converged.state)[0][:, chain.nodes])
        if name == pair.slave[0]:
            ends = np.stack([at_vertices[:-1], at_vertices[1:]], axis=1)
            pressure = ends @ np.stack([1 - _XI, 1 + _XI]) / 2
        else:
            pressure = _carried(system, k, converged.state, chain, at_vertices)
        here = _integrals(chain, pressure, to_tensor(recovered[name][:, chain.nodes]))
        error, level = error + here[0], level + here[1]
    return error / level if level else 0.0


def _carried(
    system: System, number: int, state: State, chain: Surface, at_vertices: Array
) -> Array:
    """Return the pressure of a rigid slave at points of its master (n_edges, n_points) [MPa].

    It is the pressure at the nearest place on the chords with pressure, or zero beyond their ends.
    """
    pair = system.model.contacts[number]
    slave, finite = system.chain(*pair.slave), state.contacts[number].finite
    x, moved = slave.X, chain.X  # small sliding pairs positions before loading
    if finite:
        x = deformed(system, pair.slave[0], state)[0][:, slave.nodes]
        moved = deformed(system, pair.master[0], state)[0][:, chain.nodes]
    x = x[:, slave.vertices]
    pressed = (at_vertices[:-1] != 0) | (at_vertices[1:] != 0)
    start, way = x[:, :-1][:, pressed], np.diff(x)[:, pressed]
    points = moved[:, chain.edges] @ shape_functions(_XI, chain.edges.shape[1]).T
    out = np.zeros(points.shape[1:])
    reach = np.hypot(*way).max()
    low, high = (of(start, start + way).T for of in (np.minimum, np.maximum))
    low, high = low.min(axis=0) - reach, high.max(axis=0) + reach
    near = ((points.T >= low) & (points.T <= high)).all(axis=-1).T
    to = points[:, near][:, :, None] - start[:, None]
    share = (to * way[:, None]).sum(axis=0) / (way**2).sum(axis=0)
    foot = np.clip(share, 0.0, 1.0)
    nearest = np.hypot(*(to - foot * way[:, None])).argmin(axis=1)
    at = np.arange(len(nearest)), nearest
    first, last = at_vertices[:-1][pressed][nearest], at_vertices[1:][pressed][nearest]
    value = first + foot[at] * (last - first)
    out[near] = np.where(np.abs(share[at] - foot[at]) < _BEYOND, value, 0.0)
    return out


def _integrals(chain: Surface, pressure: Array, stress: Array) -> tuple[float, float]:
    """Return the integrals of abs(p + n . sigma . n) and of p over a surface [N].

    Parameters
    ----------
    pressure : (n_edges, n_points) at points of its edges [MPa]
    stress : (4, n_nodes) components xx, yy, zz, xy at its nodes [MPa]
    """
    k = chain.edges.shape[1]
    at, shape = chain.X[:, chain.edges], shape_functions(_XI, k)
    tangent = at @ shape_derivatives(_XI, k).T  # (2, n_edges, n_points)
    length = np.hypot(*tangent)
    nx, ny = tangent[1] / length, -tangent[0] / length
    xx, yy, _, xy = stress[:, chain.edges] @ shape.T
    across = nx**2 * xx + ny**2 * yy + 2 * nx * ny * xy
    area = _WEIGHT * length * chain.depth(at @ shape.T) * (pressure != 0).any(axis=1, keepdims=True)
    area = np.where(np.isnan(across), 0.0, area)  # next to removed elements
    off = np.abs(pressure + np.nan_to_num(across))
    return float((area * off).sum()), float((area * pressure).sum())
