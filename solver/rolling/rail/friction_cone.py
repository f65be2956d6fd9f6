"""The frictional contact problem of a surface that rolls, with friction in two directions.

Unknowns are pressure p and shear q = (q_x, q_s) at the points of a surface, stations times
vertices, and rigid motions. Gap g and slip w depend linearly on them::

    (w_x, g, w_s) = offset + influence (q_x, p, q_s) + motions r
    weights (q_x, p, q_s) = resultants
    p >= 0, g >= 0, p g = 0
    |q| <= b(p),  w = 0 where |q| < b(p),  q = -b(p) w / |w| where w is not 0

The bound b(p) is the least of some lines, mu p by Coulomb's law. The conditions are
p = max(0, p - c g) and q = the vector nearest to q - d w with |q| <= b(p), for any c, d > 0.
Newton's method solves them: influences of all points come from a Fourier transform, and only closed
points are unknowns, with pressure and two shears where they stick, pressure and the shear across
the slip where they slip.

P. Alart, A. Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991) 353-375, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.errors import NoContact
from solver.late import late
from solver.linear.iterative import RefinedLU
from solver.model.friction import BoundLines, PatchStatus
from solver.rolling.passing import searched
from solver.typing import Array, Ints

(between,) = late("rolling.kernels", "between")


class Influence:
    """A linear map from values (n, m, 3) at stations and vertices to others of this shape.

    Parameters
    ----------
    kernel : (2n, m, 3, m, 3), entry ``[d, i, a, j, b]`` is the effect on value a at vertex i, d
        stations downstream of value b at vertex j; negative d are at the end, as in an FFT
    """

    def __init__(self, kernel: Array) -> None:
        length, m = kernel.shape[:2]
        self.shape = (length // 2, m, 3)
        self._spectrum = np.fft.rfft(kernel.reshape(length, 3 * m, 3 * m), axis=0)
        self._blocks = np.ascontiguousarray(kernel.transpose(0, 1, 3, 2, 4))

    def of(self, values: Array) -> Array:
        """Return the effects (n, m, 3) of values (n, m, 3)."""
        return self.everywhere(values)[: self.shape[0]]

    def everywhere(self, values: Array) -> Array:
        """Return the effects (2n, m, 3); those at stations before the first are at the end."""
        n, m, _ = self.shape
        modes = np.fft.rfft(values.reshape(n, 3 * m, 1), 2 * n, axis=0)
        return np.fft.irfft(self._spectrum @ modes, 2 * n, axis=0).reshape(2 * n, m, 3)

    def own(self) -> Array:
        """Return the effects (m, 3, 3) of the values at a point on that point itself."""
        vertices = np.arange(self.shape[1])
        return self._blocks[0, vertices, vertices]

    def between(self, at: Ints, rows: Array, by: Ints, columns: Array) -> Array:
        """Return the effects (len(at), len(by)) of some combinations of values on others.

        Parameters
        ----------
        at, by : flat numbers of points, station * m + vertex
        rows : (len(at), 3) weights of the effects' components
        columns : (len(by), 3) components of the values
        """
        return between(self._blocks, at, rows, by, columns)


OPEN, STICK, SLIP = map(int, PatchStatus)
"""Status of a point."""
NORMAL, TANGENTS = 1, (0, 2)
"""Places of the normal and of the tangents among local axes (x, normal, tangent across)."""

TOLERANCE = 1e-9
"""Tolerance: largest error of a condition over the largest pressure; for shear, over that times the
steepest slope of the friction bound."""
_STEPS = 60
_SHORTEST = 1 / 256
"""Smallest share of a Newton step in the line search. Where all points slip, a creepage that
follows from a given moment may overshoot a hundredfold."""
_LOST = 1e6
"""Motions grow without bound if |q - d w| exceeds this multiple of the pressure of the whole load
on one point."""
_LOOSE = "the contact forces are not determined: nothing holds the wheel"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConeProblem:
    """One problem, of n stations, m vertices and k rigid motions.

    Values and effects have local axes: (q_x, p, q_s) and (w_x, g, w_s).

    Attributes
    ----------
    influence : effects (n, m, 3) of values (n, m, 3) [mm/MPa]
    offset : (n, m, 3) effects without tractions and motions [mm]
    lines : (n_lines, 1) lines of the largest shear over pressure
    motions : (k, n, m, 3) effects of the rigid motions
    weights : (k, n, m, 3) weights of sums that are prescribed, such as areas [mm2]
    resultants : (k,) prescribed values of the sums [N]; the first is the load
    """

    influence: Influence
    offset: Array
    lines: BoundLines
    motions: Array
    weights: Array
    resultants: Array

    @property
    def steepest(self) -> float:
        """Steepest slope of the friction bound; 0 without friction."""
        return float(self.lines.slope.max())


def solve_cone(
    problem: ConeProblem, values: Array, rigid: Array, tolerance: float = TOLERANCE
) -> ConeSolution:
    """Return the solution, by Newton's method from these values (n, m, 3) and motions (k,).

    Raises
    ------
    NoContact
        if none was found
    """
    here, tangent = ConeSolution(problem, values, rigid), None
    most = _LOST * abs(problem.resultants[0]) / np.abs(problem.weights[0]).max()
    for step in range(_STEPS):
        if here.error <= tolerance * here.values[..., NORMAL].max():
            here.steps, here.tangent = step, tangent
            return here
        tangent = _Tangent(here)

        def moved(
            share: float, here: ConeSolution = here, step: tuple[Array, Array] = tangent.step()
        ) -> ConeSolution:
            change, motion = step
            return ConeSolution(problem, here.values + share * change, here.rigid + share * motion)

        here = searched(moved, here.size, _SHORTEST)
        if not here.pull.max() < most:
            break
    raise NoContact(f"no contact forces were found in {step + 1} steps of Newton's method")


class ConeSolution:
    """Values and rigid motions, and their errors in the conditions: an iterate, or the solution.

    Attributes
    ----------
    values : (n, m, 3) pressure and shear [MPa]
    effects : (n, m, 3) gap and slip [mm]
    rigid : (k,) rigid motions
    status : (n, m) OPEN, STICK or SLIP
    steps, tangent : number of Newton steps to the solution, and the last one's equations
    """

    def __init__(self, problem: ConeProblem, values: Array, rigid: Array) -> None:
        self.problem, self.values, self.rigid = problem, values, rigid
        self.steps = 0
        self.tangent: _Tangent | None = None
        moved = np.tensordot(rigid, problem.motions, 1)
        self.effects = problem.offset + problem.influence.of(values) + moved
        own = problem.influence.own()
        self.stiffness = 1 / own[:, NORMAL, NORMAL].mean()
        self.grip = 2 / sum(own[:, a, a].mean() for a in TANGENTS)
        p, q = values[..., NORMAL], values[..., TANGENTS]
        pushed = p - self.stiffness * self.effects[..., NORMAL]
        self.closed = pushed > 0
        pressed, lines = np.maximum(p, 0).ravel(), problem.lines
        line = lines.piece(pressed)
        self.slope, self.level = (of[line, 0].reshape(p.shape) for of in lines)
        self.bound = lines.least(pressed).reshape(p.shape)
        pulled = q - self.grip * self.effects[..., TANGENTS]
        self.pull = np.hypot(pulled[..., 0], pulled[..., 1])
        slips = self.closed & (self.pull > self.bound)
        self.status = np.where(slips, SLIP, np.where(self.closed, STICK, OPEN))
        self.heading = np.zeros_like(q)
        np.divide(pulled, self.pull[..., None], out=self.heading, where=slips[..., None])
        nearest = np.where(slips[..., None], self.bound[..., None] * self.heading, pulled)
        self.missed = q - np.where(self.closed[..., None], nearest, 0)
        self.unbalanced = problem.resultants - np.tensordot(problem.weights, values, values.ndim)
        largest = np.abs(problem.weights).max(axis=(1, 2, 3))
        balance = self.unbalanced / largest / np.sqrt(max(self.closed.sum(), 1))
        normal = np.append(p - np.maximum(pushed, 0), balance[0])
        tangential = np.append(self.missed, balance[1:])
        self.error = float(max(
            np.abs(normal).max(), np.abs(tangential).max() / (problem.steepest or 1.0)
        ))  # fmt: skip
        self.size = float(np.hypot(np.linalg.norm(normal), np.linalg.norm(tangential)))

    def along(self, change: Array) -> tuple[Array, Array]:
        """Return the change of values and rigid motions with that of the offset (n, m, 3).

        The equations are those of the last Newton step, if no point has changed its status since.
        """
        if self.tangent is None or not self.tangent.holds(self):
            self.tangent = _Tangent(self)
        return self.tangent.along(change)


class _Tangent:
    """Newton's equations at an iterate, factorised: one for each unknown of its closed points."""

    def __init__(self, here: ConeSolution) -> None:
        problem = here.problem
        self._here, self._influence = here, problem.influence
        status, pull, bound = (a.ravel() for a in (here.status, here.pull, here.bound))
        along = here.heading.reshape(-1, 2)
        closed = np.flatnonzero(status != OPEN)
        rough = problem.steepest > 0
        stick = np.flatnonzero(status == STICK) if rough else closed[:0]
        slip = np.flatnonzero(status == SLIP) if rough else closed[:0]
        self._at = np.concatenate([closed, stick, stick, slip])
        self._slipping = slice(len(closed) + 2 * len(stick), None)
        columns = np.zeros((len(self._at), 3))
        columns[: len(closed), NORMAL] = 1
        rows = columns.copy()
        columns[: len(closed), TANGENTS] = here.slope.reshape(-1, 1)[closed] * along[closed]
        for axis, first in zip(TANGENTS, (len(closed), len(closed) + len(stick)), strict=True):
            rows[first : first + len(stick), axis] = 1
        # the direction across the slip
        rows[self._slipping, 0], rows[self._slipping, 2] = -along[slip, 1], along[slip, 0]
        columns[len(closed) :] = rows[len(closed) :]
        held = bound[slip] / pull[slip]
        rows[self._slipping] *= held[:, None]
        self._rows, self._columns = rows, columns
        size, k = len(self._at), len(problem.resultants)
        motions, weights = (
            a.reshape(k, -1, 3)[:, self._at] for a in (problem.motions, problem.weights)
        )
        unit = 1 / here.stiffness
        self._unit = unit / np.abs(problem.motions).max(axis=(1, 2, 3))
        self._scale = unit / np.abs(problem.weights).max(axis=(1, 2, 3))
        S = np.zeros((size + k, size + k))
        S[:size, :size] = problem.influence.between(self._at, rows, self._at, columns)
        slipping = np.arange(size)[self._slipping]
        S[slipping, slipping] += (1 - held) / here.grip
        S[:size, size:] = np.einsum("knb,nb->nk", motions, rows) * self._unit
        S[size:, :size] = np.einsum("knb,nb->kn", weights, columns) * self._scale[:, None]
        try:
            self._factors = RefinedLU(S)
        except ZeroDivisionError:
            raise NoContact(_LOOSE) from None

    def holds(self, other: ConeSolution) -> bool:
        """Whether points have the same status at another iterate."""
        return bool((self._here.status == other.status).all())

    def step(self) -> tuple[Array, Array]:
        """Return Newton's change of values (n, m, 3) and rigid motions (k,)."""
        here = self._here
        known = np.where(here.closed[..., None], 0, -here.values)
        slips = here.status == SLIP
        p, q = here.values[..., NORMAL], here.values[..., TANGENTS]
        short = here.slope * p + here.level - (q * here.heading).sum(axis=-1)
        known[..., TANGENTS] += np.where(slips, short, 0)[..., None] * here.heading
        if not here.problem.steepest:
            known[..., TANGENTS] = -q
        follows = self._influence.of(known)
        wanted = -self._of(here.effects + follows)
        across = self._of(follows)[self._slipping]
        aside = (q.reshape(-1, 2)[self._at[self._slipping]]
                 * self._columns[self._slipping][:, TANGENTS]).sum(axis=1)  # fmt: skip
        wanted[self._slipping] = -aside / here.grip - across
        weights = here.problem.weights
        missing = here.unbalanced - np.tensordot(weights, known, known.ndim)
        change, rigid = self._solve(wanted, missing)
        return known + change, rigid

    def along(self, change: Array) -> tuple[Array, Array]:
        """Return the change of values and rigid motions with that of the offset (n, m, 3)."""
        return self._solve(-self._of(change), np.zeros(len(self._unit)))

    def _of(self, effects: Array) -> Array:
        """Return the combinations of effects that the equations contain."""
        return np.asarray((effects.reshape(-1, 3)[self._at] * self._rows).sum(axis=1))

    def _solve(self, wanted: Array, missing: Array) -> tuple[Array, Array]:
        size = len(self._at)
        rhs = np.concatenate([wanted, self._scale * missing])
        try:
            found = self._factors.solve(rhs)
        except ZeroDivisionError:
            raise NoContact(_LOOSE) from None
        if not np.isfinite(found).all():
            raise NoContact(_LOOSE)
        values = np.zeros((self._here.status.size, 3))
        np.add.at(values, self._at, found[:size, None] * self._columns)
        return values.reshape(self._here.values.shape), found[size:] * self._unit
