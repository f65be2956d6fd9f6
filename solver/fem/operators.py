"""The inverse stiffness of the parts of a model: factors, compliances, blended tangents."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from solver.fem.region import box_around, inside
from solver.linear import solvers as linear
from solver.linear.solvers import Begun
from solver.linear.window import Windowed

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy import sparse

    from solver.fem.region import Box
    from solver.materials.state import Response


_WINDOWS = 4
"""Number of windows kept in memory: a moving load passes from one to the next."""
_SMALL = 0.25
"""Ratio of the elements of a window to those of the body; above it a window saves too little."""


class Operator(Protocol):
    """The inverse of a part's stiffness, with its pins held."""

    def begin(self, force: NDArray[np.float64]) -> Begun:
        """Return the displacements for nodal forces (n,); contact forces may still change.

        ``kept`` and the argument of ``finish`` are (n,); only entries on contact surfaces count.
        """

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``rows K^-1 rows'`` for rows (m, len(dofs)) on unknowns of contact surfaces."""


class Stiff(Protocol):
    """A part whose stiffness is assembled.

    The unknowns ``active`` of all ``n`` are solved for; ``copied`` (n,) gives for each unknown the
    one whose value it takes; ``pattern`` is the upper triangle on the active ones. ``X`` are the
    nodes, ``dofs`` (n_elements, m) the unknowns of each element, ``points`` its points.
    """

    n: int
    active: NDArray[np.int64]
    copied: NDArray[np.int64]
    X: NDArray[np.float64]
    dofs: NDArray[np.int64]
    points: NDArray[np.float64]

    @property
    def pattern(self) -> sparse.csr_array:
        """Upper triangle of the stiffness on the active unknowns, values not set."""

    @property
    def elastic_data(self) -> NDArray[np.float64]:
        """Values of the elastic stiffness on ``pattern``."""

    def tangent_data(self, response: Response) -> NDArray[np.float64]:
        """Return the values of the tangent on ``pattern``."""


class Analysed:
    """The stiffness pattern of a part, and its unknowns on contact surfaces.

    Attributes
    ----------
    part : the body
    contact : active unknowns on its contact surfaces, kept
    kept : (n,) position of each unknown among those kept, -1 for the others
    solver : linear solver of the active unknowns

    Parameters
    ----------
    window : (n,) unknowns between which alone the stiffness changes; all by default
    """

    def __init__(
        self,
        part: Stiff,
        contact: NDArray[np.int64],
        name: str,
        window: NDArray[np.bool_] | None = None,
    ) -> None:
        self.part = part
        kept = np.isin(part.active, contact)
        if window is not None:
            kept &= window[part.active]
        self.contact = part.active[kept]
        self.kept = np.full(part.n, -1)
        self.kept[self.contact] = np.arange(len(self.contact))
        self.solver: linear.LinearSolver
        if window is None:
            self.solver = linear.analyse(part.pattern, name, np.flatnonzero(kept))
        else:
            elastic = part.pattern.copy()
            elastic.data = part.elastic_data
            self.solver = Windowed(elastic, window[part.active], np.flatnonzero(kept), name)

    def keeps(self, touched: NDArray[np.int64]) -> bool:
        """Whether the unknowns (m,) are kept, as far as they are active."""
        active = np.isin(touched, self.part.active)
        return bool((self.kept[touched[active]] >= 0).all())


class Factored:
    """A factorised tangent."""

    def __init__(self, analysed: Analysed, data: NDArray[np.float64]) -> None:
        self._analysed = analysed
        analysed.solver.factorise(data)

    def begin(self, force: NDArray[np.float64]) -> Begun:
        """See `Operator`."""
        part, contact = self._analysed.part, self._analysed.contact
        begun = self._analysed.solver.begin(force[part.active])
        motion = np.zeros(part.n)
        motion[contact] = begun.kept

        def finish(change: NDArray[np.float64]) -> NDArray[np.float64]:
            u = np.zeros(part.n)
            u[part.active] = begun.finish(change[contact])
            return u[part.copied]

        return Begun(motion[part.copied], finish)

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        place = self._analysed.kept[dofs]
        if (place < 0).all():  # supports hold the surface
            return np.zeros((len(rows), len(rows)))
        block = np.zeros((len(rows), self._analysed.kept.max() + 1))
        block[:, place[place >= 0]] = rows[:, place >= 0]
        return self._analysed.solver.compliance(block)


class PartOperators(Protocol):
    """The operators of a part."""

    @property
    def elastic(self) -> Operator:
        """The operator of the elastic stiffness."""

    def tangent(self, response: Response, blend: float, touched: NDArray[np.int64]) -> Operator:
        """Return the operator of ``(1 - blend) tangent + blend elastic stiffness``.

        ``touched`` are the unknowns on which contact forces act.
        """


class Operators:
    """The operators of one part; the elastic one is factorised once and kept.

    Parameters
    ----------
    contact : unknowns of its contact surfaces
    """

    def __init__(self, part: Stiff, contact: NDArray[np.int64], linear_solver: str) -> None:
        self._part = part
        self._contact = contact
        self._name = linear_solver
        self._windows: OrderedDict[Box, tuple[NDArray[np.bool_], Analysed | None]] = OrderedDict()

    @cached_property
    def elastic(self) -> Operator:
        """The elastic operator."""
        return Factored(Analysed(self._part, self._contact, self._name), self._part.elastic_data)

    @cached_property
    def _analysed(self) -> Analysed:
        return Analysed(self._part, self._contact, self._name)

    def tangent(self, response: Response, blend: float, touched: NDArray[np.int64]) -> Operator:
        """Return the operator of ``(1 - blend) tangent + blend elastic stiffness``."""
        if blend >= 1 or not response.yielding.any():
            return self.elastic
        data = self._part.tangent_data(response)
        if blend:
            data = (1 - blend) * data + blend * self._part.elastic_data
        return Factored(self._around(response, touched), data)

    def _around(self, response: Response, touched: NDArray[np.int64]) -> Analysed:
        """Return the pattern of a window around yielding and contact, or that of the whole body."""
        if linear.chosen(self._name) != "pardiso" or not len(touched):
            return self._analysed
        yielding = response.yielding.reshape(self._part.points.shape[1:]).any(axis=1)
        nodes = np.concatenate([self._part.dofs[yielding].ravel(), touched]) // 2
        box = box_around(self._part.X[:, nodes])
        if box not in self._windows:
            within = inside(box, self._part.points.mean(axis=2))
            window = np.zeros(self._part.n, dtype=bool)
            window[self._part.dofs[within]] = True
            small = within.mean() < _SMALL
            new = Analysed(self._part, self._contact, self._name, window) if small else None
            self._windows[box] = within, new
            while len(self._windows) > _WINDOWS:
                self._windows.popitem(last=False)
        self._windows.move_to_end(box)
        within, found = self._windows[box]
        known = found is not None and within[yielding].all() and found.keeps(touched)
        return found if found is not None and known else self._analysed


class Dense:
    """The inverse of a small dense stiffness on the unknowns ``active`` of ``n``."""

    def __init__(self, stiffness: NDArray[np.float64], active: NDArray[np.int64], n: int) -> None:
        inverse = cho_solve(cho_factor(stiffness), np.eye(len(stiffness)))
        self._inverse = np.zeros((n, n))
        self._inverse[np.ix_(active, active)] = 0.5 * (inverse + inverse.T)

    def begin(self, force: NDArray[np.float64]) -> Begun:
        """See `Operator`."""
        u = self._inverse @ force
        return Begun(u, lambda change: u + self._inverse @ change)

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        return np.asarray(rows @ self._inverse[np.ix_(dofs, dofs)] @ rows.T)


class Fixed:
    """The operators of a part whose stiffness never changes."""

    def __init__(self, operator: Operator) -> None:
        self.elastic = operator

    def tangent(self, response: Response, blend: float, touched: NDArray[np.int64]) -> Operator:
        """Return the elastic operator."""
        del response, blend, touched
        return self.elastic
