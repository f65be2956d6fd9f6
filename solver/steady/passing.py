"""One steady pass: the strain that a load leaves and makes as it goes by, found by Newton's method.

In the frame of the load nothing changes in time. With e the strains of what the pass adds to the
displacements, at the points of the window, and ep(e) the plastic strain that material has gathered
on its way along the rows, equilibrium is the fixed point

    e = Phi(e) = S load(u),   u = K^-1 f(ep(e) - ep before)

with the elastic stiffness K, the same for every pass, and the nodal forces f that stand for plastic
strain. A load adds the displacements that it makes; it may depend on those without it. Newton's
equation (I - Phi') d = Phi(e) - e is solved by GMRES, Phi' by the derivative of the flow along the
rows.

K. Dang Van, M.H. Maitournam, J. Mech. Phys. Solids 41 (1993) 1691-1710.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from solver.errors import LimitLoad, NotConverged, WindowTooSmall
from solver.steady.flow import RowFlow, usual_parts

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.materials.state import PlasticState
    from solver.steady.layers import Layers
    from solver.steady.load import AppliedLoad, PassingLoad
    from solver.steady.track import Track

    Array = NDArray[np.float64]

TOLERANCE = 1e-4
"""Deviatoric strain of the residual, times 2 G, over the yield stress, at which a pass is found."""

_FORCING = 0.1
"""Relative error with which Newton's equation is solved."""
_KRYLOV, _MOST_KRYLOV = 60, 240
"""Most solves for one step of Newton's: at first, and where that is too few."""
_STALLED = 0.98
"""Ratio of residuals above which a step that was not solved to the end leads nowhere."""
_FAR_FROM = 0.01
"""Residual, over the first one, above which a pass is far from being found."""
_STEPS = 60
_SHORTEST = 1 / 32
"""Least part of a Newton step."""
_AWAY = 3.0
"""Growth of the residual that a whole step may cause."""
_FLOWS, _RUNS = 0.1, 1.0
"""Plastic strain of a pass. A solve that stalls counts as a limit load above the first, any solve
above the second. A material that hardens has no limit: there Newton's method has diverged."""
_PATIENCE, _PROGRESS = 14, 0.7
"""After so many steps the residual must be smaller than this part of what it was."""


@dataclass(frozen=True, slots=True)
class Pass:
    """A steady pass.

    Attributes
    ----------
    law : of the material
    parts : increments between two points of a row
    before, after : state by depth, as the load sees it, which goes along +x
    strain : (n_rows, n_columns, 4) Mandel strain that the pass adds, at the points of the window
    states : internal variables (..., n_rows, n_columns) there
    ago : the same at the beginning of the last increment before each point
    surface : internal variables (..., n, n_columns) at the surface above the n uppermost rows
    loading : the load on it
    left_over : largest deviatoric strain of the residual
    steps, solves : of Newton's method, of the stiffness
    direction : 1 if the load goes along +x, -1 if it goes back
    """

    law: Law
    parts: int
    before: Layers
    after: Layers
    strain: Array
    states: PlasticState
    ago: PlasticState
    surface: PlasticState
    loading: AppliedLoad
    left_over: float
    steps: int
    solves: int
    direction: int = 1

    @property
    def plastic_strain(self) -> Array:
        """Plastic strain (n_rows, n_columns, 4), Mandel."""
        return np.moveaxis(self.states.plastic_strain, 0, 2)

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n_rows, n_columns)."""
        return self.states.accumulated

    @property
    def gathered(self) -> float:
        """The most accumulated plastic strain that any point gathers."""
        return float((self.accumulated - self.before.accumulated[:, None]).max())

    @property
    def left(self) -> Layers:
        """The state that the pass leaves, as one sees it who stands beside the track."""
        return self.after if self.direction == 1 else self.after.mirrored


def passing(
    track: Track,
    material: Law,
    load: PassingLoad,
    before: Layers,
    guess: Array | None = None,
    *,
    parts: int | None = None,
    tolerance: float = TOLERANCE,
) -> Pass:
    """Return the steady pass of a load over a half-plane.

    Parameters
    ----------
    track : the half-plane
    material : its law
    load : that passes
    before : state by depth
    guess : strains that a pass like this one adds
    parts : increments between two points of a row, `usual_parts` if None
    tolerance : on the strain of the residual

    Raises
    ------
    LimitLoad
        if plastic strain grows without bound in a material that does not harden
    WindowTooSmall
        if rows yield where the window begins, or the deepest one yields
    NotConverged
        if no steady pass was found
    """
    rows, solve = track.rows, track.operator.solve
    parts = parts or usual_parts(material)
    shape = (*rows.shape, 4)
    scale = np.sqrt(rows.weights)[..., None]
    double_shear = 2 * material.elasticity.shear_modulus
    solves, krylov = 0, _KRYLOV

    def at(added: Array) -> _At:
        nonlocal solves
        solves += 1
        flow = RowFlow(rows, material, before, added, parts)
        loading = load.on(solve(flow.force))
        residual = rows.strain(loading.u) - added
        return _At(added, flow, loading, residual, float(np.linalg.norm(scale * residual)))

    nothing = np.zeros(len(track.operator.kept))
    here = at(rows.strain(load.on(nothing).u) if guess is None else guess)
    start, sizes = here.size, [here.size]
    for step in range(_STEPS):
        left_over = _deviation(here.residual)
        if left_over * double_shear < tolerance * material.yield_stress:
            flow = here.flow
            if flow.beyond:
                raise WindowTooSmall(f"the window is too small {flow.beyond} for a steady pass")
            surface, top = flow.surface()
            return Pass(
                law=material,
                parts=parts,
                before=before,
                after=replace(flow.after, surface=top),
                strain=here.added,
                states=flow.states,
                ago=flow.ago,
                surface=surface,
                loading=here.loading,
                left_over=left_over,
                steps=step,
                solves=solves,
            )

        def newton(scaled: Array, here: _At = here) -> Array:
            nonlocal solves
            solves += 1
            change = scaled.reshape(shape) / scale
            made = rows.strain(here.loading.along(solve(here.flow.along(change))))
            return np.asarray((scale * (change - made)).ravel())

        n = here.residual.size
        found, missed = gmres(
            LinearOperator((n, n), matvec=newton, dtype=float),
            (scale * here.residual).ravel(), rtol=_FORCING, restart=krylov, maxiter=1,
        )  # fmt: skip
        there = _along(at, here, found.reshape(shape) / scale)
        gathered = there.flow.gathered
        stalled = krylov == _MOST_KRYLOV and missed and there.size > _STALLED * here.size
        unsolved = here.size > _FAR_FROM * start
        if gathered > _RUNS or (stalled and unsolved and gathered > _FLOWS):
            raise _lost(material, gathered)
        if missed:
            krylov = min(2 * krylov, _MOST_KRYLOV)
        here = there
        sizes.append(here.size)
        earlier = min(sizes[:-_PATIENCE], default=np.inf)
        if unsolved and min(sizes[-_PATIENCE:]) > _PROGRESS * earlier:
            break
    raise NotConverged(f"no steady pass was found in {len(sizes) - 1} steps of Newton's method")


@dataclass(frozen=True, slots=True)
class _At:
    """Where Newton's method is: strains, what they make, the residual and its norm."""

    added: Array
    flow: RowFlow
    loading: AppliedLoad
    residual: Array
    size: float


def _along(at: Callable[[Array], _At], here: _At, change: Array) -> _At:
    """Return where a step leads: the whole of it, or a part that makes the residual smaller.

    The residual has kinks where points begin to yield. Where every part makes it larger, the whole
    step is taken, which leaves the kink, unless it leads far away.
    """
    tried = []
    length = 1.0
    while length >= _SHORTEST:
        try:
            there = at(here.added + length * change)
        except NotConverged as error:  # no contact with such a shape
            failure = error
        else:
            if there.size < (1 - 1e-4 * length) * here.size:
                return there
            tried.append(there)
        length /= 2
    if not tried:
        raise failure
    return tried[0] if tried[0].size < _AWAY * here.size else min(tried, key=lambda a: a.size)


def _lost(material: Law, gathered: float) -> NotConverged:
    """Return that Newton's method was led to this plastic strain, and found no pass there."""
    if not material.hardens:
        return LimitLoad("plastic strain grows without bound in a steady pass")
    return NotConverged(
        f"no steady pass was found up to a plastic strain of {gathered:.0%}, "
        "far beyond small strains; the material hardens, this is not its limit"
    )


def _deviation(strain: Array) -> float:
    """Return the largest norm of the deviators of strains (..., 4)."""
    mean = strain[..., :3].mean(axis=-1)
    square = (strain**2).sum(axis=-1) - 3 * mean**2
    return float(np.sqrt(square.max()))
