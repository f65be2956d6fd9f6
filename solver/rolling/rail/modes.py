"""A prism that repeats every length L, solved wave by wave on a zone of its cross-section.

Fields are given and found at n equispaced stations x_c = -c L / n, numbered downstream from
station 0 at x = 0; the load moves along +x. With the amplitudes U_m of
`solver.rolling.rail.section`,

    u(x_c) = sum_m (i U_x, U_y, U_z)_m e^{i k_m x_c},    k_m = -2 pi m / L

so that U_m is the discrete Fourier transform over c. Forces act and results are needed only at a
window of stations and in a zone of the section; the rest of the section is condensed, wave by wave,
onto the rim of the zone. The transform from and to a window is a product with a matrix (stations,
waves), which costs little more than a fast transform over all stations and leaves the waves
together.

Waves shorter than two stations are missing: under forces that differ from station to station,
stress less than a station's spacing below the surface is not resolved.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from solver.errors import ModelError
from solver.late import late
from solver.linear import solvers as linear
from solver.linear.schur import Elimination, with_block
from solver.linear.solvers import Factors
from solver.rolling.rail.section import I_AXIS, I_COMPONENTS, Carried, Section
from solver.typing import Array, Bools, Ints

_ORDER = (0, 1, 2, 4, *I_COMPONENTS)
"""Order of the Mandel components inside this module: those that carry i come last."""
_PLAIN = len(_ORDER) - len(I_COMPONENTS)

(weighted,) = late("rolling.kernels", "weighted")


class Modes:
    """The waves of a prism that repeats every ``length``, factorised.

    Parameters
    ----------
    section : the cross-section
    zone : (n_elements,) elements that may have eigenstress and surface forces
    length : L [mm]
    stations : n, even
    window : number of stations, from station 0 on, with forces and results; all by default
    behind : (n - window,) factors with which the eigenstress of the last station of the window goes
        on at the stations behind it; by default there is none
    loads : number of equal forces on the rows, L / loads apart; the first ones are in the window
    surface : (n_rows, section.n) rows of the displacements wanted at the surface; a force on a row
        acts by its transpose. All entries of a row are along x, or none. By default there are none

    Attributes
    ----------
    wavenumbers : (n / 2 + 1,) k_m [1/mm]
    x : (window,) positions of the stations [mm]
    behind : the factors behind the window, as given
    precision : type of fields
    unknowns : (m,) unknowns of the section that the zone has, without supported ones
    points : (n_points,) numbers of the points of the zone in the section, element by element
    weights : (n_points,) area of the points [mm2]
    B0, B1 : (6 n_points, m) sparse strain operators of the zone; rows by component, in an order of
        their own
    rows : (n_rows, m) sparse, ``surface`` on the unknowns of the zone
    along : (n_rows,) whether a row is along x
    carrying : (6 n_points,) whether a row of B0 and B1 carries i

    Raises
    ------
    ModelError
        if the zone is empty, a number out of range, or a row mixed or outside the zone
    """

    def __init__(
        self,
        section: Section,
        zone: Bools,
        length: float,
        stations: int,
        *,
        window: int | None = None,
        behind: Sequence[float] | Array = (),
        loads: int = 1,
        surface: sparse.csr_array | None = None,
    ) -> None:
        window = stations if window is None else window
        _check(section, zone, length, stations, window, behind)
        self.section, self.length, self.stations = section, length, stations
        self.precision: np.dtype[Any] = np.dtype(float)
        self.wavenumbers = -2 * np.pi / length * np.arange(stations // 2 + 1)
        self.x = -length / stations * np.arange(window)
        inside = np.flatnonzero(zone)
        self.unknowns = np.intersect1d(section.dofs[inside], section.free)
        n_points = section.weights.shape[1]
        self.points = (inside[:, None] * n_points + np.arange(n_points)).ravel()
        self.weights = section.weights[inside].ravel()
        both = section.strain_matrices(inside, self.unknowns)
        order = np.arange(both[0].shape[0]).reshape(6, -1)[list(_ORDER)].ravel()
        self.B0, self.B1 = (B[order] for B in both)
        self.carrying = np.repeat([False] * _PLAIN + [True] * len(I_COMPONENTS), len(self.points))
        areas = sparse.diags_array(np.tile(self.weights, 6))
        self._force0 = sparse.csc_array(self.B0.T @ areas)
        self._force1 = sparse.csc_array(self.B1.T @ areas)
        self._set_rows(surface, zone)
        # equal forces at equal distances leave every loads-th wave
        self._loads = np.where(np.arange(stations // 2 + 1) % loads, 0.0, float(loads))
        self.behind = np.asarray(behind, dtype=float)
        self._set_transforms(window, self.behind)
        self._factors, self._carried = _factorised(
            section, self.unknowns, self.wavenumbers.tolist()
        )

    @cached_property
    def single(self) -> Modes:
        """The same waves, in single precision."""
        other, kind = copy(self), np.dtype(np.float32)
        other.precision = kind
        for name in ("B0", "B1", "_force0", "_force1", "rows", "_twice_k"):
            setattr(other, name, getattr(self, name).astype(kind))
        other.columns = self.columns  # few of them are read at a time
        for name in ("_into", "_into_behind", "_back"):
            setattr(other, name, tuple(each.astype(kind) for each in getattr(self, name)))
        return other

    def _set_rows(self, surface: sparse.csr_array | None, zone: Bools) -> None:
        """Restrict the surface rows to the zone."""
        section = self.section
        rows = sparse.csr_array((0, section.n)) if surface is None else sparse.csr_array(surface)
        axis = np.arange(section.n) % 3 == I_AXIS
        size = abs(rows)
        parts = np.stack([size @ axis.astype(float), size @ (~axis).astype(float)])
        for row in np.flatnonzero((parts > 0).all(axis=0))[:1]:
            raise ModelError("surface", int(row), "this row is along x and across it: must be one")
        outside = ~np.isin(np.arange(section.n), section.dofs[zone])
        for row in np.flatnonzero(size @ outside.astype(float) > 0)[:1]:
            raise ModelError("surface", int(row), "this row has nodes outside the zone")
        self.along = parts[0] > 0
        self.rows = sparse.csr_array(rows[:, self.unknowns])

    def _set_transforms(self, window: int, behind: Array) -> None:
        """Set the matrices between stations and amplitudes: (window, 2 waves), real, imaginary."""
        n = self.stations
        phase = 2 * np.pi / n * (np.outer(np.arange(n), np.arange(n // 2 + 1)) % n)
        cos, sin = np.cos(phase), np.sin(phase)
        # f = sum over c of f_c e^(-i phase); divided by i for what carries i
        plain = np.stack([cos, -sin], axis=-1).reshape(n, -1)
        carrying = np.stack([-sin, -cos], axis=-1).reshape(n, -1)
        loads = np.repeat(self._loads, 2)
        self._into = plain[:window] * loads, carrying[:window] * loads
        twice = np.full(n // 2 + 1, 2.0)
        twice[[0, -1]] = 1.0
        self._share = twice / n
        share = np.repeat(self._share, 2)
        self._back = (share * plain[:window]).T.copy(), (share * carrying[:window]).T.copy()
        self._into_behind = plain[:window], carrying[:window]
        if len(behind):
            self._into_behind = plain[:window].copy(), carrying[:window].copy()
            self._into_behind[0][-1] += behind @ plain[window:]
            self._into_behind[1][-1] += behind @ carrying[window:]
        self._twice_k = np.repeat(self.wavenumbers, 2)

    # -- forces and results ------------------------------------------------------------------

    def strain(self, u: Array) -> Array:
        """Return the strain (n_points, window, 6) of amplitudes (waves, 2, m) of the zone."""
        flat = np.ascontiguousarray(u.reshape(-1, len(self.unknowns)).T)
        return self._strain_at_stations(self.B0 @ flat + self.B1 @ (flat * self._twice_k))

    def solved(self, nodal: Array) -> Array:
        """Return the amplitudes (waves, 2, m) of the zone for nodal forces of that shape [N/mm].

        Real and imaginary parts; those of unknowns along x are divided by i.
        """
        u = np.empty_like(nodal)
        for wave, right in enumerate(nodal):
            u[wave] = self._solve(right.T, wave).T
        return u

    def _solve(self, forces: Array, wave: int) -> Array:
        """Return the amplitudes (m, ...) of the zone for nodal forces (m, ...) of a wave."""
        if wave:
            return self._factors.solve(forces, wave)
        return self._carried.solved(lambda left: self._factors.solve(left, 0), forces)

    def displacement(self, nodal: Array) -> Array:
        """Return the surface displacement (n_rows, window) by `columns` [mm].

        Parameters
        ----------
        nodal : (waves, 2, m) nodal forces, as for `solved` [N/mm]
        """
        amplitudes = weighted(nodal, self.columns)  # (waves, 2, n_rows)
        return self._rows_at_stations(amplitudes.reshape(-1, len(self.along)).T)

    def moved_by(self, forces: Array) -> Array:
        """Return the amplitudes (waves, 2, m) of the zone for forces (n_rows, window) alone."""
        each = self._by_wave(self._of_rows(forces))  # (waves, 2, n_rows)
        return np.matmul(each, self.columns.swapaxes(1, 2))

    def at_station(self, station: int, u: Array) -> Array:
        """Return the displacement (m,) of the zone's unknowns at a station by amplitudes [mm]."""
        flat = u.reshape(-1, len(self.unknowns)).T
        plain, carrying = (back[:, station] for back in self._back)
        return np.where(self.unknowns % 3 == I_AXIS, flat @ carrying, flat @ plain)

    def constant(self, eigenstress: Array) -> tuple[Array, Array]:
        """Return strain (n_points, 6) and displacement (n_rows,) by eigenstress constant along x.

        Parameters
        ----------
        eigenstress : (n_points, 6) at all stations [MPa]
        """
        flat = eigenstress.T[list(_ORDER)].ravel()
        u = self._solve(self._force0 @ flat, 0)
        strain = np.empty((6, len(self.points)))
        strain[list(_ORDER)] = (self.B0 @ u).reshape(6, -1)
        return strain.T, np.asarray(self.rows @ u)

    @cached_property
    def columns(self) -> Array:
        """Displacements (waves, m, n_rows) of the zone for unit forces on the rows [mm2/N]."""
        each = self.rows.T.toarray()
        waves = range(len(self.wavenumbers))
        return np.stack([self._solve(each, wave) for wave in waves])

    @cached_property
    def compliance(self) -> Array:
        """Displacements (waves, n_rows, n_rows) of the rows for unit forces on them [mm2/N]."""
        return np.stack([self.rows @ each for each in self.columns])

    @cached_property
    def kernel(self) -> Array:
        """Displacement of the rows for unit forces at one station (n_rows, n_rows, stations).

        ``kernel[i, j, d]`` is that of row i, d stations downstream of a force on row j [mm2/N];
        -d is ``stations - d``.
        """
        apart = -self.length / self.stations * np.arange(self.stations)
        phase = np.outer(self.wavenumbers, apart)
        amplitudes = self.compliance.swapaxes(0, 1)
        share = self._share * self._loads
        return superposed(amplitudes, phase, share, self.along, self.along)

    def nodal(self, eigenstress: Array) -> Array:
        """Return the nodal forces (waves, 2, m) of an eigenstress (n_points, window, 6) [N/mm].

        Only points that have some are used, since few yield.
        """
        some = np.flatnonzero(eigenstress.any(axis=(1, 2)))
        s = self._amplitudes(eigenstress[some])
        at = (len(self.points) * np.arange(6)[:, None] + some).ravel()
        nodal = self._force0[:, at] @ s
        nodal += (self._force1[:, at] @ s) * self._twice_k
        return self._by_wave(nodal)

    def pushed(self, forces: Array) -> Array:
        """Return the nodal forces (waves, 2, m) of forces (n_rows, window) on the rows [N/mm]."""
        return self._by_wave(self.rows.T @ self._of_rows(forces))

    def _by_wave(self, nodal: Array) -> Array:
        """Return nodal forces (waves, 2, m) from (m, 2 waves)."""
        each = nodal.T.reshape(len(self.wavenumbers), 2, -1)
        return np.ascontiguousarray(each)

    def _amplitudes(self, stress: Array) -> Array:
        """Return the amplitudes (6 n, 2 waves) of a stress (n, window, 6)."""
        by_component = np.ascontiguousarray(np.moveaxis(stress, 2, 0)[list(_ORDER)])
        flat = by_component.reshape(-1, stress.shape[1])
        split = _PLAIN * len(stress)
        out = np.empty((len(flat), len(self._twice_k)), self.precision)
        np.matmul(flat[:split], self._into_behind[0], out=out[:split])
        np.matmul(flat[split:], self._into_behind[1], out=out[split:])
        return out

    def _strain_at_stations(self, amplitudes: Array) -> Array:
        """Return the strain (n_points, window, 6) of amplitudes (6 n_points, 2 waves)."""
        split = _PLAIN * len(self.points)
        plain, carrying = self._back
        strain = np.empty((len(amplitudes), len(self.x)), self.precision)
        np.matmul(amplitudes[:split], plain, out=strain[:split])
        np.matmul(amplitudes[split:], carrying, out=strain[split:])
        return self.by_point(strain)

    def by_point(self, strain: Array) -> Array:
        """Return strain (n_points, window, 6, ...) from rows (6 n_points, window, ...) of B0."""
        by_component = strain.reshape(6, -1, *strain.shape[1:])
        out = np.empty((*by_component.shape[1:3], 6, *strain.shape[2:]), strain.dtype)
        for values, component in zip(by_component, _ORDER, strict=True):
            out[:, :, component] = values
        return out

    def _of_rows(self, forces: Array) -> Array:
        """Return the amplitudes (n_rows, 2 waves) of forces (n_rows, window)."""
        plain, carrying = self._into
        return np.where(self.along[:, None], forces @ carrying, forces @ plain)

    def _rows_at_stations(self, amplitudes: Array) -> Array:
        """Return the displacements (n_rows, window) of amplitudes (n_rows, 2 waves)."""
        plain, carrying = self._back
        return np.where(self.along[:, None], amplitudes @ carrying, amplitudes @ plain)


def superposed(
    amplitudes: Array,
    phase: Array,
    share: Array,
    carrying: Bools,
    along: Bools,
) -> Array:
    """Return results (n_results, n_loads, n_places) of loads as sums of waves.

    Parameters
    ----------
    amplitudes : (n_results, waves, n_loads) real amplitudes for real amplitudes 1 of the loads
    phase : (waves, n_places) k times the distance along x from the load
    share : (waves,) factors of the waves
    carrying, along : (n_results,), (n_loads,) whether a result, a load carries i
    """
    # Re(i e^(i phase)) = -sin, and a load that carries i is divided by it
    factors = {
        (False, False): np.cos(phase),
        (True, True): np.cos(phase),
        (True, False): -np.sin(phase),
        (False, True): np.sin(phase),
    }
    out = np.empty((len(carrying), len(along), phase.shape[1]))
    for (i_result, i_load), factor in factors.items():
        results, loads = np.flatnonzero(carrying == i_result), np.flatnonzero(along == i_load)
        some = amplitudes[results][:, :, loads]
        out[np.ix_(results, loads)] = np.tensordot(some, share[:, None] * factor, axes=(1, 0))
    return out


def _check(
    section: Section,
    zone: Bools,
    length: float,
    stations: int,
    window: int,
    behind: Sequence[float] | Array,
) -> None:
    """Raise `ModelError` for bad input of `Modes`."""
    elements = len(section.weights)
    if zone.shape != (elements,) or zone.dtype != bool or not zone.any():
        raise ModelError("zone", zone.shape, f"must choose some of {elements} elements")
    if not (np.isfinite(length) and length > 0):
        raise ModelError("length", length, "must be positive [mm]")
    if stations < 2 or stations % 2:
        raise ModelError("stations", stations, "must be even and positive")
    if not 0 < window <= stations:
        raise ModelError("window", window, f"must be in 1 to {stations}, the number of stations")
    if len(behind) not in (0, stations - window):
        raise ModelError("behind", len(behind), f"must have {stations - window} factors, or none")


def _factorised(
    section: Section, zone: Ints, wavenumbers: Sequence[float]
) -> tuple[Factors, Carried]:
    """Return the factors of each wave on some unknowns, the others condensed; the first k is 0."""
    rest = np.setdiff1d(section.free, zone)
    coupled = np.isin(section.dofs, rest).any(axis=1)
    rim = np.intersect1d(section.dofs[coupled], zone)
    own, outside = section.stiffness(zone), section.stiffness(np.concatenate([rest, rim]))
    elimination = Elimination(outside.pattern, len(rest))
    first, second = np.triu_indices(len(rim))
    place = np.searchsorted(zone, rim)
    row, column = own.pattern.tocoo().coords
    pattern, sparse_slot, dense_slot = with_block(row, column, place, len(zone))
    factors = linear.analyse_several(pattern, len(wavenumbers))
    for wave, k in enumerate(wavenumbers):
        data = np.zeros(pattern.nnz)
        data[sparse_slot] = own.at(k)
        data[dense_slot] -= elimination.taken(outside.at(k))[first, second]
        factors.factorise(data, wave)
        if wave == 0:
            reactions = section.sprung[zone]
            condensed = elimination.forward(section.sprung[np.concatenate([rest, rim])])
            reactions[place] = condensed[len(rest) :]
            carried = Carried(section.loose[zone], reactions)
    return factors, carried
