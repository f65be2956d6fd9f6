"""One steady pass: the strain that a load leaves and makes as it goes by, found by Newton's method.

In the frame of the load nothing changes in time. With e the strains of what the pass adds to the
displacements, at the points of the window, and ep(e) the plastic strain that material has gathered
on its way along the rows, equilibrium is the fixed point

    e = Phi(e) = S K^-1 (f + load(f)),   f = f(ep(e) - ep before)

with the elastic stiffness K, the same for every pass, and the nodal forces f that stand for plastic
strain. A load may depend on the shape that these give the surface. Newton's equation
(I - Phi') d = Phi(e) - e is solved by GMRES, Phi' by the derivative of the flow along the rows.

K. Dang Van, M.H. Maitournam, J. Mech. Phys. Solids 41 (1993) 1691-1710.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from solver.errors import LimitLoad, NotConverged
from solver.steady import sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.material import Material
    from solver.steady.layers import Layers
    from solver.steady.load import Load, Loading
    from solver.steady.rows import Rows

    Array = NDArray[np.float64]

TOLERANCE = 1e-4
"""Deviatoric strain of the residual, times 2 G, over the yield stress, at which a pass is found."""

_QUIET = 1e-3
"""Plastic strain at the ends of the window / yield strain, up to which it is large enough."""
_FORCING = 0.1
"""Relative error with which Newton's equation is solved."""
_KRYLOV = 60
"""Most solves for one step of Newton's."""
_STEPS = 60
_SHORTEST = 1 / 64
_FLOWS = 0.5
"""Plastic strain gathered in one pass above which a pass that is not found flows without limit."""


@dataclass(frozen=True, slots=True)
class Pass:
    """A steady pass.

    Attributes
    ----------
    before, after : state by depth, as the load sees it, which goes along +x
    strain : (n_rows, n_columns, 4) Mandel strain that the pass adds, at the points of the window
    plastic_strain : (n_rows, n_columns, 4) there
    accumulated : (n_rows, n_columns) there
    loading : the load on it
    steps, solves : of Newton's method, of the stiffness
    direction : 1 if the load goes along +x, -1 if it goes back
    """

    before: Layers
    after: Layers
    strain: Array
    plastic_strain: Array
    accumulated: Array
    loading: Loading
    steps: int
    solves: int
    direction: int = 1

    @property
    def left(self) -> Layers:
        """The state that the pass leaves, as one sees it who stands beside the track."""
        return self.after if self.direction == 1 else self.after.mirrored


class _Flow:
    """What material gathers on its way along the rows for given strains, and its derivative."""

    def __init__(
        self, rows: Rows, material: Material, before: Layers, added: Array, parts: int
    ) -> None:
        rule, elasticity = material.hardening_rule, material.elasticity
        double_shear = 2 * elasticity.shear_modulus
        self._law = np.array(
            [
                double_shear,
                double_shear + rule.prager_modulus,
                rule.isotropic_modulus,
                double_shear + 2 / 3 * rule.modulus,
                rule.yield_stress,
            ]
        )
        self._rows = rows
        at_rest = before.strain(elasticity)[:, None]
        strain = np.concatenate([at_rest, at_rest + added], axis=1)
        start = before.plastic_strain, before.accumulated
        self.plastic, self.total, self._path = sweep.flow(strain, *start, self._law, parts)
        ends = np.ascontiguousarray(self.plastic[:, -1]), self.total[:, -1].copy()
        closed = sweep.close(*ends, self._law, elasticity.bulk_modulus)
        self.after = replace(before, plastic_strain=closed[0], accumulated=closed[1])
        self._closing = closed[2:]
        self.force = rows.force(
            self.plastic - before.plastic_strain[:, None],
            closed[0] - before.plastic_strain,
        )

    @property
    def beyond(self) -> str:
        """Where the window is too small: rows yield at its end already; empty if nowhere.

        Rows that an earlier pass left on the yield surface may flow by next to nothing there.
        """
        ahead = self._path[:, 0, :, 4].max()
        below = max(self._path[-1, :, :, 4].max(), self._closing[0][-1, 4])
        quiet = _QUIET * self._law[4] / self._law[0]
        return "ahead" if ahead > quiet else "below" if below > quiet else ""

    def along(self, added: Array) -> Array:
        """Return the nodal forces (n,) for a change of the strains."""
        plastic, total = sweep.flow_along(added, self._law, self._path)
        ends = np.ascontiguousarray(plastic[:, -1]), total[:, -1].copy()
        closed = sweep.close_along(*ends, self._law, *self._closing)
        return self._rows.force(plastic, closed)


def passing(
    rows: Rows,
    material: Material,
    load: Load,
    before: Layers,
    guess: Array | None = None,
    *,
    parts: int = 16,
    tolerance: float = TOLERANCE,
) -> Pass:
    """Return the steady pass of a load over a half-plane.

    Parameters
    ----------
    rows : of the half-plane's points
    material : its law
    load : that passes
    before : state by depth
    guess : strains that a pass like this one adds
    parts : increments between two points of a row
    tolerance : on the strain of the residual

    Raises
    ------
    LimitLoad
        if plastic strain grows without bound
    NotConverged
        if no steady pass was found, or the window is too small for it
    """
    shape = (*rows.shape, 4)
    scale = np.sqrt(rows.weights)[..., None]
    double_shear = 2 * material.shear_modulus
    solves = 0

    def phi(added: Array) -> tuple[_Flow, Loading, Array]:
        nonlocal solves
        solves += 1
        flow = _Flow(rows, material, before, added, parts)
        loading = load.on(flow.force)
        return flow, loading, rows.strain(flow.force + loading.force) - added

    added = rows.strain(load.on(np.zeros(rows.part.n)).force) if guess is None else guess
    flow, loading, residual = phi(added)
    size = np.linalg.norm(scale * residual)
    for step in range(_STEPS):
        if _deviation(residual) * double_shear < tolerance * material.yield_stress:
            if flow.beyond:
                raise NotConverged(f"the window is too small {flow.beyond} for a steady pass")
            return Pass(before, flow.after, added, flow.plastic, flow.total, loading, step, solves)

        def newton(scaled: Array, flow: _Flow = flow, loading: Loading = loading) -> Array:
            nonlocal solves
            solves += 1
            change = scaled.reshape(shape) / scale
            force = flow.along(change)
            made = rows.strain(force + loading.along(force))
            return np.asarray((scale * (change - made)).ravel())

        n = residual.size
        found, missed = gmres(
            LinearOperator((n, n), matvec=newton, dtype=float),
            (scale * residual).ravel(), rtol=_FORCING, restart=_KRYLOV, maxiter=1,
        )  # fmt: skip
        change = found.reshape(shape) / scale
        length = 1.0
        while True:
            trial = added + length * change
            flow, loading, residual_there = phi(trial)
            there = np.linalg.norm(scale * residual_there)
            if there < (1 - 1e-4 * length) * size or length <= _SHORTEST:
                break
            length /= 2
        gathered = float((flow.total - before.accumulated[:, None]).max())
        if missed and gathered > _FLOWS:
            raise LimitLoad("plastic strain grows without bound in a steady pass")
        added, residual, size = trial, residual_there, there
    raise NotConverged(f"no steady pass was found in {_STEPS} steps of Newton's method")


def _deviation(strain: Array) -> float:
    """Return the largest norm of the deviators of strains (..., 4)."""
    mean = strain[..., :3].mean(axis=-1)
    square = (strain**2).sum(axis=-1) - 3 * mean**2
    return float(np.sqrt(square.max()))
